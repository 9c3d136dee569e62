"""What a process raised, as its output tells, and where that is in the student's files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from grader.diagnosis.process.crash import parse_crashes
from grader.diagnosis.process.failure import Failure, Frame
from grader.diagnosis.process.tracebacks import FRAME, parse_assertions, parse_failures
from grader.findings.words import code
from grader.measure import declarations
from grader.recording.model import Recording
from grader.recording.submission import SourceError, SubmissionRecord

_CALLED = re.compile(r"(\w+)\(\)")
_NOT_CALLABLE = re.compile(r"'(\w+)' object is not callable")
_INSTALL_FOLDERS = ("site-packages", "dist-packages")
_OF_CPP = (".cpp", ".cc", ".cxx", ".c", ".hpp", ".hh", ".hxx", ".h")


def failures(recording: Recording, process: str) -> tuple[Failure, ...]:
    """Every failure that a process wrote to stderr: tracebacks, or what ends compiled programs."""
    of_process = (line for line in recording.log if line.process == process)
    lines = [line.text for line in of_process if line.stream == "stderr"]
    tracebacks = parse_failures(lines)
    if tracebacks:
        return tracebacks
    is_compiled = declarations.is_compiled(recording, process)
    return parse_crashes(lines) if is_compiled else parse_assertions(lines)


def fatal_failure(recording: Recording, process: str) -> Failure | None:
    """The exception that ended a process: of the last chain, the first that is the student's.

    Of ``ValueError``, then another error while that one was handled, the ``ValueError`` is
    the one to correct; but not if rclpy handled it itself, to say it in better words.
    """
    printed = [failure for failure in failures(recording, process) if not failure.ignored]
    first = len(printed) - 1
    while first > 0 and printed[first].linked:
        first -= 1
    last_chain = printed[max(first, 0) :]
    for failure in last_chain:
        if _student_frame(failure, recording.submission) is not None:
            return failure
    return last_chain[0] if last_chain else None


@dataclass(frozen=True)
class Interrupted:
    """A call of the student's that SIGINT interrupted, as its traceback tells."""

    place: SourceError
    function: str
    text: str
    in_callback: bool


def interrupted_call(recording: Recording, process: str) -> Interrupted | None:
    """Where in the student's files a process was when SIGINT came.

    A process that was in ``rclpy.spin`` was where it should be: that place is not returned,
    unless a callback spins.
    """
    interrupts = [one for one in failures(recording, process) if one.type == "KeyboardInterrupt"]
    frame = _student_frame(interrupts[-1], recording.submission) if interrupts else None
    if frame is None:
        return None
    frames = interrupts[-1].frames
    in_callback = any("/rclpy/" in caller.file for caller in frames[: frames.index(frame)])
    if not in_callback and "spin" in frame.source:
        return None
    message = f"{code(frame.where)} was here when it was stopped"
    place = _place_of(frame, message, recording.submission)
    return Interrupted(place, frame.where, frame.source, in_callback)


def student_place(failure: Failure, submission: SubmissionRecord) -> SourceError | None:
    """The deepest frame in the student's own files, with its path in the submission."""
    frame = _student_frame(failure, submission)
    return _place_of(frame, str(failure), submission) if frame is not None else None


def _place_of(frame: Frame, message: str, submission: SubmissionRecord) -> SourceError:
    return SourceError(submission_path(frame.file, submission) or frame.file, frame.line, message)


def raised_at(failure: Failure, recording: Recording) -> SourceError | None:
    """The student's line to correct, where rclpy raised it.

    In spin() it is that of the callback, in publish() that which set the field.
    """
    place = student_place(failure, recording.submission)
    frame = _student_frame(failure, recording.submission)
    if frame is None or place is None or frame is failure.frames[-1]:
        return place
    if "spin" in frame.source:
        return _callback_at(failure, recording) or _timer_at(failure, recording) or place
    return _field_set_at(place, recording) or place


def _callback_at(failure: Failure, recording: Recording) -> SourceError | None:
    """The function that the message names, as in ``tick() takes 1 positional argument``."""
    for name in _CALLED.findall(failure.message):
        place = defined_at(name, str(failure), recording.submission)
        if place is not None:
            return place
    return None


def _timer_at(failure: Failure, recording: Recording) -> SourceError | None:
    """Where a timer was created with something that is no function as its callback."""
    match = _NOT_CALLABLE.match(failure.message)
    for timer in recording.declared("timer") if match is not None else ():
        path = submission_path(str(timer.data.get("file")), recording.submission)
        line = timer.data.get("line")
        if match and timer.data.get("callback") == match[1] and path and isinstance(line, int):
            return SourceError(path, line, str(failure))
    return None


def _field_set_at(published: SourceError, recording: Recording) -> SourceError | None:
    """The line that gave a field a value of another type, as the process declares the field.

    Of several, that which names most of the path of the field, such as ``twist.linear.x``; then
    one in the file that publishes, before it does so.
    """
    declared = (str(one.data.get("field") or "") for one in recording.declared("exiting"))
    field = next(filter(None, declared), "").split(".")
    candidates: list[tuple[tuple[int, bool, bool, int], SourceError]] = []
    for package in recording.submission.packages:
        for file in package.sources:
            for target, line in file.sets:
                ends = zip(reversed(target.split(".")[1:]), reversed(field), strict=False)
                equal_steps = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], ends))
                if equal_steps:
                    in_file = file.path == published.file
                    is_before = in_file and line <= (published.line or 0)
                    place = SourceError(file.path, line, published.message)
                    candidates.append(((equal_steps, in_file, is_before, line), place))
    return max(candidates, key=lambda candidate: candidate[0])[1] if candidates else None


def defined_at(name: str, message: str, submission: SubmissionRecord) -> SourceError | None:
    """The line where the student's program defines a function or a method."""
    short = name.rpartition(".")[2]
    for package in submission.packages:
        for file in package.sources:
            for function in file.functions:
                if function.name.rpartition(".")[2] == short:
                    return SourceError(file.path, function.line, message)
    return None


def own_frames(lines: Sequence[str], submission: SubmissionRecord) -> list[str]:
    """Printed lines, of a traceback only the frames in the student's files, if it has any."""
    kept: list[str] = []
    is_foreign = has_own = False
    for line in lines:
        frame = FRAME.fullmatch(line)
        if frame:
            is_foreign = submission_path(frame["file"], submission) is None
            has_own = has_own or not is_foreign
        elif not line[:1].isspace():
            is_foreign = False
        if not is_foreign:
            kept.append(line)
    return kept if has_own else list(lines)


def in_brackets(place: SourceError | None) -> str:
    """A place as it follows a sentence, such as `` (node.py:14)``; empty without one."""
    return f" ({place.file}:{place.line})" if place else ""


def _student_frame(failure: Failure, submission: SubmissionRecord) -> Frame | None:
    for frame in reversed(failure.frames):
        if submission_path(frame.file, submission):
            return frame
    return None


def submission_path(installed: str, submission: SubmissionRecord) -> str | None:
    """Path in the submission of a file as a process named it, or None if it is not the student's.

    The longest of the known installed paths that the given path ends with wins. A compiled program
    knows the path of its source instead.
    """
    if installed.endswith(_OF_CPP):
        ending_it = [path for path in submission.files if f"/{installed}".endswith(f"/{path}")]
        ended_by_it = [path for path in submission.files if path.endswith(f"/{installed}")]
        return max(ending_it, key=len, default=ended_by_it[0] if ended_by_it else None)
    origins = [pair for package in submission.packages for pair in package.files]
    origins += [
        (f"share/{package.name}/{path}", origin)
        for package in submission.packages
        for path, origin in package.shared
        if origin
    ]
    fitting = [pair for pair in origins if _ends_with(installed, pair[0])]
    return max(fitting, key=lambda pair: len(pair[0]))[1] if fitting else None


def _ends_with(installed: str, known: str) -> bool:
    if installed == known:
        return True
    if not installed.endswith("/" + known):
        return False
    # A lone file name such as node.py would match rclpy/node.py too.
    parent = installed[: -len(known) - 1].rpartition("/")[2]
    return "/" in known or parent in _INSTALL_FOLDERS
