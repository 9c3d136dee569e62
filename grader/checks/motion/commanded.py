"""Checks of the commands that the robot gets: within its limits, and slower near the goal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.robot_check import RobotParameters
from grader.checks.need import SimulatedRobot
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.no_motion import (
    why_cut_short,
    why_not_judged,
    why_not_moved,
    why_rejected,
)
from grader.diagnosis.no_messages import why_silent
from grader.findings.finding import Evidence, Finding, Plot, evidence_at, first_seen
from grader.findings.words import code, counted, percent, speed, turn
from grader.measure.motion.approach import NO_SPEED_M_S
from grader.measure.motion.command import VelocityCommand, command_topic, commands
from grader.recording.model import NS, Recording
from grader.recording.simulated import Scene
from grader.spec.quantity import Ratio

# Limits are written down with three digits.
_ROUNDING = 1.001
_MOST_POINTS = 400
# The last command alone may be of a callback that was late.
_LAST = 5
# Of a proportion that is limited, the limit comes again and again, but nothing below it does.
_SWITCHED = 2
_SEVERAL = 3
_DIGITS = 4
# Of one with two decimals, the limit and the step below it may be all that comes.
_STEP_M_S = 0.01
# One that is computed at 2 Hz may be published more often, and be the only one below the limit.
_HELD_NS = NS


class WithinLimits(RobotParameters):
    """Parameters of motion.within_limits."""

    needs = (SimulatedRobot(commanded=True),)
    asks = "commands within the limits of the robot"

    def asked_of(self, subject: Recording) -> str:
        """With the limits of the robot that the run has."""
        if subject.scene is None:
            return self.asked_for
        limits = (
            f"{speed(subject.scene.max_linear_m_s)} and {turn(subject.scene.max_angular_rad_s)}"
        )
        return f"commands of at most {limits}, either way"


@check("motion.within_limits", Subject.RECORDING, WithinLimits)
def within_limits(recording: Recording, parameters: WithinLimits) -> Finding:
    """Every command is within the limits of the robot.

    Judged by the commands as they were published. The simulated robot limits its motion itself, so
    only this check sees commands beyond the limits.
    """
    stop_if(why_not_judged(recording))
    sent, scene = commands(recording), recording.scene
    assert scene is not None
    if not sent:
        return why_silent(recording, command_topic(recording))
    stop_if(why_rejected(recording))
    beyond = [item for item in sent if _excess(item, scene)[0] > _ROUNDING]
    plots = (
        _plot(recording, sent, "linear.x (m/s)", scene.max_linear_m_s),
        _plot(recording, sent, "angular.z (rad/s)", scene.max_angular_rad_s),
    )
    if not beyond:
        widest = max(sent, key=lambda item: _excess(item, scene)[0])
        seen = f"{counted(len(sent), 'command')}, at most {_excess(widest, scene)[1]}"
        return Finding.as_asked(seen, Evidence(plots=plots))
    first, worst = beyond[0], max(beyond, key=lambda item: _excess(item, scene)[0])
    share = percent(round(len(beyond) / len(sent), 3))
    most = "" if worst is first else f", the largest {_excess(worst, scene)[1]}"
    return mistaken(
        "beyond_limits",
        f"{len(beyond)} of {counted(len(sent), 'command')} ({share}): the first is "
        f"{_excess(first, scene)[1]}{most}",
        evidence_at(recording, "first command beyond a limit", first.time_ns, *plots),
    )


def _excess(item: VelocityCommand, scene: Scene) -> tuple[float, str]:
    """How many times the nearer limit is asked for, and the field that asks."""
    linear, angular = item.twist.linear_m_s, item.twist.angular_rad_s
    return max(
        (abs(linear) / scene.max_linear_m_s, f"linear.x = {speed(linear)}"),
        (abs(angular) / scene.max_angular_rad_s, f"angular.z = {turn(angular)}"),
        key=lambda excess: excess[0],
    )


class SlowsDown(RobotParameters):
    """Parameters of motion.slows_down."""

    needs = (SimulatedRobot(commanded=True),)

    share: Ratio = Field(
        0.8, description="Speed of the last commands that drive, as a share of the fastest."
    )

    def _asked(self) -> str:
        most = f"at most {percent(self.share)} of its largest value"
        return f"linear.x at the end of the way {most}"


@check("motion.slows_down", Subject.RECORDING, SlowsDown)
def slows_down(recording: Recording, parameters: SlowsDown) -> Finding:
    """The robot slows down towards the end of its path.

    Judged by linear.x of the commands as they were published: the slowest of the last five that
    drive must be at most a share of the fastest. A speed proportional to the distance passes with
    any gain and any limit, if the tolerance of the goal is small enough that the speed falls below
    the limit.

    Commands of only two sizes, each sent three times or more, fail: that is on-off control. It is
    no failure if the sizes differ by 0.01 m/s or less, or the lower one is sent for 1 s or less.
    """
    stop_if(why_not_moved(recording) or why_cut_short(recording))
    driving = [item for item in commands(recording) if _size(item) > NO_SPEED_M_S]
    if not driving:
        topic = command_topic(recording)
        sent = recording.on(topic)
        shown = Evidence(moments=first_seen(recording, sent))
        seen = f"no command on {code(topic)} has a linear.x other than 0"
        return mistaken("no_drive", seen, shown) if sent else why_silent(recording, topic)
    fastest = max(map(_size, driving))
    last = min(driving[-_LAST:], key=_size)
    plot = _plot(recording, driving, "linear.x (m/s)")
    evidence = evidence_at(recording, "end of the way", last.time_ns, plot)
    seen = f"{speed(_size(last))} at the end; the largest is {speed(fastest)}"
    levels = Counter(round(_size(item), _DIGITS) for item in driving)
    if len(levels) == _SWITCHED and min(levels.values()) >= _SEVERAL and _stays(driving, levels):
        sizes = " and ".join(speed(size) for size in sorted(levels, reverse=True))
        seen = f"linear.x is switched between {sizes}, whatever the distance is"
        return mistaken("on_off", seen, evidence)
    if _size(last) <= parameters.share * fastest:
        return Finding.as_asked(seen, evidence)
    return mistaken("not_slower", seen, evidence)


def _stays(driving: list[VelocityCommand], levels: Collection[float]) -> bool:
    """Whether the lower of two sizes is no step of a proportion that was rounded or held."""
    lower = min(levels)
    times_ns = [item.time_ns for item in driving if round(_size(item), _DIGITS) == lower]
    difference_m_s = round(max(levels) - lower, _DIGITS)
    return difference_m_s > _STEP_M_S and times_ns[-1] - times_ns[0] > _HELD_NS


def _size(item: VelocityCommand) -> float:
    return abs(item.twist.linear_m_s)


def _plot(
    recording: Recording,
    sent: Sequence[VelocityCommand],
    field: str,
    limit: float | None = None,
) -> Plot:
    """A field of the commands over time, with the robot's limit."""
    shown = sent[:: max(1, len(sent) // _MOST_POINTS)]
    is_linear = field.startswith("linear")
    return Plot(
        "Commanded speed" if is_linear else "Commanded turn",
        "time since launch (s)",
        field,
        tuple(recording.since_launch_s(item.time_ns) for item in shown),
        tuple(item.twist.linear_m_s if is_linear else item.twist.angular_rad_s for item in shown),
        None if limit is None else (-limit, limit),
    )
