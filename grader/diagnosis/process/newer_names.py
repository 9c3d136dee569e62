"""Names that right code finds in ROS 2 Jazzy, and that the Python or numpy here does not have."""

from __future__ import annotations

import re
from dataclasses import dataclass

from grader.diagnosis.process.raised import Failure
from grader.recording.model import Recording

_JAZZY_PYTHON = (3, 12)
# What Python 3.11 and 3.12 added to modules that a node may use: "What's New In Python 3.11" and
# "3.12", compared with what the modules of 3.10, 3.11 and 3.12 hold.
_ADDED = {
    "asyncio": "Barrier Runner TaskGroup timeout timeout_at eager_task_factory",
    "calendar": "Day Month",
    "collections.abc": "Buffer",
    "contextlib": "chdir",
    "datetime": "UTC",
    "enum": "EnumCheck EnumType FlagBoundary ReprEnum StrEnum global_enum member nonmember verify",
    "itertools": "batched",
    "logging": "getHandlerByName getHandlerNames getLevelNamesMapping",
    "math": "cbrt exp2 sumprod",
    "operator": "call",
    "random": "binomialvariate",
    "types": "get_original_bases",
    "typing": "LiteralString Never NotRequired Required Self TypeAliasType TypeVarTuple Unpack "
    "assert_never assert_type dataclass_transform override reveal_type",
}
_ADDED_MODULES = ("tomllib",)
_ADDED_METHODS = {"PosixPath": "walk", "Path": "walk"}
# Those of 1.26 that numpy 2 lacks without saying that it had them; of the others it says so.
_DROPPED_BY_NUMPY = "NAN RankWarning cumproduct msort product"

_IMPORTED = re.compile(r"cannot import name '(\w+)' from '([\w.]+)'")
_LOOKED_UP = re.compile(r"module '([\w.]+)' has no attribute '(\w+)'")
_CALLED = re.compile(r"'(\w+)' object has no attribute '(\w+)'")
_NO_MODULE = re.compile(r"No module named '(\w+)'")
_SAID_BY_NUMPY = re.compile(r"`np\.(\w+)` was removed in the NumPy 2")


@dataclass(frozen=True)
class NewerName:
    """A name that is right in Jazzy.

    Attributes:
        name: As in ``enum.StrEnum``.
        home: What has it, such as ``Python 3.12``, and what that needs in its turn.
    """

    name: str
    home: str


def newer_name(failure: Failure, recording: Recording) -> NewerName | None:
    """The name that a failure is about, if only the machine that grades lacks it.

    Args:
        recording: Of the run; it tells the version of Python.
    """
    dropped = _dropped_by_numpy(failure)
    if dropped is not None:
        return NewerName(f"numpy.{dropped}", "numpy 1.26 (for Python 3.12 and older)")
    version = recording.environment.get("python", "")
    if not version or tuple(map(int, version.split(".")[:2])) >= _JAZZY_PYTHON:
        return None
    added = _added_to_python(failure)
    return NewerName(added, "Python 3.12") if added else None


def _dropped_by_numpy(failure: Failure) -> str | None:
    if failure.type not in ("AttributeError", "ImportError"):
        return None
    said = _SAID_BY_NUMPY.match(failure.message)
    if said is not None:
        return said[1]
    module, name = _module_and_name(failure)
    return name if module == "numpy" and name in _DROPPED_BY_NUMPY.split() else None


def _added_to_python(failure: Failure) -> str | None:
    if failure.type == "ModuleNotFoundError":
        found = _NO_MODULE.match(failure.message)
        return found[1] if found and found[1] in _ADDED_MODULES else None
    called = _CALLED.match(failure.message)
    if called is not None and _ADDED_METHODS.get(called[1]) == called[2]:
        return f"pathlib.Path.{called[2]}"
    module, name = _module_and_name(failure)
    return f"{module}.{name}" if name and name in _ADDED.get(module, "").split() else None


def _module_and_name(failure: Failure) -> tuple[str, str]:
    if failure.type == "ImportError":
        found = _IMPORTED.match(failure.message)
        return (found[2], found[1]) if found else ("", "")
    found = _LOOKED_UP.match(failure.message) if failure.type == "AttributeError" else None
    return (found[1], found[2]) if found else ("", "")
