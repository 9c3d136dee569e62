"""Why a simulated robot did not move, or was cut short: one cause, the deepest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from grader.diagnosis.explanation import cause_of, explanation, mistaken, remedy
from grader.diagnosis.no_messages import NoMessages, why_refused, why_silent
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import NotDone, exited, process_ended, why_it_exited
from grader.diagnosis.wrong_value import misread_words, was_integer
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.findings.reference import Goal, UnknownValue
from grader.findings.value import leaves
from grader.findings.words import code, codes, counted, speed
from grader.measure.motion.approach import Approach
from grader.measure.motion.command import (
    VelocityCommand,
    command_topic,
    commands,
    is_zero,
    stolen_s,
)
from grader.measure.motion.scan import misreading
from grader.measure.motion.track import has_moved, index_at, is_at_rest
from grader.recording.model import NS, Recording
from grader.spec.unit import format_duration

_STILL = "the robot never moved"
# In so little time a robot does not get far enough to be seen.
_SHORT_S = 0.2


def why_not_judged(recording: Recording) -> Finding | None:
    """Why there is no motion to judge at all, moving or not; None if there is."""
    if recording.truth and recording.scene is not None:
        return None
    missing = why_no_node(recording)
    if missing is not None:
        return missing
    if recording.matched_ns is None:
        return why_silent(recording, command_topic(recording))
    return Finding.ours("there is no simulated robot in this scenario: it needs a `world`")


@dataclass(frozen=True)
class NotMoved(NotDone):
    """The robot never moved."""

    seen = _STILL

    @cached_property
    def sent(self) -> tuple[VelocityCommand, ...]:
        """The velocity commands."""
        return commands(self.recording)

    @cached_property
    def first(self) -> VelocityCommand:
        """The first command to move, or else the first of all.

        There is one for all explanations after ``nothing_published``, which answers without any.
        """
        moving = (item for item in self.sent if not is_zero(item.twist))
        return next(moving, self.sent[0])

    @property
    def evidence(self) -> Evidence:
        """When that command came."""
        label = "first command" if is_zero(self.first.twist) else "first command to move"
        return evidence_at(self.recording, label, self.first.time_ns)


def why_not_moved(recording: Recording) -> Finding | None:
    """Why the robot never moved; None if it did."""
    cause = why_not_judged(recording)
    if cause is not None or has_moved(recording.truth):
        return cause
    return cause_of(NotMoved(recording))


def approach(recording: Recording, goal: Goal) -> Approach | Finding:
    """The run towards a goal, or why there is none to judge."""
    not_judged = why_not_judged(recording)
    if not_judged is not None:
        return not_judged
    # A goal that the recording does not have is our fault, so it comes before the student's faults.
    try:
        pose = goal.pose(recording.values)
    except UnknownValue as error:
        return Finding.ours(str(error))
    return why_not_moved(recording) or Approach(recording, pose)


def why_cut_short(recording: Recording) -> Finding | None:
    """A process that ended while the robot was on its way, or commands that are not numbers."""
    ended = exited(recording)
    if ended:
        process, truth = ended[0], recording.truth
        exited_ns = process.exited_ns or recording.stop_ns
        was_at_rest = bool(truth) and is_at_rest(truth[index_at(truth, exited_ns)])
        # A program that stopped the robot and then returned has done its work.
        if process.exit_code != 0 or not was_at_rest:
            return why_it_exited(recording, process)
    return why_rejected(recording)


def why_rejected(recording: Recording) -> Finding | None:
    """Commands that the robot refused, for they were NaN or infinite; None without any."""
    rejected = [item for item in recording.incidents if item.kind == "command_rejected"]
    if not rejected:
        return None
    first, topic = rejected[0], code(command_topic(recording))
    were = "was" if len(rejected) == 1 else "were"
    return mistaken(
        "not_finite",
        f"{counted(len(rejected), 'command')} on {topic} {were} not finite (first: {first.text}); "
        "the robot stops instead",
        evidence_at(recording, "command rejected", first.time_ns),
    )


def why_misread(recording: Recording) -> Finding | None:
    """Commands with a number that ROS misread, such as a numpy.float32; None without any."""
    for item in commands(recording):
        twist = item.twist
        for field, number in (("linear.x", twist.linear_m_s), ("angular.z", twist.angular_rad_s)):
            if was_integer(number):
                seen = misread_words(code(field))
                shown = evidence_at(recording, "command misread", item.time_ns)
                return Finding(seen, remedy("float_field"), shown)
    return None


@explanation(NotMoved, after=(process_ended,))
def nothing_published(symptom: NotMoved) -> Finding | None:
    """Nothing was published on the topic of velocity commands."""
    if symptom.sent:
        return None
    return why_silent(symptom.recording, command_topic(symptom.recording)).after(_STILL)


@explanation(NotMoved)
def not_finite(symptom: NotMoved) -> Finding | None:
    """The commands are inf or NaN."""
    return why_rejected(symptom.recording)


@explanation(NotMoved, concept="qos")
def robot_not_matched(symptom: NotMoved) -> Finding | None:
    """The QoS of the publisher does not match that of the robot's subscription."""
    recording = symptom.recording
    if any(step.command_m_s or step.command_rad_s for step in recording.truth):
        return None
    # A subscription of the probe that requests less may get what the robot does not.
    cause = why_refused(NoMessages(recording, command_topic(recording)))
    return cause.after(_STILL) if cause is not None else None


@explanation(NotMoved)
def only_zeros(symptom: NotMoved) -> Finding | None:
    """linear.x and angular.z of all commands are 0, perhaps because a scan was misread."""
    if not all(is_zero(command.twist) for command in symptom.sent):
        return None
    recording, topic = symptom.recording, command_topic(symptom.recording)
    count = counted(len(symptom.sent), "command")
    seen = f"{_STILL}: in all {count} on {code(topic)}, linear.x and angular.z are 0"
    other_fields = _fields_not_zero(recording, topic)
    if other_fields:
        verb = "is" if len(other_fields) == 1 else "are"
        seen = f"{seen}, but {codes(other_fields)} {verb} not"
        return mistaken("only_zeros", seen, symptom.evidence)
    misread = misreading(recording, recording.truth[-1])
    if misread is not None:
        return Finding(f"{seen}; {misread.words}", misread.hint, symptom.evidence)
    return mistaken("only_zeros", seen, symptom.evidence)


def _fields_not_zero(recording: Recording, topic: str) -> list[str]:
    """Fields of the commands that have another value than 0 in any of them."""
    twists = [message.value.get("twist", message.value) for message in recording.on(topic)]
    return sorted({path for twist in twists for path, value in leaves(twist).items() if value})


@explanation(NotMoved)
def integer_in_command(symptom: NotMoved) -> Finding | None:
    """A float field holds an integer, which ROS misreads."""
    cause = why_misread(symptom.recording)
    return cause and cause.after(_STILL)


@explanation(NotMoved, general=True)
def moves_too_late(symptom: NotMoved) -> Finding:
    """The first command to move came too late or was too slow."""
    recording, first = symptom.recording, symptom.first
    begin_ns, end_ns = recording.truth[0].time_ns, recording.truth[-1].time_ns
    left_s = (end_ns - first.time_ns) / NS
    lost_s = stolen_s(recording, begin_ns, end_ns)
    if left_s < _SHORT_S <= left_s + lost_s:
        return Finding.held_up(f"{_STILL} until the end", lost_s)
    return mistaken(
        "moves_too_late",
        f"{_STILL}: the first command to move, {speed(first.twist.linear_m_s)} ahead, came "
        f"{format_duration(max(left_s, 0.0))} before the end",
        symptom.evidence,
    )
