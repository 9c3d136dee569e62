"""The tracer of compiled programs: a small library that is built once and preloaded."""

from __future__ import annotations

import functools
import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from grader.errors import GraderFault
from grader.machine.ros import RosInstallation
from grader.run.environment import TRACER

IN_SANDBOX = Path("/opt/rosgrade_rcl.so")
_SOURCE = TRACER / "rosgrade_rcl.c"
_OPTIONS = (
    *("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden"),
    # A callback that throws leaves through functions of the library.
    "-fexceptions",
)
_LIBRARIES = ("-ldl", "-pthread")
_LIMIT_S = 120.0
_ELF = b"\x7fELF"


def has_compiled_programs(install: Path) -> bool:
    """Whether an install space (merged layout) has executables that are no scripts."""
    # One in bin/ is wrong there, and launched all the same.
    files = (*install.glob("lib/*/*"), *install.glob("bin/*"))
    return any(
        file.is_file() and os.access(file, os.X_OK) and _begin(file) == _ELF for file in files
    )


def _begin(file: Path) -> bytes:
    with file.open("rb") as opened:
        return opened.read(len(_ELF))


def compiled_tracer(ros: RosInstallation, cache: Path) -> Path | None:
    """The library for this ROS installation, or None where there is no C compiler to build it."""
    return build_library(_SOURCE, ros, cache)


def build_library(source: Path, ros: RosInstallation, cache: Path) -> Path | None:
    """A library to preload, built once for this ROS installation; None without a C compiler.

    Raises:
        GraderFault: It does not compile.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    command = [compiler, *_OPTIONS, *_includes(ros), str(source), *_LIBRARIES]
    what = (*command, _version(compiler), source.read_text(encoding="utf-8"))
    key = hashlib.sha256("\0".join(what).encode()).hexdigest()
    library = cache / "tracer" / f"{source.stem}-{key[:16]}.so"
    if not library.is_file():
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as folder:
            built = Path(folder, library.name)
            result = subprocess.run(
                [*command, "-o", str(built)],
                capture_output=True,
                text=True,
                errors="replace",
                timeout=_LIMIT_S,
                check=False,
            )
            if result.returncode != 0:
                raise GraderFault(f"{source.name} does not compile: {result.stderr.strip()}")
            built.replace(library)
    return library


@functools.cache
def _version(compiler: str) -> str:
    command = [compiler, "--version"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def _includes(ros: RosInstallation) -> list[str]:
    """Options for the headers of ROS: in Jazzy each package has a folder of its own."""
    folders = [
        folder
        for prefix in ros.prefixes
        for folder in sorted(prefix.glob("include/*"))
        if (folder / folder.name).is_dir()
    ]
    return [f"-I{folder}" for folder in folders]
