"""What a build finds damaged in the ROS installation: the machine's fault, and not the student's.

A build file may print the same words; so what the log says is looked up on the disk.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
from collections.abc import Collection, Iterable
from pathlib import Path

from grader.machine.ros import RosInstallation
from grader.machine.tree import listing
from grader.submission.build.build_log import ROS
from grader.submission.read.rosdistro import PACKAGES

_FILE = rf"(?P<file>{ROS}/[^\s:'\"]+)"
# One that was read, so that it is there.
_READ = _FILE.replace("file", "read")
_DAMAGE = tuple(
    re.compile(pattern)
    for pattern in (
        r"mported target \"(?P<package>[\w.+-]+)::[^\"]+\"\s+(?:includes non-existent path|"
        r"references the file)\s+\"(?P<named>/[^\"]+)\"",
        rf"No rule to make target '{_FILE}', needed by",
        rf"'{_FILE}', needed by '[^']+', missing and no known rule",
        rf"{_READ}: file (?:not recognized|truncated)",
        rf"(?:CMake Error at|Error in cmake code at)\s+{_READ}:\d+(?: \(\w+\))?:\s+"
        r"(?:Parse error|A logical block|Flow control|include could not)",
        rf"CMake Error at {ROS}/\S+ \(find_package\):\s+By not providing \"Find(?P<package>[\w-]+)",
        rf"CMake Error at {ROS}/\S+ \(include\):\s+include could not find [\w ]+:\s+{_FILE}",
        rf"{_READ}:\d+:\d+: fatal error: (?P<header>[\w./+-]+): No such file",
        rf"File \"{_READ}\", line \d+, in .*\n(?:.*\n)?"
        r"ModuleNotFoundError: No module named '(?P<module>\w+)",
    )
)
# .../include/NAME/..., .../share/NAME/..., .../lib/NAME/..., .../lib/libNAME__typesupport.so
_OWNER = re.compile(
    r"/(?:include|share|site-packages)/([\w+-]+)|/lib/(?:lib)?([\w+-]+?)(?:__|\.|/)"
)
_BLOCKS = ("(?:if|foreach|while|function|macro)", "end(?:if|foreach|while|function|macro)")
_COMPILED = "/__pycache__/"


def damaged(log: str, ros: RosInstallation, own: Collection[str]) -> set[str]:
    """Packages of ROS that are not whole, by a cleaned log, and modules that ROS itself lacks.

    Args:
        own: Names of the submission's packages.
    """
    names = {_name(found) for found in _found(log) if _is_damaged(found, ros)}
    return names - set(own) - {""}


def damage_in(log: str) -> set[str]:
    """The same, as far as the log alone can tell."""
    return {_name(found) for found in _found(log)}


def _found(log: str) -> list[dict[str, str | None]]:
    return [match.groupdict() for pattern in _DAMAGE for match in pattern.finditer(log)]


def _name(found: dict[str, str | None]) -> str:
    """The package of ROS that the log speaks of, or a module; nothing for the student's own."""
    if found.get("module"):
        return found["module"] or ""
    owner = _OWNER.search(found.get("file") or found.get("read") or "")
    header = (found.get("header") or "").partition("/")[0]
    name = found.get("package") or header or (owner and (owner[1] or owner[2])) or ""
    return name if name in PACKAGES else ""


def _is_damaged(found: dict[str, str | None], ros: RosInstallation) -> bool:
    prefixes = [*ros.underlays, *ros.prefixes]
    read = [path for at in prefixes if (path := _below(at, found.get("read"))).is_file()]
    if header := found.get("header"):
        # One that is there was only not looked for: the submission links too little.
        package = header.partition("/")[0]
        places = (place for at in prefixes for place in (at / "include", at / "include" / package))
        there = any((place / header).is_file() for place in places)
        return not there and _has(read, rf'#\s*include\s*[<"]{re.escape(header)}[>"]')
    if module := found.get("module"):
        there = any(any(site.glob(f"{module}*")) for site in ros.site_packages)
        there = there or importlib.util.find_spec(module) is not None
        return not there and _has(read, rf"(?:import|from)\b.*\b{module}\b")
    if found.get("read"):
        return bool(read) and all(map(_is_broken, read))
    if file := found.get("file"):
        # A library that no package of ROS speaks of is wanted by the submission alone.
        exports = (one for at in prefixes for one in at.glob("share/*/cmake/*.cmake"))
        wanted = not file.endswith(".so") or _has(exports, rf".*/{re.escape(Path(file).name)}\b")
        return wanted and all(_is_broken(_below(at, file)) for at in prefixes)
    folders = [at / "share" / (found["package"] or "") / "cmake" for at in prefixes]
    if not (named := found.get("named")):
        return not any([*at.glob("*[Cc]onfig.cmake")] for at in folders)
    if any(Path(named.replace(ROS, str(at))).exists() for at in prefixes):
        return False
    written = (named, named.replace(ROS, "${_IMPORT_PREFIX}"))
    texts = [path.read_text(errors="replace") for at in folders for path in at.glob("*.cmake")]
    return any(name in text for name in written for text in texts)


def _below(prefix: Path, named: str | None) -> Path:
    """Where a file of ROS is here, by its name in a log; never outside of the installation."""
    return prefix / os.path.normpath(f"/{(named or '').removeprefix(ROS)}").lstrip("/")


def _has(files: Iterable[Path], line: str) -> bool:
    """Whether one of them has a line that begins so."""
    begins = re.compile(rf"^\s*{line}", re.MULTILINE)
    return any(begins.search(file.read_text(errors="replace")) for file in files)


def _is_broken(file: Path) -> bool:
    """Whether a file is missing or was cut off: a library, or a file of CMake."""
    data = file.read_bytes() if file.is_file() else b""
    if file.suffix == ".cmake" and data:
        text = data.decode(errors="replace")
        begun, ended = (len(re.findall(rf"(?im)^\s*{word}\s*\(", text)) for word in _BLOCKS)
        return text.count("(") != text.count(")") or begun != ended
    # Where the section headers begin, their size and number; elf(5), of 64 bits.
    begin, each, count = (
        int.from_bytes(data[at : at + size], "little") for at, size in ((40, 8), (58, 2), (60, 2))
    )
    return data[:4] != b"\x7fELF" or len(data) < begin + each * count


def state_of(ros: RosInstallation) -> str:
    """What changes with any file of an installation that others look after."""
    if ros.source != "sourced":
        return ros.source
    # Python compiles whenever something is imported.
    files = (name for prefix in ros.prefixes for name in listing(prefix) if _COMPILED not in name)
    return hashlib.sha256(os.fsencode("\n".join(sorted(files)))).hexdigest()
