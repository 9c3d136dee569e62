"""Where a program stands that does not go on, and what to do about that line."""

from __future__ import annotations

import re
from dataclasses import dataclass

from grader.diagnosis.explanation import remedy
from grader.diagnosis.process.raised import interrupted_call, submission_path
from grader.findings.words import SPIN, code
from grader.measure.declarations import never_spun
from grader.measure.standing import Standing, at_the_end, longest_callback
from grader.recording.model import NS, Recording
from grader.recording.submission import SourceError
from grader.spec.unit import format_duration

_LONGEST_TEXT = 80
# What a line waits for -> the mistake of waiting for it in a callback.
_WAITS = {
    r"\brate\w*\.sleep\(": "waits_for_a_rate",
    r"\.call\(": "waits_for_an_answer",
    r"\bspin|future|\.done\(|\.result\(": "waits_for_a_future",
    r"lock|acquire\(": "waits_for_a_lock",
}
_SERVER = re.compile(r"\bwait_for_(service|(action_)?server)\(")
# What g++ says of a future that is not kept.
_UNKEPT = re.compile(
    r"^(?P<file>[^\s:]+):(?P<line>\d{1,7}):.*ignoring return.*\basync\(", re.MULTILINE
)


@dataclass(frozen=True)
class Stand:
    """A call of the student's that did not return, or not soon.

    Attributes:
        place: Its line in the submission.
        words: What it does, in words.
        lasted_s: How long it was seen, or None where nothing but its end tells of it.
    """

    place: SourceError
    words: str
    hint: str
    in_callback: bool
    lasted_s: float | None = None


def where_it_stands(
    recording: Recording, process: str, *, in_callback: bool = False
) -> Stand | None:
    """Where a process did not go on at the end of the observation, or None where nothing tells.

    Its tracer declares that; else the traceback tells it that SIGINT caused.

    Args:
        in_callback: Only if rclpy had called it: a loop in main() is no callback.
    """
    standing = at_the_end(recording, process)
    place = _place(recording, standing) if standing is not None else None
    if standing is None or place is None:
        return _interrupted_stand(recording, process, in_callback)
    if not standing.in_callback and (in_callback or not never_spun(recording, process)):
        return None
    since = f"from {recording.since_launch_s(standing.began_ns):.2f} s after launch on"
    text, function = _text(standing), standing.function
    words = _words(function, place.line or 0, text, since, standing.in_callback)
    return _stand(standing, place, words)


def _interrupted_stand(recording: Recording, process: str, in_callback: bool) -> Stand | None:
    """The same by the traceback that SIGINT caused."""
    call = interrupted_call(recording, process)
    if call is None or (in_callback and not call.in_callback):
        return None
    line, text = call.place.line or 0, call.text
    words = _words(call.function, line, text, "when it was stopped", call.in_callback)
    return Stand(call.place, words, _hint(text, "", call.in_callback), call.in_callback)


def stuck(recording: Recording) -> Stand | None:
    """Where a callback did not return until the end, or what comes before spin(); or None."""
    for process in recording.processes:
        spins = not never_spun(recording, process.name)
        stand = where_it_stands(recording, process.name, in_callback=spins)
        if stand is not None:
            return stand
    return None


def slow_callback(recording: Recording, process: str | None = None) -> Stand | None:
    """Where the callback was that took the longest; None where all were short."""
    standing = longest_callback(recording, process)
    place = _place(recording, standing) if standing is not None else None
    if standing is None or place is None:
        return unkept_future(recording)
    took = format_duration(round((standing.seen_ns - standing.began_ns) / NS, 1))
    where = _in_line(place.line or 0, _text(standing))
    return _stand(standing, place, f"{code(standing.function)} takes {took} or more: {where}")


def unkept_future(recording: Recording) -> Stand | None:
    """Where a callback in C++ waits in the destructor of a future, as its compiler warned."""
    build = recording.submission.build
    match = _UNKEPT.search(build.log) if build is not None else None
    if match is None:
        return None
    line = int(match["line"])
    words = "the future that `std::async` returns waits in its destructor until the work is done"
    place = SourceError(match["file"], line, "this future is not kept")
    hint = remedy("unkept_future")
    return Stand(place, f"{words}: {_in_line(line, '')}", hint, in_callback=True)


def _stand(standing: Standing, place: SourceError, words: str) -> Stand:
    loop_text = standing.loop_text if standing.loop else ""
    hint = _hint(standing.text, loop_text, standing.in_callback)
    lasted_s = (standing.seen_ns - standing.began_ns) / NS
    return Stand(place, words, hint, standing.in_callback, lasted_s)


def _is_kept_by_loop(standing: Standing) -> bool:
    """Whether the loop around the line keeps the call, and not the line, which waits for ever."""
    line_waits = any(re.search(pattern, standing.text) for pattern in _WAITS)
    return bool(standing.loop) and not line_waits


def _text(standing: Standing) -> str:
    """The line that keeps a call."""
    return (standing.loop_text if _is_kept_by_loop(standing) else standing.text)[:_LONGEST_TEXT]


def _place(recording: Recording, standing: Standing) -> SourceError | None:
    file, line = standing.file, standing.line
    if _is_kept_by_loop(standing):
        file, line = standing.loop_file, standing.loop
    path = submission_path(file, recording.submission)
    return SourceError(path, line, f"{code(standing.function)} stands here") if path else None


def _in_line(line: int, text: str) -> str:
    return f"it is in line {line}" + (f", {code(text)}" if text else "")


def _words(function: str, line: int, text: str, when: str, in_callback: bool) -> str:
    what = f"{code(function)} does not return"
    if not in_callback:
        what = f"{SPIN} is not reached, because {what}"
    return f"{what}: {_in_line(line, text)}, {when}"


def _hint(text: str, loop: str, in_callback: bool) -> str:
    if "input(" in text:
        return remedy("no_keyboard")
    if _SERVER.search(text) or _SERVER.search(loop):
        return remedy("waits_for_a_server")
    if not in_callback:
        return remedy("not_in_a_callback")
    for pattern, mistake in _WAITS.items():
        if re.search(pattern, text) or re.search(pattern, loop):
            return remedy(mistake)
    is_loop = loop or text.startswith(("while ", "for "))
    return remedy("loops" if is_loop else "sleeps")
