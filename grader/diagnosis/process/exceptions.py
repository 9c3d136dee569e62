"""What to try after an exception: the table ``exceptions.yaml``, and what no table can tell."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template

from grader.diagnosis.explanation import Explanation, Symptom, add, explanation
from grader.diagnosis.process.missing_import import import_hint
from grader.diagnosis.process.missing_library import library_hint
from grader.diagnosis.process.raised import Failure, student_place, submission_path
from grader.recording.model import Recording
from grader.spec.source import Model, read_source

TABLE = Path(__file__).with_suffix(".yaml")


@dataclass(frozen=True)
class Raised(Symptom[str]):
    """A program raised an exception.

    The explanations answer with a hint.
    """

    failure: Failure
    recording: Recording


class Row(Model):
    """A row of the table: a mistake, how to recognise its exception, and what to try."""

    mistake: str
    type: str = ""
    message: str = ""
    raised_in: str = ""
    source: str = ""
    hint: str

    def __call__(self, symptom: Raised) -> str | None:
        """The hint, if the exception is that of the mistake."""
        failure = symptom.failure
        last = failure.frames[-1] if failure.frames else None
        found = re.search(self.message, failure.message)
        if found is None or (self.type and self.type != failure.type):
            return None
        names = {key: text for key, text in found.groupdict().items() if text}
        if self.raised_in not in (last.file if last else ""):
            return None
        source = Template(self.source).safe_substitute(names)
        if not re.search(source, last.source if last else ""):
            return None
        return Template(self.hint).safe_substitute(names)


class Table(Model):
    """The whole of the table."""

    exceptions: tuple[Row, ...]


@explanation(Raised)
def unknown_library(symptom: Raised) -> str | None:
    """A Python library that the assignment does not allow is imported."""
    if symptom.failure.type != "ModuleNotFoundError":
        return None
    return library_hint(symptom.failure.message, symptom.recording)


@explanation(Raised)
def not_imported(symptom: Raised) -> str | None:
    """A well-known name of ROS 2 or Python, such as Twist or math, is not imported."""
    return import_hint(symptom.failure.message) if symptom.failure.type == "NameError" else None


_document, _ = read_source(TABLE).examine(Table)
assert _document is not None
for _row in _document.exceptions:
    add(Explanation(Raised, _row, __name__, _row.mistake))


@explanation(Raised)
def no_such_attribute(symptom: Raised) -> str | None:
    """A module has no such name, or console_scripts in setup.py names no function of it."""
    failure = symptom.failure
    if failure.type != "AttributeError" or not failure.message.startswith("module "):
        return None
    # Where Python itself loads the entry point, the last frame is its own.
    if submission_path(failure.frames[-1].file, symptom.recording.submission):
        return (
            "The module has no such name: check its spelling. A module inside of another one "
            "must be imported itself, as in `from rclpy.node import Node`."
        )
    return "setup.py's console_scripts names a function that the module does not have."


@explanation(Raised, general=True)
def any_exception(symptom: Raised) -> str:
    """Any other exception: the line that raised it is named."""
    if student_place(symptom.failure, symptom.recording.submission):
        return "Correct the line that is named here."
    return "Read the traceback from its last line upwards."
