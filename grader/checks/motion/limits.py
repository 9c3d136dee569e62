"""The check of commands against what the robot can do."""

from __future__ import annotations

import math

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Plot
from grader.checks.motion.robot_check import RobotParameters
from grader.checks.wording import counted, percent
from grader.diagnosis.cause import Cause
from grader.diagnosis.motion.no_motion import why_not_judged, why_rejected
from grader.diagnosis.no_messages import why_silent
from grader.measure.motion.command import VelocityCommand, command_topic, commands
from grader.measure.motion.quantities import speed, turn
from grader.recording.model import Recording
from grader.recording.simulated import Scene
from grader.spec.quantity import Ratio

# Limits are written down with three digits.
_ROUNDING = 1.001
_MOST_POINTS = 400


class WithinLimits(RobotParameters):
    """Parameters of motion.within_limits."""

    share: Ratio = Field(0.0, description="Share of the commands that may be beyond a limit.")


@check("motion.within_limits", Subject.RECORDING, WithinLimits)
def within_limits(recording: Recording, parameters: WithinLimits) -> Finding:
    """Every command is within the limits of the robot.

    Judged by the commands as they were published. The robot itself does no more than it can,
    so that what it is asked for beyond it shows only here.
    """
    cause = why_not_judged(recording)
    scene = recording.scene
    if cause is not None or scene is None:
        cause = cause or Cause("there is no world", ours=True)
        return cause.finding("commands within the limits of the robot")
    expected = (
        f"commands of at most {speed(scene.max_linear_m_s)} and {turn(scene.max_angular_rad_s)}, "
        "either way"
    )
    sent = commands(recording)
    if not sent:
        return why_silent(recording, command_topic(recording)).finding(expected)
    cause = why_rejected(recording)
    if cause is not None:
        return cause.finding(expected)
    beyond = [item for item in sent if _excess(item, scene) > _ROUNDING]
    evidence = _evidence(recording, sent, scene)
    if len(beyond) <= parameters.share * len(sent):
        widest = max(sent, key=lambda item: _excess(item, scene))
        return Finding.passed(
            expected, f"{counted(len(sent), 'command')}, at most {_words(widest, scene)}", evidence
        )
    first, worst = beyond[0], max(beyond, key=lambda item: _excess(item, scene))
    when_s = recording.since_launch_s(first.time_ns)
    share = percent(round(len(beyond) / len(sent), 3))
    most = "" if worst is first else f", the largest {_words(worst, scene)}"
    return Finding.failed(
        expected,
        f"{len(beyond)} of {counted(len(sent), 'command')} ({share}): the first is "
        f"{_words(first, scene)}{most}",
        "Clamp before you publish: max(-limit, min(limit, value)).",
        Evidence(moments=(Moment("first command beyond", when_s),), plots=evidence.plots),
    )


def _excess(item: VelocityCommand, scene: Scene) -> float:
    """How many times the nearer limit is asked for; inf for what is not finite."""
    twist = item.twist
    if not twist.is_finite:
        return math.inf
    return max(
        abs(twist.linear_m_s) / scene.max_linear_m_s,
        abs(twist.angular_rad_s) / scene.max_angular_rad_s,
    )


def _words(item: VelocityCommand, scene: Scene) -> str:
    twist = item.twist
    linear = abs(twist.linear_m_s) / scene.max_linear_m_s
    if linear >= abs(twist.angular_rad_s) / scene.max_angular_rad_s:
        return f"linear.x = {speed(twist.linear_m_s)}"
    return f"angular.z = {turn(twist.angular_rad_s)}"


def _evidence(recording: Recording, sent: tuple[VelocityCommand, ...], scene: Scene) -> Evidence:
    shown = sent[:: max(1, len(sent) // _MOST_POINTS)]
    x = tuple(recording.since_launch_s(item.time_ns) for item in shown)
    linear, angular = scene.max_linear_m_s, scene.max_angular_rad_s
    return Evidence(
        plots=(
            Plot(
                "Commanded speed", "time since launch (s)", "linear.x (m/s)", x,
                tuple(item.twist.linear_m_s for item in shown), (-linear, linear),
            ),
            Plot(
                "Commanded turn", "time since launch (s)", "angular.z (rad/s)", x,
                tuple(item.twist.angular_rad_s for item in shown), (-angular, angular),
            ),
        )
    )  # fmt: skip
