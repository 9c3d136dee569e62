"""What to try after an exception: what no table can tell, then the tables of known exceptions.

What the explanations below advise stands in ``hints.yaml``, as for all others.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from grader.diagnosis.explanation import Explanation, Symptom, add, explanation, remedy
from grader.diagnosis.process.exception_table import CPP_ROWS, TABLE, KnownException, import_of
from grader.diagnosis.process.failure import Failure
from grader.diagnosis.process.raised import student_place
from grader.findings.words import code, listing
from grader.recording.model import Recording
from grader.recording.submission import PYTHON, PackageRecord, SubmissionRecord

_UNDEFINED = re.compile(r"name '(\w+)' is not defined")
_NO_ATTRIBUTE = re.compile(r"'(\w+)' object has no attribute '(\w+)'")
_NO_MODULE = re.compile(r"No module named '(\w+)'$")
_NO_NAME = re.compile(r"cannot import name '(\w+)' from '([\w.]+)'")
_NO_FILE = re.compile(r"No such file or directory: '(.+)'$")
# The student's process declares the fields: the hint stays readable whatever their number.
_MOST_FIELDS = 20


@dataclass(frozen=True)
class Raised(Symptom[str]):
    """A program raised an exception.

    The explanations answer with a hint.
    """

    failure: Failure
    recording: Recording


@explanation(Raised, only=PYTHON)
def not_imported(symptom: Raised) -> str | None:
    """A well-known name of ROS 2 or Python, such as Twist or math, is not imported."""
    line = _import_of_name(_UNDEFINED, symptom.failure)
    if line is None:
        return None
    return (
        f"If you mean the one of ROS or Python, import it at the top of the file: {code(line)}. "
        "Otherwise it is misspelt, or used before it is defined."
    )


@explanation(Raised, only=PYTHON)
def imported_from_elsewhere(symptom: Raised) -> str | None:
    """A well-known name is imported from the wrong package, such as Twist from std_msgs."""
    line = _import_of_name(_NO_NAME, symptom.failure)
    if line is None:
        return None
    # Of `from geometry_msgs.msg import Twist` the package is `geometry_msgs`.
    package = line.split()[1].partition(".")[0]
    return f"Write {code(line)}, and {code(f'<depend>{package}</depend>')} in package.xml."


def _import_of_name(message: re.Pattern[str], failure: Failure) -> str | None:
    """The line that imports the name in a message, if it is a well-known one."""
    match = message.match(failure.message)
    return import_of(match[1]) if match else None


@explanation(Raised, only=PYTHON)
def no_such_field(symptom: Raised) -> str | None:
    """A field is read or set that the message does not have."""
    match = _NO_ATTRIBUTE.match(symptom.failure.message)
    if match is None:
        return None
    type_name, attribute = match.groups()
    fields = _fields_at_exit(symptom.recording)
    # If it does have the field, this is another class of the same name.
    if not fields or attribute in fields:
        return None
    shown = listing([code(field) for field in fields[:_MOST_FIELDS]])
    return remedy("no_such_field", type=code(type_name), fields=shown)


def _fields_at_exit(recording: Recording) -> list[str]:
    """The fields of the message that an attribute was missing of, as the process declared them."""
    for declaration in recording.declared("exiting"):
        if "fields" in declaration.data:
            return [name for name in str(declaration.data["fields"]).split() if name.isidentifier()]
    return []


@explanation(Raised, only=PYTHON)
def own_module(symptom: Raised) -> str | None:
    """A module of the package is imported without the name of the package."""
    match = _NO_MODULE.search(symptom.failure.message)
    if match is None:
        return None
    name, submission = match[1], symptom.recording.submission
    installed = [path for package in submission.packages for path, _ in package.files]
    for path in installed:
        if path.endswith(f"/{name}.py"):
            package = path.rpartition("/")[0].replace("/", ".")
            return remedy(
                "own_module",
                file=code(f"{name}.py"),
                written=code(f"from {package} import {name}"),
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
    match = _NO_FILE.search(symptom.failure.message)
    name = match[1].rpartition("/")[2] if match else ""
    if not name:
        return None
    file, owner = _own_file(symptom.recording.submission, name)
    if owner is None:
        return None
    path = file.removeprefix(owner.file(""))
    share = f"share/{owner.name}/{path.rpartition('/')[0]}".rstrip("/")
    return remedy(
        "file_not_installed",
        entry=code(f"({share!r}, [{path!r}])"),
        path=code(f"os.path.join(get_package_share_directory({owner.name!r}), {path!r})"),
    )


def _own_file(submission: SubmissionRecord, name: str) -> tuple[str, PackageRecord | None]:
    """The path in the submission of a file of that name, and the package that it lies in."""
    path = next((path for path in submission.files if f"/{path}".endswith(f"/{name}")), None)
    if path is None:
        return "", None
    owners = [package for package in submission.packages if path.startswith(package.file(""))]
    # A package may lie in the folder of another: the innermost has the file.
    return path, max(owners, key=lambda package: len(package.path), default=None)


def _entry(row: KnownException) -> Explanation:
    """A row of a table as an entry of the catalogue."""

    def hint(symptom: Raised) -> str | None:
        return row.hint_for(symptom.failure)

    entry = Explanation(Raised, row.mistake, hint, __name__, sentence=row.mistake)
    return replace(entry, example=row.example, only=row.only)


# What ends programs in C++ is asked first: exceptions that both languages have stand in the other.
for _row in (*CPP_ROWS, *TABLE.exceptions):
    add(_entry(_row))


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
