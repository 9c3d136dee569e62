"""Checks of the commands that the robot gets: within its limits, and slower near the goal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

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
_SEVERAL = 3
_DIGITS = 4
# Of a proportion with two decimals, the limit and the step below it may be all that comes.
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
    plots = (
        _plot(recording, sent, "linear.x (m/s)", scene.max_linear_m_s),
        _plot(recording, sent, "angular.z (rad/s)", scene.max_angular_rad_s),
    )
    widest = max(sent, key=lambda command: _share_of_limit(command, scene))
    beyond = [command for command in sent if _share_of_limit(command, scene) > _ROUNDING]
    if not beyond:
        seen = f"{counted(len(sent), 'command')}, at most {_nearest_limit(widest, scene)}"
        return Finding.as_asked(seen, Evidence(plots=plots))
    first = beyond[0]
    share = percent(round(len(beyond) / len(sent), 3))
    seen = f"{len(beyond)} of {counted(len(sent), 'command')} ({share}): the first is "
    seen += _nearest_limit(first, scene)
    if widest is not first:
        seen += f", the largest {_nearest_limit(widest, scene)}"
    label = "first command beyond a limit"
    return mistaken("beyond_limits", seen, evidence_at(recording, label, first.time_ns, *plots))


def _shares(command: VelocityCommand, scene: Scene) -> tuple[float, float]:
    """How many times its limit each field asks for: linear.x, angular.z."""
    linear, angular = abs(command.twist.linear_m_s), abs(command.twist.angular_rad_s)
    return linear / scene.max_linear_m_s, angular / scene.max_angular_rad_s


def _share_of_limit(command: VelocityCommand, scene: Scene) -> float:
    return max(_shares(command, scene))


def _nearest_limit(command: VelocityCommand, scene: Scene) -> str:
    """The field that is nearer to its limit, or farther beyond it."""
    linear, angular = _shares(command, scene)
    if linear >= angular:
        return f"linear.x = {speed(command.twist.linear_m_s)}"
    return f"angular.z = {turn(command.twist.angular_rad_s)}"


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
    driving = [command for command in commands(recording) if _size(command) > NO_SPEED_M_S]
    if not driving:
        return _no_drive(recording)
    fastest = max(map(_size, driving))
    last = min(driving[-_LAST:], key=_size)
    plot = _plot(recording, driving, "linear.x (m/s)")
    evidence = evidence_at(recording, "end of the way", last.time_ns, plot)
    if _is_switched(driving):
        sizes = sorted({_rounded(command) for command in driving}, reverse=True)
        both = " and ".join(map(speed, sizes))
        seen = f"linear.x is switched between {both}, whatever the distance is"
        return mistaken("on_off", seen, evidence)
    seen = f"{speed(_size(last))} at the end; the largest is {speed(fastest)}"
    if _size(last) <= parameters.share * fastest:
        return Finding.as_asked(seen, evidence)
    return mistaken("not_slower", seen, evidence)


def _no_drive(recording: Recording) -> Finding:
    topic = command_topic(recording)
    sent = recording.on(topic)
    if not sent:
        return why_silent(recording, topic)
    shown = Evidence(moments=first_seen(recording, sent))
    return mistaken("no_drive", f"no command on {code(topic)} has a linear.x other than 0", shown)


def _is_switched(driving: Sequence[VelocityCommand]) -> bool:
    """Whether the speed is switched between two sizes, which is on-off control.

    Of a proportion that is limited, the limit comes again and again, but nothing below it does: no
    size below is sent several times, but for one that is rounded, or held for a moment.
    """
    numbers = Counter(_rounded(command) for command in driving)
    if len(numbers) != 2 or min(numbers.values()) < _SEVERAL:
        return False
    lower, upper = sorted(numbers)
    times_ns = [command.time_ns for command in driving if _rounded(command) == lower]
    is_rounded = round(upper - lower, _DIGITS) <= _STEP_M_S
    is_held = times_ns[-1] - times_ns[0] <= _HELD_NS
    return not is_rounded and not is_held


def _rounded(command: VelocityCommand) -> float:
    return round(_size(command), _DIGITS)


def _size(command: VelocityCommand) -> float:
    return abs(command.twist.linear_m_s)


def _plot(
    recording: Recording, sent: Sequence[VelocityCommand], field: str, limit: float | None = None
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
