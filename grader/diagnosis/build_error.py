"""What to do about the first error of a build, by the table ``build_error.yaml``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template

from grader.diagnosis.explanation import Explanation, Symptom, add, explanation
from grader.spec.source import Model, read_source
from grader.submission.record import CPP, PYTHON, PackageRecord, SourceError


@dataclass(frozen=True)
class BuildError(Symptom[str]):
    """A build ended with an error.

    The explanations answer with a hint.
    """

    error: SourceError
    package: PackageRecord


class Row(Model):
    """A row of the table: a mistake, how to recognise its error, and what to do."""

    mistake: str
    examples: tuple[str, ...]
    message: str
    file: str = r"(?<!\.py)$"
    hint: str

    def __call__(self, symptom: BuildError) -> str | None:
        """The hint, if the error is that of the mistake."""
        found = re.search(self.message, symptom.error.message)
        if found is None or not re.search(self.file, symptom.error.file):
            return None
        return Template(self.hint).safe_substitute(
            found.groupdict(""), package=symptom.package.name
        )


class Table(Model):
    """The whole of ``build_error.yaml``."""

    errors: tuple[Row, ...]


TABLE = read_source(Path(__file__).with_suffix(".yaml")).read(Table)


for _row in TABLE.errors:
    _example = _row.examples[0]
    _only = PYTHON if "setup" in _row.file else CPP
    add(
        Explanation(
            BuildError, _row.mistake, _row, __name__, _row.mistake, example=_example, only=_only
        )
    )


@explanation(BuildError, general=True)
def any_build_error(symptom: BuildError) -> str:
    """Any other error: the build is run again to see it."""
    return (
        f"Run `colcon build --packages-select {symptom.package.name}` in the workspace and correct "
        "the first error that it prints."
    )
