"""Python source of a student as a syntax tree, without running it and whatever it holds."""

from __future__ import annotations

import ast
import subprocess
import sys
import threading
import warnings

from grader.submission.record import SourceError

MAX_BYTES = 2 * 2**20
"""No student writes a longer file by hand."""

_TRIED_APART_FROM_BYTES = 64 * 1024
_TRY_S = 20
_TRY = "import ast, sys; ast.parse(sys.stdin.buffer.read())"
_TOO_COMPLEX = "Python cannot parse this file: it is nested too deeply"
# Before 3.11.5 two threads of CPython that parse at the same time count their depths together, and
# one ends with a SystemError (python/cpython#106905); to catch warnings is for one at a time too.
_ONE_AT_A_TIME = threading.Lock()


def parse(data: bytes, file: str) -> ast.Module | SourceError:
    """Parse a file as Python would: encoding cookie, byte order mark and all.

    Args:
        data: Its content.
        file: Its path in the submission, for the error.

    Returns:
        The tree, or what Python says is wrong.
    """
    if len(data) > MAX_BYTES:
        return SourceError(file, None, f"larger than {MAX_BYTES // 2**20} MiB; not read as Python")
    if len(data) > _TRIED_APART_FROM_BYTES and not _survives(data):
        return SourceError(file, None, _TOO_COMPLEX)
    try:
        with _ONE_AT_A_TIME, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(data)
    except SyntaxError as error:
        return SourceError(file, error.lineno or None, f"{type(error).__name__}: {error.msg}")
    except (RecursionError, MemoryError):
        return SourceError(file, None, _TOO_COMPLEX)
    except ValueError as error:
        # Older Pythons say this of NUL bytes.
        return SourceError(file, None, f"SyntaxError: {error}")


def _survives(data: bytes) -> bool:
    """Whether parsing ends well, tried in a process of its own.

    CPython 3.10 dies of a stack overflow on long chains such as ``a.b.b.b...``; it takes more
    than 64 KiB of them.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-I", "-S", "-c", _TRY],
            input=data,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_TRY_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode >= 0


def is_python_script(data: bytes) -> bool:
    """Whether a file without the suffix ``.py`` starts like an executable Python script."""
    first = data[:200].split(b"\n", 1)[0]
    return first.startswith(b"#!") and b"python" in first
