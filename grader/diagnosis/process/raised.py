"""Python tracebacks in a process's output: what was raised, and where in the student's files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from grader.recording.model import LogLine, Recording
from grader.submission.record import SourceError, SubmissionRecord

_HEADER = "Traceback (most recent call last):"
_LINKS = (
    "During handling of the above exception, another exception occurred:",
    "The above exception was the direct cause of the following exception:",
)
_IGNORED = "Exception ignored in"
_FRAME = re.compile(r'\s+File "(?P<file>[^"]+)", line (?P<line>\d{1,7})(?:, in (?P<where>.+))?')
_RAISED = re.compile(r"(?P<type>[A-Za-z_][A-Za-z0-9_.]{0,200})(?:: (?P<message>.*))?")
_INSTALL_FOLDERS = ("site-packages", "dist-packages")


@dataclass(frozen=True)
class Frame:
    """One step of a traceback.

    Attributes:
        line: Line from 1.
        where: Function, or ``<module>``; empty for a syntax error.
        source: The line of code, or empty.
    """

    file: str
    line: int
    where: str = ""
    source: str = ""


@dataclass(frozen=True)
class Failure:
    """An exception as the interpreter printed it.

    Attributes:
        type: Short name of the class, such as ``ValueError``.
        ignored: Python printed and ignored it (``Exception ignored in ...``).
    """

    type: str
    message: str
    frames: tuple[Frame, ...]
    linked: bool = False
    ignored: bool = False

    def __str__(self) -> str:
        """Write it as Python does: ``ValueError: math domain error``."""
        return f"{self.type}: {self.message}" if self.message else self.type


def parse_failures(lines: Sequence[str]) -> tuple[Failure, ...]:
    """Find every traceback in the output of one process."""
    found: list[Failure] = []
    linked = ignored = False
    # What C code raised has no frames: the next failure, which has, is what came of it.
    said, origin = "", ""
    index = 0
    while index < len(lines):
        line = lines[index]
        if line.strip() == _HEADER or _FRAME.fullmatch(line):
            start = index + 1 if line.strip() == _HEADER else index
            failure, index = _parse_one(lines, start, linked, ignored)
            if failure is not None:
                found.append(_raised_by(failure, origin))
                linked = ignored = False
            said, origin = "", ""
            continue
        if line.strip() in _LINKS:
            linked, origin = True, said
        elif line.startswith(_IGNORED):
            ignored = True
        said = line.rstrip() if line.strip() else said
        index += 1
    return tuple(found)


def _raised_by(failure: Failure, origin: str) -> Failure:
    """A failure with what was raised before it without frames, if there is that."""
    raised = _RAISED.fullmatch(origin)
    if raised is None or not raised["message"]:
        return failure
    short = raised["type"].rpartition(".")[2]
    return replace(failure, type=short, message=raised["message"], linked=False)


def _parse_one(
    lines: Sequence[str], index: int, linked: bool, ignored: bool
) -> tuple[Failure | None, int]:
    """Read frames from ``index`` on, then the exception's line; return where to go on."""
    frames: list[Frame] = []
    while index < len(lines):
        line = lines[index]
        match = _FRAME.fullmatch(line)
        if match:
            frames.append(Frame(match["file"], int(match["line"]), match["where"] or ""))
        elif line[:1].isspace():
            if frames and not frames[-1].source:
                last = frames[-1]
                frames[-1] = Frame(last.file, last.line, last.where, line.strip())
        else:
            break
        index += 1
    if index == len(lines) or not frames:
        return None, index
    raised = _RAISED.fullmatch(lines[index].rstrip())
    if not raised:
        return None, index
    short = raised["type"].rpartition(".")[2]
    return Failure(short, raised["message"] or "", tuple(frames), linked, ignored), index + 1


def failures(recording: Recording, process: str) -> tuple[Failure, ...]:
    """Every traceback that a process wrote to stderr."""
    return parse_failures([line.text for line in _stderr(recording.log, process)])


def fatal_failure(recording: Recording, process: str) -> Failure | None:
    """The exception that ended a process: the deepest of the last chain.

    Of ``ValueError``, then another error while that one was handled, the ``ValueError`` is
    the one to mend.
    """
    found = [failure for failure in failures(recording, process) if not failure.ignored]
    if not found:
        return None
    first = len(found) - 1
    while first > 0 and found[first].linked:
        first -= 1
    return found[first]


def interrupted_place(recording: Recording, process: str) -> SourceError | None:
    """Where in the student's files a process was when SIGINT came, as its traceback tells.

    A process that was in ``rclpy.spin`` was where it should be: that place is not returned.
    """
    for failure in reversed(failures(recording, process)):
        if failure.type == "KeyboardInterrupt":
            place = student_place(failure, recording.submission, "was here when SIGINT came")
            frame = _student_frame(failure, recording.submission)
            if place is None or frame is None or "spin" in frame.source:
                return None
            source = f": {frame.source}" if frame.source else ""
            return SourceError(place.file, place.line, place.message + source)
    return None


def interrupted_callback(recording: Recording, process: str) -> SourceError | None:
    """Where in a callback a process was when SIGINT came; None if it was anywhere else.

    A loop of its own in main() is no callback: rclpy did not call it.
    """
    for failure in reversed(failures(recording, process)):
        if failure.type != "KeyboardInterrupt":
            continue
        frame = _student_frame(failure, recording.submission)
        if frame is None or "spin" in frame.source:
            return None
        callers = failure.frames[: failure.frames.index(frame)]
        if any("/rclpy/" in caller.file for caller in callers):
            return interrupted_place(recording, process)
        return None
    return None


def student_place(
    failure: Failure, submission: SubmissionRecord, message: str = ""
) -> SourceError | None:
    """The deepest frame in the student's own files, with its path in the submission.

    Args:
        message: What to say at the place; by default the exception.
    """
    frame = _student_frame(failure, submission)
    if frame is None:
        return None
    path = submission_path(frame.file, submission)
    return SourceError(path or frame.file, frame.line, message or str(failure))


def _student_frame(failure: Failure, submission: SubmissionRecord) -> Frame | None:
    for frame in reversed(failure.frames):
        if submission_path(frame.file, submission):
            return frame
    return None


def submission_path(installed: str, submission: SubmissionRecord) -> str | None:
    """Path in the submission of a file as a process named it, or None if it is not the student's.

    The longest of the known installed paths that the given path ends with wins.
    """
    best: tuple[int, str] | None = None
    for package in submission.packages:
        for known, path in package.files:
            if _ends_with(installed, known) and (best is None or len(known) > best[0]):
                best = len(known), path
    return best[1] if best else None


def _ends_with(installed: str, known: str) -> bool:
    if installed == known:
        return True
    if not installed.endswith("/" + known):
        return False
    # A lone file name such as node.py would match rclpy/node.py too.
    parent = installed[: -len(known) - 1].rpartition("/")[2]
    return "/" in known or parent in _INSTALL_FOLDERS


def _stderr(log: Iterable[LogLine], process: str) -> list[LogLine]:
    return [line for line in log if line.process == process and line.stream == "stderr"]
