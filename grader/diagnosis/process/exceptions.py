"""What to try after an exception: the tables beside this module, and what no table can tell."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template

from pydantic import Field

from grader.diagnosis.explanation import Explanation, Symptom, add, explanation
from grader.diagnosis.process.failure import Failure, Frame
from grader.diagnosis.process.raised import student_place
from grader.findings.wording import code
from grader.recording.model import Recording
from grader.spec.source import Model, read_source
from grader.submission.record import CPP, PYTHON

_UNDEFINED = re.compile(r"name '(\w+)' is not defined")


@dataclass(frozen=True)
class Raised(Symptom[str]):
    """A program raised an exception.

    The explanations answer with a hint.
    """

    failure: Failure
    recording: Recording


class Row(Model):
    """A row of a table: a mistake, how to recognise its exception, and what to try.

    Attributes:
        only: The one language of the programs that it explains, or nothing if any.
    """

    mistake: str
    example: str
    only: str = ""
    line: str = ""
    type: str = ""
    message: str = ""
    raised_in: str = ""
    source: str = ""
    hint: str

    def __call__(self, symptom: Raised) -> str | None:
        """The hint, if the exception is that of the mistake."""
        failure = symptom.failure
        last = failure.frames[-1] if failure.frames else Frame("", 0)
        found = re.search(self.message, failure.message)
        # Classes of C++ have the same names as those of Python, in a namespace.
        is_type = not self.type or re.fullmatch(self.type, failure.type.rpartition("::")[2])
        is_other = self.only == CPP and not failure.compiled
        if found is None or not is_type or is_other or self.raised_in not in last.file:
            return None
        names = {key: text for key, text in found.groupdict().items() if text}
        if not re.search(Template(self.source).safe_substitute(names), last.source):
            return None
        return Template(self.hint).safe_substitute(names)


class Table(Model):
    """The whole of ``exceptions.yaml``, or of ``exceptions_cpp.yaml``.

    Attributes:
        imports: The beginning of a line that imports something -> names, with blanks between.
    """

    exceptions: tuple[Row, ...]
    imports: dict[str, str] = Field(default_factory=dict)


TABLE = read_source(Path(__file__).with_suffix(".yaml")).read(Table)
CPP_ROWS = [
    row.model_copy(update={"only": CPP})
    for row in read_source(Path(__file__).with_name("exceptions_cpp.yaml")).read(Table).exceptions
]
_GDB = (
    "Find the line with a debugger: `ros2 run --prefix 'gdb -ex run --args' PACKAGE EXECUTABLE`, "
    "then `bt` for the functions that were being called. It names lines only if the program is "
    "built with -g."
)


@explanation(Raised, only=PYTHON)
def not_imported(symptom: Raised) -> str | None:
    """A well-known name of ROS 2 or Python, such as Twist or math, is not imported."""
    found = _UNDEFINED.match(symptom.failure.message)
    for beginning, names in TABLE.imports.items():
        if found and found[1] in names.split():
            return (
                "If you mean the one of ROS or Python, import it at the top of the file: "
                f"{code(f'{beginning} {found[1]}')}. Otherwise it is misspelt, or used before it "
                "is defined."
            )
    return None


for _row in (*CPP_ROWS, *TABLE.exceptions):
    add(
        Explanation(
            Raised, _row.mistake, _row, __name__, _row.mistake, example=_row.example, only=_row.only
        )
    )


@explanation(Raised, general=True)
def any_exception(symptom: Raised) -> str | None:
    """Any other exception: the line that raised it is named."""
    if student_place(symptom.failure, symptom.recording.submission):
        return "Correct the line that is named here."
    if symptom.failure.compiled:
        return _GDB
    if not symptom.failure.frames:
        return None
    return "Read the traceback from its last line upwards."
