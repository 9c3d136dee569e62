"""Why a simulated robot drove into something."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken
from grader.diagnosis.process.standing import stuck
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.findings.words import speed, turn
from grader.measure.motion.command import VelocityCommand, commands
from grader.measure.motion.scan import newest
from grader.measure.motion.track import is_at_rest, speed_plot
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth
from sim.shapes import obstacle_words

# A command that is older did not answer one of the last two scans of the slowest LiDAR.
_HELD_NS = NS // 2
# Several scans of any LiDAR.
_BLIND_NS = NS
# Rest before something moving ran into the robot.
_RESTED_NS = NS // 5


@dataclass(frozen=True)
class Contact(Symptom[Finding]):
    """The robot drove into something.

    What a cause observes is a clause that follows the contact in the text.
    """

    recording: Recording
    step: Truth
    before: Truth

    @cached_property
    def sent(self) -> list[VelocityCommand]:
        """Commands until then."""
        return [item for item in commands(self.recording) if item.time_ns <= self.step.time_ns]


def why_touched(recording: Recording) -> Finding | None:
    """What the robot drove into, when, how fast and why; None if it did not."""
    index = _touch(recording)
    if index is None:
        return None
    step, before = recording.truth[index], recording.truth[max(index - 1, 0)]
    when_s = recording.since_launch_s(step.time_ns)
    name = obstacle_words(step.contact or "")
    if abs(before.linear_m_s) < 1e-3:
        motion = f"while turning at {turn(before.angular_rad_s)}"
    else:
        way = "backwards " if before.linear_m_s < 0.0 else ""
        motion = f"{way}at {speed(abs(before.linear_m_s))}"
    if before.command_m_s or before.command_rad_s:
        command = f"with linear.x = {speed(before.command_m_s)} as the last command"
    else:
        command = "although the last command was to stop: it came too late"
    reason = cause_of(Contact(recording, step, before))
    evidence = evidence_at(recording, f"contact with {name}", step.time_ns, speed_plot(recording))
    return Finding(
        f"drove into {name} {motion}, {when_s:.2f} s after launch, {command}{reason.observed}",
        reason.hint,
        replace(evidence, places=reason.evidence.places),
    )


@explanation(Contact)
def no_scan_for_long(symptom: Contact) -> Finding | None:
    """No scan came for a long time."""
    scan = newest(symptom.recording, symptom.step.time_ns)
    if scan is None:
        return None
    since_ns = symptom.step.time_ns - scan.stamp_ns
    if since_ns <= _BLIND_NS:
        return None
    return mistaken("no_scan_for_long", f"; the last scan had come {since_ns / NS:.2f} s before")


@explanation(Contact)
def old_command(symptom: Contact) -> Finding | None:
    """The last command was to drive, and the robot keeps it."""
    if not symptom.sent or not symptom.before.command_m_s:
        return None
    since_ns = symptom.step.time_ns - symptom.sent[-1].time_ns
    if since_ns <= _HELD_NS:
        return None
    return mistaken("old_command", f", sent {since_ns / NS:.2f} s before")


@explanation(Contact)
def callback_in_a_loop(symptom: Contact) -> Finding | None:
    """A callback looped or slept and never saw a newer scan."""
    stand = stuck(symptom.recording)
    if stand is None:
        return None
    return Finding(f"; {stand.words}", stand.hint, Evidence(places=(stand.place,)))


@explanation(Contact, general=True)
def decided_to_drive(symptom: Contact) -> Finding:
    """The node continued to drive, or stopped too late."""
    return mistaken("decided_to_drive", "")


def _touch(recording: Recording) -> int | None:
    """Index of the first step of a contact that the robot caused itself, or None."""
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
    just_before = [one for one in truth[:index] if step.time_ns - one.time_ns <= _RESTED_NS]
    return all(map(is_at_rest, just_before))
