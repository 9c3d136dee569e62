"""Why a simulated robot drove into something."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from grader.checks.finding import Evidence, Moment
from grader.checks.wording import code, counted
from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.process.blocked_executor import stuck_callback
from grader.measure.motion.command import commands, is_zero, scans
from grader.measure.motion.quantities import speed, turn
from grader.measure.motion.scan import newest
from grader.measure.motion.track import is_at_rest, speed_plot
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth

_DECIDED_HINT = (
    "It went on deciding to drive: log the range that you compare. Is it the beam straight ahead, "
    "whose angle is 0, of the newest scan (a loop in a callback never sees a newer one), and is "
    "your limit in metres? Where it is within the limit, publish linear.x = 0.0."
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


@dataclass(frozen=True)
class Contact(Symptom["Reason"]):
    """The robot drove into something."""

    recording: Recording
    step: Truth
    before: Truth

    @cached_property
    def command_times_ns(self) -> list[int]:
        """When commands were sent until then."""
        sent = commands(self.recording)
        return [item.time_ns for item in sent if item.time_ns <= self.step.time_ns]


@dataclass(frozen=True)
class Reason:
    """What is said behind the contact, and what to try."""

    words: str
    hint: str


def why_touched(recording: Recording) -> Cause | None:
    """What the robot drove into, when, how fast and why; None if it did not."""
    index = touch(recording)
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
    if before.command_m_s or before.command_rad_s:
        told = f"with linear.x = {speed(before.command_m_s)} as the last command"
    else:
        told = "although it had been told to stop: too late"
    reason = cause_of(Contact(recording, step, before))
    return Cause(
        f"drove into {code(name)} {motion}, {when_s:.2f} s after launch, {told}{reason.words}",
        reason.hint,
        Evidence(moments=(Moment(f"contact with {name}", when_s),), plots=(speed_plot(recording),)),
    )


@explanation(Contact)
def no_scan_for_long(symptom: Contact) -> Reason | None:
    """No scan had come for long."""
    scan = newest(symptom.recording, symptom.step.time_ns)
    since_ns = symptom.step.time_ns - scan.stamp_ns if scan is not None else 0
    if since_ns <= _BLIND_NS:
        return None
    return Reason(
        f"; the last scan had come {since_ns / NS:.2f} s before",
        "Without scans the robot drives blindly: keep the time of the last scan, and let a "
        "timer stop the robot when it is more than a second ago.",
    )


@explanation(Contact)
def old_command(symptom: Contact) -> Reason | None:
    """The last command, to drive, was long ago, and the robot keeps it."""
    sent = symptom.command_times_ns
    if not sent or not symptom.before.command_m_s or symptom.step.time_ns - sent[-1] <= _HELD_NS:
        return None
    return Reason(
        f", sent {(symptom.step.time_ns - sent[-1]) / NS:.2f} s before",
        "The robot keeps the last command: publish one with every scan, or from a timer of 10 "
        "Hz or more, and to stop one with linear.x = 0.0. A time.sleep() or a loop in a "
        "callback keeps it from coming in time.",
    )


@explanation(Contact)
def callback_in_a_loop(symptom: Contact) -> Reason | None:
    """A callback was in a loop or slept, and never saw a newer scan."""
    place = stuck_callback(symptom.recording)
    if place is None:
        return None
    return Reason(
        f"; a callback was at {place.file}:{place.line} when it was interrupted",
        "A loop in a callback never sees a newer scan, nor does a time.sleep(), because the "
        "next one waits for its end: decide once for each scan, publish once and return.",
    )


@explanation(Contact)
def contradicting_commands(symptom: Contact) -> Reason | None:
    """Two places publish: one stops the robot, the other drives it on."""
    end_ns = symptom.step.time_ns
    lately = [
        item
        for item in commands(symptom.recording)
        if end_ns - _LATELY_NS <= item.time_ns <= end_ns
    ]
    stops = sum(is_zero(item.twist) for item in lately)
    if not _CONTRADICTIONS <= stops < len(lately):
        return None
    return Reason(
        f"; {stops} of {counted(len(lately), 'command')} in the last second were to stop",
        "Two places publish: one stops the robot, the other drives it on at once. Look for a timer "
        "that publishes the speed again and again, and let one place alone decide.",
    )


@explanation(Contact)
def fewer_commands_than_scans(symptom: Contact) -> Reason | None:
    """A slow callback or timer decides by old scans."""
    sent, end_ns = symptom.command_times_ns, symptom.step.time_ns
    seen = [
        item for item in scans(symptom.recording) if sent and sent[0] <= item.stamp_ns <= end_ns
    ]
    if len(seen) < _FEW_SCANS or len(sent) >= _ANSWERED * len(seen):
        return None
    return Reason(
        f"; only {counted(len(sent), 'command')} followed the {len(seen)} scans until then",
        "A time.sleep() in the callback lets scans wait in the queue, and what is decided then "
        "is from an old one; so is it in a slow timer. Publish in the callback of the scan, "
        "and return at once. "
        f"{_DECIDED_HINT}",
    )


@explanation(Contact)
def decided_to_drive(symptom: Contact) -> Reason | None:
    """It went on deciding to drive, with scans before it."""
    if not scans(symptom.recording) or symptom.before.command_m_s <= 0.0:
        return None
    return Reason("", _DECIDED_HINT)


@explanation(Contact, general=True)
def drove_into_it(symptom: Contact) -> Reason:
    """It did not stop early enough."""
    return Reason(
        "",
        "Stop early enough: the robot needs time to see (a scan comes every 0.2 s) and to "
        "brake, and its edge is ahead of its middle.",
    )


def touch(recording: Recording) -> int | None:
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
