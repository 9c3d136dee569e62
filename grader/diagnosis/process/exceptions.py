"""What to try after an exception: by its table, ``exceptions.yaml``, and what no table can tell.

What the explanations below advise stands in ``hints.yaml``, as for all others.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template

from pydantic import Field

from grader.diagnosis.explanation import Explanation, Symptom, add, explanation, remedy
from grader.diagnosis.process.failure import Failure, Frame
from grader.diagnosis.process.raised import student_place
from grader.findings.words import Words, code, listing
from grader.recording.model import Recording
from grader.recording.submission import CPP, PYTHON, PackageRecord, SubmissionRecord
from grader.spec.source import Model, read_source

_UNDEFINED = re.compile(r"name '(\w+)' is not defined")
_NO_ATTRIBUTE = re.compile(r"'(\w+)' object has no attribute '(\w+)'")
_NO_MODULE = re.compile(r"No module named '(\w+)'$")
_NO_NAME = re.compile(r"cannot import name '(\w+)' from '([\w.]+)'")
_MOST_FIELDS = 20
_NO_FILE = re.compile(r"No such file or directory: '(.+)'$")


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
    hint: str | Words

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
        return Template(str(self.hint)).safe_substitute(names)


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


def import_of(name: str) -> str | None:
    """The line that imports a well-known name of ROS 2 or Python, if it is one."""
    known = (line for line, names in TABLE.imports.items() if name in names.split())
    beginning = next(known, None)
    return f"{beginning} {name}" if beginning else None


@explanation(Raised, only=PYTHON)
def not_imported(symptom: Raised) -> str | None:
    """A well-known name of ROS 2 or Python, such as Twist or math, is not imported."""
    found = _UNDEFINED.match(symptom.failure.message)
    line = import_of(found[1]) if found else None
    return line and (
        f"If you mean the one of ROS or Python, import it at the top of the file: {code(line)}. "
        "Otherwise it is misspelt, or used before it is defined."
    )


@explanation(Raised, only=PYTHON)
def imported_from_elsewhere(symptom: Raised) -> str | None:
    """A well-known name is imported from the wrong package, such as Twist from std_msgs."""
    found = _NO_NAME.match(symptom.failure.message)
    line = import_of(found[1]) if found else None
    package = line.split()[1].partition(".")[0] if line else ""
    return line and f"Write {code(line)}, and {code(f'<depend>{package}</depend>')} in package.xml."


@explanation(Raised, only=PYTHON)
def no_such_field(symptom: Raised) -> str | None:
    """A field is read or set that the message does not have."""
    found = _NO_ATTRIBUTE.match(symptom.failure.message)
    ends = symptom.recording.declared("exiting")
    fields = next((str(one.data["fields"]) for one in ends if "fields" in one.data), "")
    named = [code(one) for one in fields.split() if one.isidentifier()]
    # If it does have the field, this is another class of the same name.
    if found is None or not named or code(found[2]) in named:
        return None
    return remedy("no_such_field", type=code(found[1]), fields=listing(named[:_MOST_FIELDS]))


@explanation(Raised, only=PYTHON)
def own_module(symptom: Raised) -> str | None:
    """A module of the package is imported without the name of the package."""
    found = _NO_MODULE.search(symptom.failure.message)
    if found is None:
        return None
    name, submission = found[1], symptom.recording.submission
    installed = [path for package in submission.packages for path, _ in package.files]
    place = next((path for path in installed if path.endswith(f"/{name}.py")), None)
    if place is not None:
        package = place.rpartition("/")[0].replace("/", ".")
        written = code(f"from {package} import {name}")
        return remedy(
            "own_module",
            file=code(f"{name}.py"),
            written=written,
            other=code(f"from {package}.{name} import ..."),
        )
    file, owner = _own_file(submission, f"{name}.py")
    if owner is None:
        return None
    return remedy(
        "module_not_installed",
        file=code(file),
        package=code(owner.name),
        line=code(f"from {owner.name} import {name}"),
    )


@explanation(Raised, only=PYTHON)
def file_not_installed(symptom: Raised) -> str | None:
    """A file of the package is opened by a relative path, or by one of another machine."""
    found = _NO_FILE.search(symptom.failure.message)
    name = found[1].rpartition("/")[2] if found else ""
    file, owner = _own_file(symptom.recording.submission, name)
    if not name or owner is None:
        return None
    path = file.removeprefix(owner.file(""))
    share = f"share/{owner.name}/{path.rpartition('/')[0]}".rstrip("/")
    return remedy(
        "file_not_installed",
        entry=code(f"({share!r}, [{path!r}])"),
        path=code(f"os.path.join(get_package_share_directory({owner.name!r}), {path!r})"),
    )


def _own_file(submission: SubmissionRecord, name: str) -> tuple[str, PackageRecord | None]:
    """A file of the submission by its name, with the package that it lies in; None without one."""
    file = next((path for path in submission.files if f"/{path}".endswith(f"/{name}")), "")
    owners = [one for one in submission.packages if file and file.startswith(one.file(""))]
    return file, max(owners, key=lambda one: len(one.path), default=None)


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
        return remedy("named_line")
    if symptom.failure.compiled:
        return remedy("debugger")
    if not symptom.failure.frames:
        return None
    return remedy("read_message")
