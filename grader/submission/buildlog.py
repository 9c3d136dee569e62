"""colcon's output made readable: no colours, paths as the student knows them."""

from __future__ import annotations

import re
from collections.abc import Mapping

MAX_BYTES = 64 * 1024

_ANSI = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b[@-_]")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")
_NOISE = re.compile(
    r"^WARNING:colcon\.colcon_ros\.prefix_path\.ament:The path .* doesn't contain any .*(?:\n|\Z)",
    re.MULTILINE,
)
# setup.py is run in the package's folder and names colcon's folders relative to it.
# Of a long run of them only the first one is tried.
_RELATIVE_SCRATCH = re.compile(r"(?<!\.\./)(?:\.\./)+scratch/(?=build/)")
_ENDED = re.compile(r"(?<!^)(?=(?:Finished|Failed  |Aborted ) <<< \S+ \[)", re.MULTILINE)
_MISSING_CMAKE_PACKAGE = re.compile(
    r"Could not find a package configuration file provided by\s+\"([\w-]+)\""
)


def clean(output: str, paths: Mapping[str, str]) -> str:
    """Strip colours and control characters, and map scratch paths back.

    Args:
        output: What colcon wrote.
        paths: Folder as it was in the build -> what the student calls it; ``""`` for the
            submission itself. Longer folders win.
    """
    text = _CONTROL.sub("", _ANSI.sub("", output.replace("\r\n", "\n")))
    text = _RELATIVE_SCRATCH.sub("", text)
    for folder in sorted(paths, key=len, reverse=True):
        name = paths[folder]
        text = text.replace(f"{folder}/", f"{name}/" if name else "")
        text = text.replace(folder, name or ".")
    return _NOISE.sub("", text)


def own_lines(output: str) -> str:
    """Begin a line wherever colcon says how a package ended.

    It says so behind the last words of a build file, which may have no line end.
    """
    return _ENDED.sub("\n", output)


def ending(log: str) -> str:
    """The end of a log, at most 64 KiB of it, beginning with a whole line."""
    data = log.encode("utf-8", "replace")
    if len(data) <= MAX_BYTES:
        return data.decode("utf-8")
    cut = data[-MAX_BYTES:]
    return cut[cut.find(b"\n") + 1 :].decode("utf-8", "ignore")


def missing_cmake_packages(log: str) -> set[str]:
    """Packages that ``find_package`` did not find."""
    return set(_MISSING_CMAKE_PACKAGE.findall(log))
