"""Names that right code finds in ROS 2 Jazzy, and that the Python or numpy here does not have."""

from __future__ import annotations

import re
from pathlib import Path

from grader.diagnosis.process.failure import Failure
from grader.recording.model import Recording
from grader.spec.source import Model, read_source

_JAZZY_PYTHON = (3, 12)
_OLD_NUMPY = "numpy 1.26 (for Python 3.12 and older)"
# How Python says that something has no such name.
_LACKS = (
    re.compile(r"cannot import name '(?P<name>\w+)' from '(?P<home>[\w.]+)'"),
    re.compile(r"(?:module )?'(?P<home>[\w.]+)' (?:object )?has no attribute '(?P<name>\w+)'"),
    re.compile(r"No module named '(?P<name>\w+)'(?P<home>)"),
)
_REMOVED = re.compile(r"`np\.(\w+)` was removed in the NumPy 2")
_ERRORS = ("AttributeError", "ImportError", "ModuleNotFoundError")


class Table(Model):
    """The whole of ``newer_names.yaml``: a module or a class -> names, with blanks between."""

    added: dict[str, str]
    dropped: dict[str, str]


TABLE = read_source(Path(__file__).with_suffix(".yaml")).read(Table)


def newer_name(failure: Failure, recording: Recording) -> tuple[str, str] | None:
    """The name that a failure is about, such as ``enum.StrEnum``, and what has it.

    Returns:
        None where it is not there in ROS 2 Jazzy either.
    """
    if failure.type not in _ERRORS:
        return None
    removed = _REMOVED.match(failure.message)
    lacks = next(filter(None, (pattern.match(failure.message) for pattern in _LACKS)), None)
    if removed is not None:
        return f"numpy.{removed[1]}", _OLD_NUMPY
    if lacks is None:
        return None
    home, name = lacks["home"], lacks["name"]
    if name in TABLE.dropped.get(home, "").split():
        return f"numpy.{name}", _OLD_NUMPY
    version = recording.environment.get("python", "")
    if not version or tuple(map(int, version.split(".")[:2])) >= _JAZZY_PYTHON:
        return None
    if name not in TABLE.added.get(home, "").split():
        return None
    home = "pathlib.Path" if home.endswith("Path") else home
    return f"{home}.{name}".removeprefix("."), "Python 3.12"
