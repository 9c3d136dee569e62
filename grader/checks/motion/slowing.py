"""The check that the robot is told to drive more slowly near the end of its way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Plot
from grader.checks.first_seen import first_seen
from grader.checks.motion.robot_check import RobotParameters
from grader.checks.wording import code, counted, percent
from grader.diagnosis.motion.no_motion import why_cut_short, why_not_moved
from grader.diagnosis.no_messages import why_silent
from grader.measure.motion.approach import NO_SPEED_M_S
from grader.measure.motion.command import VelocityCommand, command_topic, commands
from grader.measure.motion.quantities import speed
from grader.recording.model import NS, Recording
from grader.spec.quantity import Ratio

# The last one alone may be of a callback that was late.
_LAST = 5
_MOST_POINTS = 400
# Of a proportion that is limited, the limit comes again and again, but nothing below it does.
_SWITCHED = 2
_SEVERAL = 3
_DIGITS = 4
# Of one with two decimals, the limit and the step below it may be all that comes.
_STEP_M_S = 0.01
# One that is computed at 2 Hz may be published more often, and be the only one below the limit.
_HELD_NS = NS


class SlowsDown(RobotParameters):
    """Parameters of motion.slows_down."""

    share: Ratio = Field(
        0.8, description="Speed of the last commands that drive, as a share of the fastest."
    )


@check("motion.slows_down", Subject.RECORDING, SlowsDown)
def slows_down(recording: Recording, parameters: SlowsDown) -> Finding:
    """The speed ahead becomes less towards the end of the way.

    Judged by linear.x of the commands as they were published: the slowest of the last five that
    drive must be at most a share of the fastest. A speed in proportion to the distance is so with
    any gain and any clamp, as long as the goal's tolerance is small enough to leave the clamp.

    It is no proportion either where all commands have one of two sizes, each of them several times,
    unless these are next to each other where a command has two decimals, or the lower one comes for
    1 s at most.
    """
    expected = (
        f"linear.x at the end of the way at most {percent(parameters.share)} of its largest value"
    )
    cause = why_not_moved(recording) or why_cut_short(recording)
    if cause is not None:
        return cause.finding(expected)
    driving = [item for item in commands(recording) if _size(item) > NO_SPEED_M_S]
    if not driving:
        topic = command_topic(recording)
        if not recording.on(topic):
            return why_silent(recording, topic).finding(expected)
        return Finding.failed(
            expected,
            f"no command on {code(topic)} has a linear.x other than 0",
            "linear.x = gain * distance, on the way to the goal's position.",
            Evidence(moments=first_seen(recording, recording.on(topic))),
        )
    fastest = max(map(_size, driving))
    last = min(driving[-_LAST:], key=_size)
    evidence = _evidence(recording, driving, last)
    seen = f"{speed(_size(last))} at the end, {speed(fastest)} at most"
    levels = Counter(round(_size(item), _DIGITS) for item in driving)
    if len(levels) == _SWITCHED and min(levels.values()) >= _SEVERAL and _stays(driving, levels):
        sizes = " and ".join(speed(size) for size in sorted(levels, reverse=True))
        return Finding.failed(
            expected,
            f"linear.x is switched between {sizes}, whatever the distance is",
            "linear.x = gain * distance, at most the limit: it becomes less with every command.",
            evidence,
        )
    if _size(last) <= parameters.share * fastest:
        return Finding.passed(expected, seen, evidence)
    same = all(abs(_size(item) - fastest) <= NO_SPEED_M_S for item in driving)
    observed = (
        f"all of {counted(len(driving), 'command')} that drive have linear.x = {speed(fastest)}"
        if same
        else seen
    )
    return Finding.failed(
        expected,
        observed,
        "linear.x = gain * distance: far from the goal the robot is fast, near it slow.",
        evidence,
    )


def _stays(driving: list[VelocityCommand], levels: Collection[float]) -> bool:
    """Whether the lower of two sizes is no step of a proportion that was rounded or held."""
    lower = min(levels)
    times_ns = [item.time_ns for item in driving if round(_size(item), _DIGITS) == lower]
    standalone_build = round(max(levels) - lower, _DIGITS)
    return standalone_build > _STEP_M_S and times_ns[-1] - times_ns[0] > _HELD_NS


def _size(item: VelocityCommand) -> float:
    return abs(item.twist.linear_m_s)


def _when_s(recording: Recording, item: VelocityCommand) -> float:
    return recording.since_launch_s(item.time_ns)


def _evidence(
    recording: Recording, driving: list[VelocityCommand], last: VelocityCommand
) -> Evidence:
    shown = driving[:: max(1, len(driving) // _MOST_POINTS)]
    return Evidence(
        moments=(Moment("end of the way", _when_s(recording, last)),),
        plots=(
            Plot(
                "Commanded speed",
                "time since launch (s)",
                "linear.x (m/s)",
                tuple(_when_s(recording, item) for item in shown),
                tuple(item.twist.linear_m_s for item in shown),
            ),
        ),
    )
