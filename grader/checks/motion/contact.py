"""Contact of the simulated robot: the check, and contact as the cause of other findings."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.motion.command import commands, is_zero, scans
from grader.checks.motion.measure import metres, speed, turn
from grader.checks.motion.robot_check import RobotParameters
from grader.checks.motion.scan import newest
from grader.checks.motion.track import has_moved, is_at_rest, speed_plot, way_m
from grader.checks.wording import code, counted
from grader.diagnosis.cause import Cause
from grader.diagnosis.motion.no_motion import why_cut_short, why_not_judged, why_not_moved
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.blocked_executor import stuck_callback
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth

_HINT = (
    "Stop early enough: the robot needs time to see (a scan comes every 0.2 s) and to brake, and "
    "its edge is ahead of its middle."
)
_DECIDED_HINT = (
    "It went on deciding to drive: log the range that you compare. Is it the beam straight ahead, "
    "whose angle is 0, of the newest scan (a loop in a callback never sees a newer one), and is "
    "your limit in metres? Where it is within the limit, publish linear.x = 0.0."
)
_HELD_HINT = (
    "The robot keeps the last command: publish one with every scan, or from a timer of 10 Hz or "
    "more, and to stop one with linear.x = 0.0. A time.sleep() or a loop in a callback keeps it "
    "from coming in time."
)
_BLIND_HINT = (
    "Without scans the robot drives blindly: keep the time of the last scan, and let a timer stop "
    "the robot when it is more than a second ago."
)
_CONTRADICTED_HINT = (
    "Two places publish: one stops the robot, the other drives it on at once. Look for a timer "
    "that publishes the speed again and again, and let one place alone decide."
)
_STUCK_HINT = (
    "A loop in a callback never sees a newer scan, nor does a time.sleep(), because the next one "
    "waits for its end: decide once for each scan, publish once and return."
)
_SLOW_HINT = (
    "A time.sleep() in the callback lets scans wait in the queue, and what is decided then is from "
    "an old one; so is it in a slow timer. Publish in the callback of the scan, and return at once."
)
# Commands that were sent so long before contradict each other.
_LATELY_NS = NS
# Fewer commands to stop may come of noise.
_CONTRADICTIONS = 3
# A command that is older was not answered to one of the last two scans of the slowest LiDAR.
_HELD_NS = NS // 2
# So many scans, of which so many had an answer, are no chance.
_FEW_SCANS = 10
_ANSWERED = 0.8
# Several scans of any LiDAR.
_BLIND_NS = NS
# Rest before something moving ran into the robot.
_RESTED_NS = NS // 5


class NoContact(RobotParameters):
    """Parameters of motion.no_contact."""

    moving: bool = Field(
        True,
        description="Whether the robot must also have moved: one that always stands touches "
        "nothing.",
    )


@check("motion.no_contact", Subject.RECORDING, NoContact)
def no_contact(recording: Recording, parameters: NoContact) -> Finding:
    """The robot touches nothing.

    Judged by the simulator. Something that runs into a robot at rest does not count.
    A robot that never moved does not pass, unless `moving` is false.
    """
    expected = "touches nothing"
    cause = why_not_moved(recording) if parameters.moving else why_not_judged(recording)
    if cause is None and not parameters.moving:
        cause = why_no_node(recording) or (
            None if has_moved(recording.truth) else why_cut_short(recording)
        )
    if cause is not None and _touch(recording) is None:
        return cause.finding(expected)
    touched = why_touched(recording)
    if touched is not None:
        cause = why_cut_short(recording)
        return (cause.after(touched.observed) if cause else touched).finding(expected)
    way = metres(way_m(recording.truth))
    return Finding.passed(
        expected, f"no contact on {way}", Evidence(plots=(speed_plot(recording),))
    )


def why_touched(recording: Recording) -> Cause | None:
    """What the robot drove into, when and how fast; None if it did not."""
    index = _touch(recording)
    if index is None:
        return None
    step, before = recording.truth[index], recording.truth[max(index - 1, 0)]
    when_s = recording.since_launch_s(step.time_ns)
    name = step.contact or "something"
    if abs(before.linear_m_s) < 1e-3:
        motion = f"while turning at {turn(before.angular_rad_s)}"
    else:
        way = "backwards " if before.linear_m_s < 0.0 else ""
        motion = f"{way}at {speed(abs(before.linear_m_s))}"
    blind_ns = _blind_ns(recording, step)
    blind = f"; the last scan had come {blind_ns / NS:.2f} s before" if blind_ns else ""
    held_ns = 0 if blind else _held_ns(recording, step, before)
    held = f", sent {held_ns / NS:.2f} s before" if held_ns else ""
    deeper = None
    if not blind and not held:
        deeper = _stuck(recording) or _contradicted(recording, step) or _slow(recording, step)
    more, hint = deeper or ("", _hint(recording, before))
    return Cause(
        f"drove into {code(name)} {motion}, {when_s:.2f} s after launch, "
        f"{_told(before)}{held}{blind}{more}",
        _BLIND_HINT if blind else _HELD_HINT if held else hint,
        Evidence(moments=(Moment(f"contact with {name}", when_s),), plots=(speed_plot(recording),)),
    )


def _stuck(recording: Recording) -> tuple[str, str] | None:
    """A callback that was at work when it was interrupted: words for it, and what to try."""
    place = stuck_callback(recording)
    if place is None:
        return None
    return (
        f"; a callback was at {place.file}:{place.line} when it was interrupted",
        _STUCK_HINT,
    )


def _contradicted(recording: Recording, step: Truth) -> tuple[str, str] | None:
    """Commands to stop that were undone by others: words for them, and what to try."""
    lately = [
        item
        for item in commands(recording)
        if step.time_ns - _LATELY_NS <= item.time_ns <= step.time_ns
    ]
    stops = sum(is_zero(item.twist) for item in lately)
    if not _CONTRADICTIONS <= stops < len(lately):
        return None
    return (
        f"; {stops} of {counted(len(lately), 'command')} in the last second were to stop",
        _CONTRADICTED_HINT,
    )


def _slow(recording: Recording, step: Truth) -> tuple[str, str] | None:
    """Fewer commands than scans, time and again: words for it, and what to try."""
    sent = [item.time_ns for item in commands(recording) if item.time_ns <= step.time_ns]
    told = [item for item in scans(recording) if sent and sent[0] <= item.stamp_ns <= step.time_ns]
    if len(told) < _FEW_SCANS or len(sent) >= _ANSWERED * len(told):
        return None
    return (
        f"; only {counted(len(sent), 'command')} followed the {len(told)} scans until then",
        f"{_SLOW_HINT} {_DECIDED_HINT}",
    )


def _blind_ns(recording: Recording, step: Truth) -> int:
    """Since when no scan had come, if that is long enough to be the reason; else 0."""
    scan = newest(recording, step.time_ns)
    since_ns = step.time_ns - scan.stamp_ns if scan is not None else 0
    return since_ns if since_ns > _BLIND_NS else 0


def _held_ns(recording: Recording, step: Truth, before: Truth) -> int:
    """Since when the command to drive had been held, if that is long enough to matter; else 0."""
    sent = [item.time_ns for item in commands(recording) if item.time_ns <= step.time_ns]
    if not sent or not before.command_m_s:
        return 0
    since_ns = step.time_ns - sent[-1]
    return since_ns if since_ns > _HELD_NS else 0


def _hint(recording: Recording, before: Truth) -> str:
    saw = bool(scans(recording))
    return _DECIDED_HINT if saw and before.command_m_s > 0.0 else _HINT


def _told(step: Truth) -> str:
    """What the robot was told to do then."""
    if step.command_m_s or step.command_rad_s:
        return f"with linear.x = {speed(step.command_m_s)} as the last command"
    return "although it had been told to stop: too late"


def _touch(recording: Recording) -> int | None:
    """Index of the first step of a contact that is the robot's own doing."""
    truth = recording.truth
    before: str | None = None
    for index, step in enumerate(truth):
        if step.contact is not None and step.contact != before and not _was_hit(truth, index):
            return index
        before = step.contact
    return None


def _was_hit(truth: tuple[Truth, ...], index: int) -> bool:
    """Whether something moving ran into the robot while it stood."""
    step = truth[index]
    if not (step.contact or "").startswith("moving") or step.command_m_s:
        return False
    since = index
    while since and step.time_ns - truth[since].time_ns < _RESTED_NS:
        since -= 1
    return all(is_at_rest(item) for item in truth[since:index])
