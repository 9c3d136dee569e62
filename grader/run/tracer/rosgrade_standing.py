"""Where a program stands: calls of its own functions that do not return, with file and line.

A thread looks at the stacks of all others ten times a second, from rclpy.init() on. It tells of
a callback that runs for long, and of a program that has not come to rclpy.spin().
"""

from __future__ import annotations

import os
import sys
import time

from rosgrade_report import INSTALL, quietly, report  # type: ignore[import-not-found]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType

_LOOK_S = 0.1
_LONG_NS = 90_000_000
_AGAIN_NS = 1_000_000_000
_MOST_REPORTS = 500
_LONGEST_TEXT = 80
_reported = [0]
_watched: set[int] = set()
_loops: dict[str, list[tuple[int, int]]] = {}


class _Since:
    """When a call was first seen.

    As `f_trace` of its frame, which only debuggers use, it goes with the call: the next call of
    the same function is another.
    """

    def __init__(self, now_ns: int) -> None:
        self.began_ns = now_ns
        self.next_ns = now_ns + _LONG_NS

    def __call__(self, *_: object) -> _Since:
        """Let a debugger of the program's, which calls it at each line, go on."""
        return self


def watch() -> None:
    """Begin to look, once in a process; a child of it has no such thread."""
    if os.getpid() not in _watched:
        import _thread

        _watched.add(os.getpid())
        _thread.start_new_thread(_watch, ())


def _watch() -> None:
    while _reported[0] < _MOST_REPORTS:
        time.sleep(_LOOK_S)
        quietly(_look)


def _look() -> None:
    import _thread

    for thread, frame in sys._current_frames().items():
        if thread != _thread.get_ident():
            _tell(frame)


def _tell(innermost: FrameType) -> None:
    frames: list[FrameType] = []
    frame: FrameType | None = innermost
    while frame is not None:
        frames.insert(0, frame)
        frame = frame.f_back
    files = [one.f_code.co_filename for one in frames]
    own = [
        n
        for n, file in enumerate(files)
        if file.startswith(f"{INSTALL}/") and "/rclpy/" not in file
    ]
    by_ros = next((n for n, file in enumerate(files) if "/rclpy/" in file), len(files))
    called = [n for n in own if n > by_ros]
    spins = own and any(file.endswith("/rclpy/executors.py") for file in files[own[-1] :])
    if not INSTALL or not own or (spins and not called):
        return
    path = [frames[n] for n in called or own]
    call, now_ns = path[0] if called else _looping(path)[0], time.time_ns()
    if call.f_trace is None:
        call.f_trace = _Since(now_ns)
    since = call.f_trace
    if not isinstance(since, _Since) or now_ns < since.next_ns:
        return
    since.next_ns = now_ns + min(now_ns - since.began_ns, _AGAIN_NS)
    _reported[0] += 1
    at, (looping, loop) = path[-1], _looping(path)
    report(
        "stands",
        function=call.f_code.co_name,
        in_callback=bool(called),
        file=at.f_code.co_filename,
        line=at.f_lineno,
        text=_text(at, at.f_lineno),
        loop_file=looping.f_code.co_filename,
        loop=loop,
        loop_text=_text(looping, loop),
        began_ns=since.began_ns,
        seen_ns=now_ns,
    )


def _looping(path: list[FrameType]) -> tuple[FrameType, int]:
    """The outermost call that is in a loop, and the line of that; or the innermost, and 0."""
    return next(((one, line) for one in path if (line := _loop(one))), (path[-1], 0))


def _loop(frame: FrameType) -> int:
    """The line of the innermost loop in which a function is now, or 0."""
    file = frame.f_code.co_filename
    if file not in _loops:
        import ast

        with open(file, "rb") as source:
            nodes = list(ast.walk(ast.parse(source.read())))
        loops = [one for one in nodes if isinstance(one, (ast.While, ast.For, ast.AsyncFor))]
        _loops[file] = [(one.lineno, one.end_lineno or 0) for one in loops]
    first = frame.f_code.co_firstlineno
    return max((a for a, b in _loops[file] if first < a <= frame.f_lineno <= b), default=0)


def _text(frame: FrameType, line: int) -> str:
    import linecache

    return linecache.getline(frame.f_code.co_filename, line).strip()[:_LONGEST_TEXT]
