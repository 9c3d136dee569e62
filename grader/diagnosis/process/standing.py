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
    found = at_the_end(recording, process)
    place = _place(recording, found) if found is not None else None
    if found is None or place is None:
        call = interrupted_call(recording, process)
        if call is None or (in_callback and not call.in_callback):
            return None
        line, text = call.place.line or 0, call.text
        words = _words(call.function, line, text, "when it was stopped", call.in_callback)
        return Stand(call.place, words, _hint(text, "", call.in_callback), call.in_callback)
    if not found.in_callback and (in_callback or not never_spun(recording, process)):
        return None
    since = f"from {recording.since_launch_s(found.began_ns):.2f} s after launch on"
    words = _words(found.function, place.line or 0, _text(found), since, found.in_callback)
    return _stand(found, place, words)


def stuck(recording: Recording) -> Stand | None:
    """Where a callback did not return until the end, or what comes before spin(); or None."""
    for process in recording.processes:
        spins = not never_spun(recording, process.name)
        found = where_it_stands(recording, process.name, in_callback=spins)
        if found is not None:
            return found
    return None


def slow_callback(recording: Recording, process: str | None = None) -> Stand | None:
    """Where the callback was that took the longest; None where all were short."""
    found = longest_callback(recording, process)
    place = _place(recording, found) if found is not None else None
    if found is None or place is None:
        return unkept_future(recording)
    took = format_duration(round((found.seen_ns - found.began_ns) / NS, 1))
    words = f"{code(found.function)} takes {took} or more: {_at(place.line or 0, _text(found))}"
    return _stand(found, place, words)


def unkept_future(recording: Recording) -> Stand | None:
    """Where a callback in C++ waits in the destructor of a future, as its compiler warned."""
    build = recording.submission.build
    found = _UNKEPT.search(build.log) if build is not None else None
    if found is None:
        return None
    words = "the future that `std::async` returns waits in its destructor until the work is done"
    place = SourceError(found["file"], int(found["line"]), "this future is not kept")
    return Stand(
        place, f"{words}: {_at(int(found['line']), '')}", remedy("unkept_future"), in_callback=True
    )


def _stand(found: Standing, place: SourceError, words: str) -> Stand:
    hint = _hint(found.text, found.loop_text if found.loop else "", found.in_callback)
    return Stand(place, words, hint, found.in_callback, (found.seen_ns - found.began_ns) / NS)


def _waits(text: str) -> bool:
    return any(re.search(pattern, text) for pattern in _WAITS)


def _text(found: Standing) -> str:
    """The line that keeps a call: the one that waits for ever, or the loop, or where it is."""
    text = found.text if not found.loop or _waits(found.text) else found.loop_text
    return text[:_LONGEST_TEXT]


def _place(recording: Recording, found: Standing) -> SourceError | None:
    at_line = not found.loop or _waits(found.text)
    file, line = (found.file, found.line) if at_line else (found.loop_file, found.loop)
    path = submission_path(file, recording.submission)
    return SourceError(path, line, f"{code(found.function)} stands here") if path else None


def _at(line: int, text: str) -> str:
    return f"it is in line {line}" + (f", {code(text)}" if text else "")


def _words(function: str, line: int, text: str, when: str, in_callback: bool) -> str:
    what = f"{code(function)} does not return"
    if not in_callback:
        what = f"{SPIN} is not reached, because {what}"
    return f"{what}: {_at(line, text)}, {when}"


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
