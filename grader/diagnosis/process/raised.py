"""What a process raised, as its output tells, and where that is in the student's files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from grader.diagnosis.process.crash import parse_crashes
from grader.diagnosis.process.failure import Failure, Frame
from grader.findings.words import code
from grader.measure import declarations
from grader.recording.model import Recording
from grader.recording.submission import SourceError, SubmissionRecord

_HEADER = "Traceback (most recent call last):"
_LINKS = (
    "During handling of the above exception, another exception occurred:",
    "The above exception was the direct cause of the following exception:",
)
_IGNORED = "Exception ignored in"
_FRAME = re.compile(r'\s+File "(?P<file>[^"]+)", line (?P<line>\d{1,7})(?:, in (?P<where>.+))?')
_RAISED = re.compile(r"(?P<type>[A-Za-z_][A-Za-z0-9_.]{0,200})(?:: (?P<message>.*))?")
_ASSERTED = re.compile(r".+: Assertion (?P<message>.+ failed\.)")
_CALLED = re.compile(r"(\w+)\(\)")
_NOT_CALLABLE = re.compile(r"'(\w+)' object is not callable")
_INSTALL_FOLDERS = ("site-packages", "dist-packages")
_OF_CPP = (".cpp", ".cc", ".cxx", ".c", ".hpp", ".hh", ".hxx", ".h")


def parse_failures(lines: Sequence[str]) -> tuple[Failure, ...]:
    """Find every traceback in the output of one process."""
    found: list[Failure] = []
    linked = ignored = False
    index = 0
    while index < len(lines):
        line = lines[index]
        if line.strip() == _HEADER or _FRAME.fullmatch(line):
            start = index + 1 if line.strip() == _HEADER else index
            failure, index = _parse_one(lines, start, linked, ignored)
            if failure is not None:
                found.append(failure)
                linked = ignored = False
            continue
        linked = linked or line.strip() in _LINKS
        ignored = ignored or line.startswith(_IGNORED)
        index += 1
    return tuple(found)


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
    raised = _RAISED.fullmatch(lines[index].rstrip()) if index < len(lines) and frames else None
    if not raised:
        return None, index
    short = raised["type"].rpartition(".")[2]
    return Failure(short, raised["message"] or "", tuple(frames), linked, ignored), index + 1


def failures(recording: Recording, process: str) -> tuple[Failure, ...]:
    """Every failure that a process wrote to stderr: tracebacks, or what ends compiled programs."""
    of_process = (line for line in recording.log if line.process == process)
    lines = [line.text for line in of_process if line.stream == "stderr"]
    if declarations.is_compiled(recording, process):
        return parse_failures(lines) or parse_crashes(lines)
    # The C code that converts a message ends the process without a traceback.
    asserted = (_ASSERTED.fullmatch(line) for line in lines)
    return parse_failures(lines) or tuple(
        Failure("Assertion", one["message"], ()) for one in asserted if one
    )


def fatal_failure(recording: Recording, process: str) -> Failure | None:
    """The exception that ended a process: of the last chain, the first that is the student's.

    Of ``ValueError``, then another error while that one was handled, the ``ValueError`` is
    the one to correct; but not if rclpy handled it itself, to say it in better words.
    """
    found = [failure for failure in failures(recording, process) if not failure.ignored]
    first = len(found) - 1
    while first > 0 and found[first].linked:
        first -= 1
    chain = found[max(first, 0) :]
    own = (one for one in chain if _student_frame(one, recording.submission) is not None)
    return next(own, chain[0] if chain else None)


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
    found = [item for item in failures(recording, process) if item.type == "KeyboardInterrupt"]
    frame = _student_frame(found[-1], recording.submission) if found else None
    if frame is None:
        return None
    callers = found[-1].frames[: found[-1].frames.index(frame)]
    is_called = any("/rclpy/" in caller.file for caller in callers)
    if not is_called and "spin" in frame.source:
        return None
    path = submission_path(frame.file, recording.submission) or frame.file
    message = f"{code(frame.where)} was here when it was stopped"
    return Interrupted(SourceError(path, frame.line, message), frame.where, frame.source, is_called)


def student_place(failure: Failure, submission: SubmissionRecord) -> SourceError | None:
    """The deepest frame in the student's own files, with its path in the submission."""
    frame = _student_frame(failure, submission)
    if frame is None:
        return None
    path = submission_path(frame.file, submission) or frame.file
    return SourceError(path, frame.line, str(failure))


def raised_at(failure: Failure, recording: Recording) -> SourceError | None:
    """The student's line to correct, where rclpy raised it.

    In spin() it is that of the callback, in publish() that which set the field.
    """
    submission, place = recording.submission, student_place(failure, recording.submission)
    frame = _student_frame(failure, submission)
    if frame is None or place is None or frame is failure.frames[-1]:
        return place
    if "spin" not in frame.source:
        return _set_at(place, recording) or place
    called = (
        defined_at(name, str(failure), submission) for name in _CALLED.findall(failure.message)
    )
    if found := next(filter(None, called), None):
        return found
    # What is no function was given to a timer in place of one.
    given = _NOT_CALLABLE.match(failure.message)
    for timer in recording.declared("timer") if given else ():
        path = submission_path(str(timer.data.get("file")), submission)
        line = timer.data.get("line")
        if given and timer.data.get("callback") == given[1] and path and isinstance(line, int):
            return SourceError(path, line, str(failure))
    return place


def _set_at(published: SourceError, recording: Recording) -> SourceError | None:
    """The line that gave a field a value of another type, as the process declares the field."""
    told = (one.data.get("field") for one in recording.declared("exiting"))
    field = str(next(filter(None, told), "")).split(".")[::-1]
    best: tuple[tuple[int, bool, bool, int], SourceError] | None = None
    for package in recording.submission.packages:
        for file in package.sources:
            for target, line in file.sets:
                parts = zip(target.split(".")[:0:-1], field, strict=False)
                alike = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], parts))
                # Of two in the same file the one before the message is published.
                own = file.path == published.file
                rank = (alike, own, own and line <= (published.line or 0), line)
                if alike and (best is None or rank > best[0]):
                    best = rank, SourceError(file.path, line, published.message)
    return best and best[1]


def defined_at(name: str, message: str, submission: SubmissionRecord) -> SourceError | None:
    """The line where the student's program defines a function or a method."""
    last = name.rpartition(".")[2]
    return next(
        (
            SourceError(file.path, one.line, message)
            for package in submission.packages
            for file in package.sources
            for one in file.functions
            if one.name.rpartition(".")[2] == last
        ),
        None,
    )


def own_frames(lines: Sequence[str], submission: SubmissionRecord) -> list[str]:
    """Printed lines, of a traceback only the frames in the student's files, if it has any."""
    kept: list[str] = []
    in_foreign = has_own = False
    for line in lines:
        frame = _FRAME.fullmatch(line)
        if frame:
            own = submission_path(frame["file"], submission) is not None
            in_foreign, has_own = not own, has_own or own
        elif not line[:1].isspace():
            in_foreign = False
        if not in_foreign:
            kept.append(line)
    return kept if has_own else list(lines)


def in_brackets(place: SourceError | None) -> str:
    """A place as it follows a sentence, such as `` (node.py:14)``; empty without one."""
    return f" ({place.file}:{place.line})" if place else ""


def _student_frame(failure: Failure, submission: SubmissionRecord) -> Frame | None:
    own = (frame for frame in reversed(failure.frames) if submission_path(frame.file, submission))
    return next(own, None)


def submission_path(installed: str, submission: SubmissionRecord) -> str | None:
    """Path in the submission of a file as a process named it, or None if it is not the student's.

    The longest of the known installed paths that the given path ends with wins. A compiled program
    knows the path of its source instead.
    """
    if installed.endswith(_OF_CPP):
        named = (path for path in submission.files if f"/{installed}".endswith(f"/{path}"))
        within = (path for path in submission.files if path.endswith(f"/{installed}"))
        return max(named, key=len, default=None) or next(within, None)
    known = [pair for package in submission.packages for pair in package.files]
    known += [
        (f"share/{package.name}/{new}", old)
        for package in submission.packages
        for new, old in package.shared
        if old
    ]
    fitting = [pair for pair in known if _ends_with(installed, pair[0])]
    return max(fitting, key=lambda pair: len(pair[0]))[1] if fitting else None


def _ends_with(installed: str, known: str) -> bool:
    if installed == known:
        return True
    if not installed.endswith("/" + known):
        return False
    # A lone file name such as node.py would match rclpy/node.py too.
    parent = installed[: -len(known) - 1].rpartition("/")[2]
    return "/" in known or parent in _INSTALL_FOLDERS
