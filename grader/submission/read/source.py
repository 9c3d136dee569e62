"""Python source of a student as a syntax tree, safely and without running it."""

from __future__ import annotations

import ast
import subprocess
import sys
import threading
import warnings
from dataclasses import dataclass

from grader.recording.submission import SourceError

MAX_BYTES = 2 * 2**20
"""No student writes a longer file by hand."""

_TRIED_FROM_BYTES = 64 * 1024
_TRY_S = 20.0
_TRY = """
import ast, gc, os, resource, sys
resource.setrlimit(resource.RLIMIT_DATA, (2**30, 2**30))
gc.disable()
try:
    tree = ast.parse(sys.stdin.buffer.read())
    ended = int(sum(1 for _ in ast.walk(tree)) > int(sys.argv[1]))
except MemoryError:
    ended = 1
except Exception:
    ended = 0
# To take a large tree apart again would take as long as to make it.
os._exit(ended)
"""
_TOO_COMPLEX = "Python cannot parse this file: it is nested too deeply or holds too much"
_TOO_MUCH = "not read: the submission holds too much Python code"
# Before 3.11.5 two threads of CPython that parse at the same time count their depths together, and
# one ends with a SystemError (python/cpython#106905); to catch warnings is for one at a time too.
_ONE_AT_A_TIME = threading.Lock()


@dataclass
class Allowance:
    """What the Python files of one submission may take together to be read.

    A tree takes up to a thousand times the memory of what it is made from, and all trees of a
    submission are there at once.

    Attributes:
        nodes: Of all trees; what people write has one for eleven bytes.
    """

    nodes: int = 1_000_000


def parse(data: bytes, file: str, allowance: Allowance | None = None) -> ast.Module | SourceError:
    """Parse a file as Python would: encoding cookie, byte order mark and all.

    Args:
        allowance: Of its submission; what the file takes is taken from it.
    """
    left = allowance or Allowance()
    if len(data) > MAX_BYTES:
        return SourceError(file, None, f"larger than {MAX_BYTES // 2**20} MiB; not read as Python")
    if left.nodes <= 0:
        return SourceError(file, None, _TOO_MUCH)
    if len(data) > _TRIED_FROM_BYTES and not _survives(data, left):
        return SourceError(file, None, _TOO_COMPLEX)
    try:
        with _ONE_AT_A_TIME, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(data)
    except SyntaxError as error:
        return SourceError(file, error.lineno or None, f"{type(error).__name__}: {error.msg}")
    except (RecursionError, MemoryError):
        return SourceError(file, None, _TOO_COMPLEX)
    except ValueError as error:
        # Older Pythons say this of NUL bytes.
        return SourceError(file, None, f"SyntaxError: {error}")
    for node in ast.walk(tree):
        left.nodes -= 1
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            # Half of a surrogate pair is no text that JSON could hold.
            node.value = node.value.encode(errors="backslashreplace").decode()
    return tree


def _survives(data: bytes, left: Allowance) -> bool:
    """Whether parsing ends well and makes no more than is allowed, tried in a process of its own.

    CPython 3.10 dies of a stack overflow on long chains such as ``a.b.b.b...``; it takes more
    than 64 KiB of them.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-I", "-S", "-c", _TRY, str(left.nodes)],
            input=data,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_TRY_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        # A few more files like this, and the rest is not read.
        left.nodes -= 250_000
        return False
    return done.returncode == 0


def is_python_script(data: bytes) -> bool:
    """Whether a file without the suffix ``.py`` starts like an executable Python script."""
    first = data[:200].split(b"\n", 1)[0]
    return first.startswith(b"#!") and b"python" in first
