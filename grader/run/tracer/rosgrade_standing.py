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
"""A call that lasts this long is seen by two looks, and stands somewhere."""
_AGAIN_NS = 1_000_000_000
"""A call that goes on is reported again after as long as it has lasted, at most after this time."""
_MOST_REPORTS = 500
_LONGEST_TEXT = 80
_reported = [0]
_watched: set[int] = set()
"""Ids of the process, and of its parents, that have such a thread."""
_loops_of_files: dict[str, list[tuple[int, int]]] = {}
"""File -> first and last line of each loop in it."""


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
            _report_where(frame)


def _report_where(innermost: FrameType) -> None:
    """Report the call of a thread that has not returned for long, and where it is in it."""
    path, in_callback = _calls_of_program(innermost)
    if not path:
        return
    call, now_ns = path[0] if in_callback else _outermost_loop(path)[0], time.time_ns()
    if call.f_trace is None:
        call.f_trace = _Since(now_ns)
    since = call.f_trace
    if not isinstance(since, _Since) or now_ns < since.next_ns:
        return
    since.next_ns = now_ns + min(now_ns - since.began_ns, _AGAIN_NS)
    _reported[0] += 1
    newest, (looping, loop_line) = path[-1], _outermost_loop(path)
    report(
        "stands",
        function=call.f_code.co_name,
        in_callback=in_callback,
        file=newest.f_code.co_filename,
        line=newest.f_lineno,
        text=_text(newest, newest.f_lineno),
        loop_file=looping.f_code.co_filename,
        loop=loop_line,
        loop_text=_text(looping, loop_line),
        began_ns=since.began_ns,
        seen_ns=now_ns,
    )


def _calls_of_program(innermost: FrameType) -> tuple[list[FrameType], bool]:
    """The calls of the program's own functions, outermost first, and whether rclpy made them.

    Of those below rclpy only the callback and what it calls. None while the program waits in
    rclpy.spin(), which is no standing.
    """
    frames: list[FrameType] = []
    frame: FrameType | None = innermost
    while frame is not None:
        frames.insert(0, frame)
        frame = frame.f_back
    own, callbacks, spins = [], [], False
    is_in_rclpy = False
    for frame in frames:
        file = frame.f_code.co_filename
        if "/rclpy/" in file:
            is_in_rclpy = True
            spins = spins or file.endswith("/rclpy/executors.py")
        elif INSTALL and file.startswith(f"{INSTALL}/"):
            own.append(frame)
            spins = False
            if is_in_rclpy:
                callbacks.append(frame)
    if callbacks:
        return callbacks, True
    return ([] if spins else own), False


def _outermost_loop(path: list[FrameType]) -> tuple[FrameType, int]:
    """The outermost call that is in a loop, and the line of that; or the innermost, and 0."""
    for frame in path:
        if line := _loop_line(frame):
            return frame, line
    return path[-1], 0


def _loop_line(frame: FrameType) -> int:
    """The line of the innermost loop in which a function is now, or 0."""
    file = frame.f_code.co_filename
    if file not in _loops_of_files:
        import ast

        with open(file, "rb") as source:
            nodes = list(ast.walk(ast.parse(source.read())))
        loops = [node for node in nodes if isinstance(node, (ast.While, ast.For, ast.AsyncFor))]
        _loops_of_files[file] = [(loop.lineno, loop.end_lineno or 0) for loop in loops]
    function_line = frame.f_code.co_firstlineno
    around = [
        first
        for first, last in _loops_of_files[file]
        if function_line < first <= frame.f_lineno <= last
    ]
    return max(around, default=0)


def _text(frame: FrameType, line: int) -> str:
    import linecache

    return linecache.getline(frame.f_code.co_filename, line).strip()[:_LONGEST_TEXT]
