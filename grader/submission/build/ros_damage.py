"""What a build finds damaged in the ROS installation: the machine's fault, and not the student's.

A build file may print the same words; so what the log says is looked up on the disk.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from grader.machine.ros import RosInstallation
from grader.machine.tree import listing
from grader.submission.build.build_log import ROS
from grader.submission.read.rosdistro import PACKAGES

_FILE = rf"(?P<file>{ROS}/[^\s:'\"]+)"
# .../include/NAME/..., .../share/NAME/..., .../lib/NAME/..., .../lib/libNAME__typesupport.so
_OWNER = re.compile(
    r"/(?:include|share|site-packages)/([\w+-]+)|/lib/(?:lib)?([\w+-]+?)(?:__|\.|/)"
)
_BLOCKS = ("(?:if|foreach|while|function|macro)", "end(?:if|foreach|while|function|macro)")
_COMPILED = "/__pycache__/"


class _Complaint(NamedTuple):
    """What a log says of a part of ROS, as far as it says it.

    Attributes:
        file: The file of ROS that is missing or broken, or that asks for what is missing.
        path: What a target of CMake names and is not there, wherever it would be.
        header: What ``#include`` does not find: ``rcl/rcl.h``.
        module: What ``import`` does not find.
    """

    package: str = ""
    file: str = ""
    path: str = ""
    header: str = ""
    module: str = ""

    @property
    def name(self) -> str:
        """The package of ROS that it is about, or a module; nothing for the student's own."""
        if self.module:
            return self.module
        owner = _OWNER.search(self.file)
        name = self.package or self.header.partition("/")[0]
        if not name and owner is not None:
            name = owner[1] or owner[2]
        return name if name in PACKAGES else ""


_Test = Callable[[_Complaint, RosInstallation], bool]


def damaged(log: str, ros: RosInstallation, own: Collection[str]) -> set[str]:
    """Packages of ROS that are not whole, by a cleaned log, and modules that ROS itself lacks.

    Args:
        own: Names of the submission's packages.
    """
    names = {complaint.name for complaint, is_true in _complaints(log) if is_true(complaint, ros)}
    return names - set(own) - {""}


def damage_in(log: str) -> set[str]:
    """The same, as far as the log alone can tell."""
    return {complaint.name for complaint, _ in _complaints(log)}


def _complaints(log: str) -> Iterator[tuple[_Complaint, _Test]]:
    """Everything that a log says of ROS, each with what tells whether it is true."""
    for pattern, is_true in _COMPLAINTS:
        for match in re.finditer(pattern, log):
            yield _Complaint(**match.groupdict("")), is_true


def _target_lacks_a_file(complaint: _Complaint, ros: RosInstallation) -> bool:
    prefixes = _prefixes(ros)
    if any(Path(complaint.path.replace(ROS, str(prefix))).exists() for prefix in prefixes):
        return False
    written = (complaint.path, complaint.path.replace(ROS, "${_IMPORT_PREFIX}"))
    texts = [
        file.read_text(errors="replace")
        for folder in _cmake_folders(complaint.package, ros)
        for file in folder.glob("*.cmake")
    ]
    return any(path in text for path in written for text in texts)


def _has_no_cmake_config(complaint: _Complaint, ros: RosInstallation) -> bool:
    folders = _cmake_folders(complaint.package, ros)
    return not any([*folder.glob("*[Cc]onfig.cmake")] for folder in folders)


def _is_missing_or_broken(complaint: _Complaint, ros: RosInstallation) -> bool:
    prefixes = _prefixes(ros)
    if complaint.file.endswith(".so"):
        # A library that no package of ROS speaks of is wanted by the submission alone.
        name = re.escape(Path(complaint.file).name)
        exports = (file for prefix in prefixes for file in prefix.glob("share/*/cmake/*.cmake"))
        if not _has_line(exports, rf".*/{name}\b"):
            return False
    return all(_is_broken(_here(complaint.file, prefix)) for prefix in prefixes)


def _is_broken_where_read(complaint: _Complaint, ros: RosInstallation) -> bool:
    files = _files(complaint, ros)
    return bool(files) and all(map(_is_broken, files))


def _lacks_a_header(complaint: _Complaint, ros: RosInstallation) -> bool:
    package = complaint.header.partition("/")[0]
    for prefix in _prefixes(ros):
        for folder in (prefix / "include", prefix / "include" / package):
            if (folder / complaint.header).is_file():
                # It was only not looked for: the submission links too little.
                return False
    header = re.escape(complaint.header)
    return _has_line(_files(complaint, ros), rf'#\s*include\s*[<"]{header}[>"]')


def _lacks_a_module(complaint: _Complaint, ros: RosInstallation) -> bool:
    module = complaint.module
    if any(any(site.glob(f"{module}*")) for site in ros.site_packages):
        return False
    if importlib.util.find_spec(module) is not None:
        return False
    return _has_line(_files(complaint, ros), rf"(?:import|from)\b.*\b{module}\b")


_COMPLAINTS: tuple[tuple[str, _Test], ...] = (
    (
        r"mported target \"(?P<package>[\w.+-]+)::[^\"]+\"\s+(?:includes non-existent path|"
        r"references the file)\s+\"(?P<path>/[^\"]+)\"",
        _target_lacks_a_file,
    ),
    (rf"No rule to make target '{_FILE}', needed by", _is_missing_or_broken),
    (rf"'{_FILE}', needed by '[^']+', missing and no known rule", _is_missing_or_broken),
    (rf"{_FILE}: file (?:not recognized|truncated)", _is_broken_where_read),
    (
        rf"(?:CMake Error at|Error in cmake code at)\s+{_FILE}:\d+(?: \(\w+\))?:\s+"
        r"(?:Parse error|A logical block|Flow control|include could not)",
        _is_broken_where_read,
    ),
    (
        rf"CMake Error at {ROS}/\S+ \(find_package\):\s+By not providing \"Find(?P<package>[\w-]+)",
        _has_no_cmake_config,
    ),
    (
        rf"CMake Error at {ROS}/\S+ \(include\):\s+include could not find [\w ]+:\s+{_FILE}",
        _is_missing_or_broken,
    ),
    (
        rf"{_FILE}:\d+:\d+: fatal error: (?P<header>[\w./+-]+): No such file",
        _lacks_a_header,
    ),
    (
        rf"File \"{_FILE}\", line \d+, in .*\n(?:.*\n)?"
        r"ModuleNotFoundError: No module named '(?P<module>\w+)",
        _lacks_a_module,
    ),
)
"""What tools say of ROS -> whether that is so."""


def _prefixes(ros: RosInstallation) -> list[Path]:
    return [*ros.underlays, *ros.prefixes]


def _cmake_folders(package: str, ros: RosInstallation) -> list[Path]:
    return [prefix / "share" / package / "cmake" for prefix in _prefixes(ros)]


def _files(complaint: _Complaint, ros: RosInstallation) -> list[Path]:
    """The file of a complaint, wherever it is there."""
    paths = (_here(complaint.file, prefix) for prefix in _prefixes(ros))
    return [path for path in paths if path.is_file()]


def _here(file: str, prefix: Path) -> Path:
    """Where a file of ROS is here, by its name in a log; never outside of the installation."""
    return prefix / os.path.normpath(f"/{file.removeprefix(ROS)}").lstrip("/")


def _has_line(files: Iterable[Path], beginning: str) -> bool:
    """Whether one of them has a line that begins so."""
    pattern = re.compile(rf"^\s*{beginning}", re.MULTILINE)
    return any(pattern.search(file.read_text(errors="replace")) for file in files)


def _is_broken(file: Path) -> bool:
    """Whether a file is missing or was cut off: a library, or a file of CMake."""
    data = file.read_bytes() if file.is_file() else b""
    if file.suffix == ".cmake" and data:
        text = data.decode(errors="replace")
        begun, ended = (len(re.findall(rf"(?im)^\s*{word}\s*\(", text)) for word in _BLOCKS)
        return text.count("(") != text.count(")") or begun != ended
    if data[:4] != b"\x7fELF":
        return True
    # elf(5), of 64 bits: the section headers are the last that is in a file.
    begin, size, count = (
        int.from_bytes(data[at : at + length], "little")
        for at, length in ((40, 8), (58, 2), (60, 2))
    )
    return len(data) < begin + size * count


def state_of(ros: RosInstallation) -> str:
    """What changes with any file of an installation that others look after."""
    if ros.source != "sourced":
        return ros.source
    # Python compiles whenever something is imported.
    files = (name for prefix in ros.prefixes for name in listing(prefix) if _COMPILED not in name)
    return hashlib.sha256(os.fsencode("\n".join(sorted(files)))).hexdigest()
