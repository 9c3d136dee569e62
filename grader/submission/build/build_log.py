"""colcon's output made readable: no colours, paths as the student knows them."""

from __future__ import annotations

import re
from collections.abc import Mapping

MAX_BYTES = 64 * 1024
ROS = "/opt/ros/jazzy"
"""Where ROS is to a student, wherever it is here."""

_ANSI = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b[@-_]")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")
_NOISE = re.compile(
    r"^WARNING:colcon\.colcon_ros\.prefix_path\.ament:The path .* doesn't contain any .*(?:\n|\Z)",
    re.MULTILINE,
)
# setup.py is run in the package's folder and names colcon's folders relative to it.
# Of a long run of them only the first one is tried.
_RELATIVE_SCRATCH = re.compile(r"(?<!\.\./)(?:\.\./)+scratch/(?=build/)")
# Default arguments of templates, and types that the compiler names twice.
_FOLDED = (
    (re.compile(r"\b(\w+)_<std::allocator<void> ?>"), r"\1"),
    (re.compile(r"\bstd::(?:__cxx11::)?basic_string<char>"), "std::string"),
    (re.compile(r"\b(using \w+ = )(?:class |struct )?"), ""),
    (re.compile(r" \{aka (?:‘[^’\n]*’|'[^'\n]*')\}"), ""),
)
# What CMake says of files that are not the student's, and who called whom there.
_OTHERS_WARNING = re.compile(
    r"^CMake (?:\w+ )?Warning(?: \(dev\))? at /.*\n"
    r"(?:[ \t].*\n|\n|Call Stack .*\n|This warning .*\n)*",
    re.MULTILINE,
)
_OTHERS_CALL = re.compile(r"^  /\S.*:\d+ \(\w+\)\n|^Call Stack .*\n(?=\n|\Z)", re.MULTILINE)
_ENDED = re.compile(r"(?<!^)(?=(?:Finished|Failed  |Aborted ) <<< \S+ \[)", re.MULTILINE)
_NOT_FOUND = (
    re.compile(r"Could not find a package configuration file provided by\s+\"([\w-]+)\""),
    re.compile(r"the\s+passed\s+package\s+name\s+'([\w-]+)'\s+was\s+not\s+found\s+before"),
    re.compile(r"Could NOT find ([\w-]+) \(missing:"),
    re.compile(r"required packages were not found:\s+- ([\w.+-]+)"),
)
"""What CMake says of a package that is not there."""
# CMake's FindPython3 names the part of it that it did not find, a compiler the header.
_NO_HEADERS = ("Development.Module", "fatal error: Python.h: No such file")
PYTHON_HEADERS = "python3-dev"
_MISSING_MODULE = re.compile(r"^ModuleNotFoundError: No module named '(\w+)'$", re.MULTILINE)


def clean(output: str, paths: Mapping[str, str]) -> str:
    """Strip colours and control characters, map scratch paths back, shorten types of C++.

    Args:
        paths: Folder as it was in the build -> what the student calls it; ``""`` for the
            submission itself. Longer folders win.
    """
    text = _CONTROL.sub("", _ANSI.sub("", output.replace("\r\n", "\n")))
    text = _RELATIVE_SCRATCH.sub("", text)
    for folder in sorted(paths, key=len, reverse=True):
        name = paths[folder]
        text = text.replace(f"{folder}/", f"{name}/" if name else "")
        text = text.replace(folder, name or ".")
    for written, short in _FOLDED:
        text = written.sub(short, text)
    return _NOISE.sub("", text)


def folded(log: str) -> str:
    """A cleaned log without warnings and callers in CMake files of others, above one's error."""
    for _ in range(2):
        log = _OTHERS_CALL.sub("", _OTHERS_WARNING.sub("", log))
    return log


def own_lines(output: str) -> str:
    """Begin a line wherever colcon says how a package ended.

    What a build file prints before that may have no line end.
    """
    return _ENDED.sub("\n", output)


def ending(log: str) -> str:
    """The end of a log, at most 64 KiB of it, beginning with a whole line."""
    data = log.encode("utf-8", "replace")
    if len(data) <= MAX_BYTES:
        return data.decode("utf-8")
    cut = data[-MAX_BYTES:]
    return cut[cut.find(b"\n") + 1 :].decode("utf-8", "ignore")


def not_found(log: str) -> set[str]:
    """Packages and libraries that CMake did not find."""
    packages = {name for pattern in _NOT_FOUND for name in pattern.findall(log)}
    return packages | ({PYTHON_HEADERS} if any(text in log for text in _NO_HEADERS) else set())


def modules_not_found(log: str) -> set[str]:
    """Python modules that a build file or a generator of code could not import."""
    return set(_MISSING_MODULE.findall(log))
