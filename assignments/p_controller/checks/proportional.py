"""The checks that turn and speed are commanded in proportion to their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from pydantic import Field

from grader.checks.check import Subject, check
from grader.findings.finding import Evidence, Finding, Moment, Plot
from grader.measure.motion.steering import MOST_BEHIND, Sample, answers, fit, LEAST_FIT
from grader.measure.motion.approach import NO_SPEED_M_S, Approach
from grader.measure.motion.command import command_topic
from grader.findings.words import metres, speed
from grader.checks.motion.robot_check import GoalParameters
from grader.findings.finding import evidence_at
from grader.findings.words import counted, percent
from grader.diagnosis.explanation import remedy
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.diagnosis.motion.missed_goal import why_not_there
from grader.diagnosis.motion.no_motion import why_cut_short
from grader.diagnosis.motion.off_course import why_off_course
from grader.diagnosis.no_messages import why_silent
from grader.findings.words import SLEEP
from grader.recording.model import Recording
from grader.spec.quantity import Frequency, PositiveLength, Ratio

from .control_law import LEAST_SAMPLES, Law, LawVerdict, at_the_goal, examine, on_the_way

_MOST_POINTS = 400
# A robot that looks at the goal need not be slower because it turns.
_FACING_RAD = 0.1
# Half a step of commands with two decimals, and what odometry is late.
_ROUNDED_M_S = 0.006
# Of distances that are more alike a root looks like a line.
_LEAST_SPREAD = 1.5
_WHAT = {"position": "the direction of the goal", "align": "the goal's heading"}
_FORMULA = {"position": "atan2(dy, dx) - yaw", "align": "goal_theta - yaw"}


class Proportional(GoalParameters):
    """Parameters of motion.proportional."""

    phase: Literal["position", "align"] = Field(
        description="`position`: on the way, against the direction of the goal. `align`: at the "
        "goal, against its heading."
    )
    position: PositiveLength = Field(
        0.1,
        description="Within this distance of the goal, the first phase does not count: there the "
"direction of the goal changes faster than odometry shows.",
    )
    r2: Ratio = Field(0.9, description="Least coefficient of determination R² of the line.")
    gain_min: Frequency | None = Field(
        None, description="Least gain, in rad/s for each rad: `0.1 Hz` is 0.1 per second."
    )
    gain_max: Frequency | None = Field(None, description="Greatest gain.")

    def _asked(self) -> str:
        limits = [f"R² at least {self.r2:.2g}"]
        gains = [f"at least {self.gain_min:.3g} 1/s"] if self.gain_min is not None else []
        gains += [f"at most {self.gain_max:.3g} 1/s"] if self.gain_max is not None else []
        limits += [f"gain {' and '.join(gains)}"] if gains else []
        error = f"the heading error to {_WHAT[self.phase]}"
        return f"angular.z in proportion to {error} ({', '.join(limits)})"


@check("motion.proportional", Subject.RECORDING, Proportional, concept="angles")
def proportional(recording: Recording, parameters: Proportional) -> Finding:
    """angular.z is proportional to the heading error.

    Judged by every published command, against the error at the newest odometry before it (so that
    the delay of odometry costs nothing), normalised to [-pi, pi]. A line through the origin is
    fitted: its slope is the gain, and R² measures the fit. Commands at a limit (of the robot, or a
    clamp of your own) and the pause near zero within your tolerance do not count.
    """
    phase = parameters.phase
    run = parameters.approach(recording)
    topic = command_topic(recording)
    if not recording.on(topic):
        return why_silent(recording, topic)
    arrival = run.arrival(parameters.position)
    if phase == "align" and arrival is None:
        return why_not_there(run, parameters.position) or Finding("never near the goal")
    scene = recording.scene
    limit_rad_s = scene.max_angular_rad_s if scene is not None else math.inf
    tried = [_samples(run, parameters, behind, limit_rad_s) for behind in range(MOST_BEHIND + 1)]
    verdicts = [examine(samples, limit_rad_s, parameters.r2) for samples in tried]
    good = [index for index, item in enumerate(verdicts) if _is_good(item, parameters)]
    index = max(good, key=lambda i: verdicts[i].r2, default=0)
    verdict, samples = verdicts[index], tried[index]
    begins = run.truth[arrival if phase == "align" and arrival is not None else 0]
    moment = Moment("this phase begins", recording.since_launch_s(begins.time_ns))
    evidence = Evidence(moments=(moment,), plots=(_plot(samples, phase),))
    if good:
        return _judge_gain(verdict, parameters, evidence)
    # One that had hardly an error to correct need not have sent a command for long.
    idle = verdict.law is Law.NOTHING_TO_DO
    deeper = why_cut_short(recording) if idle else why_off_course(recording)
    if deeper is not None and len(samples) < LEAST_SAMPLES:
        return deeper
    if idle:
        return Finding.as_asked(
            f"there was hardly an error to correct, and hardly a turn was commanded "
            f"({counted(len(samples), 'command')})",
            evidence,
        )
    observed, hint = _words(verdict, parameters, len(samples))
    misread = misread_yaw(run, parameters.position)
    if misread is not None:
        observed = f"the commands do not follow the error: {misread}"
        return Finding(observed, remedy(misread.mistake), evidence)
    return Finding(observed, hint, evidence)


class ProportionalSpeed(GoalParameters):
    """Parameters of motion.proportional_speed."""

    r2: Ratio = Field(0.9, description="Least coefficient of determination R² of the line.")

    def _asked(self) -> str:
        return f"linear.x in proportion to the distance from the goal (R² at least {self.r2:.2g})"


@check("motion.proportional_speed", Subject.RECORDING, ProportionalSpeed)
def proportional_speed(recording: Recording, parameters: ProportionalSpeed) -> Finding:
    """linear.x is proportional to the distance.

    Judged by the published commands with which the robot drives while it looks at the goal, since
    the last one of the largest speed: before that a limit, or a gentle start, may hold it back. A
    line through the origin is fitted to them and the distances at the newest odometry before each.
    A limit, a least speed, and less speed while it turns do not count.
    """
    run = parameters.approach(recording)
    limit_m_s = math.inf if recording.scene is None else recording.scene.max_linear_m_s
    tried = [_speeds(run, behind) for behind in range(MOST_BEHIND + 1)]
    if min(map(len, tried)) < LEAST_FIT:
        return Finding.as_asked("too few speeds to tell")
    lines = [fit(samples, limit_m_s) for samples in tried]
    best = max(range(len(lines)), key=lambda index: lines[index].r2)
    line, samples = lines[best], tried[best]
    far, near = max(samples), min(samples)
    plot = Plot(
        "Speed over distance",
        "distance from the goal (m)",
        "linear.x (m/s)",
        tuple(item.error for item in samples),
        tuple(item.command for item in samples),
    )
    if far.error < _LEAST_SPREAD * near.error:
        return Finding.as_asked("the distances hardly differ")
    rounded = all(abs(one.command - line.gain * one.error) <= _ROUNDED_M_S for one in samples)
    if line.r2 >= parameters.r2 or rounded:
        seen = f"gain {line.gain:.3g} 1/s, R² {line.r2:.3f}, {counted(line.used, 'command')}"
        return Finding.as_asked(seen, Evidence(plots=(plot,)))
    return why_off_course(recording) or Finding(
        f"linear.x is {speed(far.command)} at {metres(far.error)}, but {speed(near.command)} at "
        f"{metres(near.error)}: {far.command / far.error:.2g} and "
        f"{near.command / near.error:.2g} times the distance",
        "linear.x = gain * distance, with the same gain all the way, and without a root or a "
        "square: at half the distance half the speed.",
        evidence_at(recording, "the way begins", run.truth[0].time_ns, plot),
    )


def _speeds(run: Approach, behind: int) -> list[Sample]:
    """Speeds with the distances that they answer, since the last one of the largest speed."""
    found = [
        Sample(run.distance_m(item.pose), item.command.twist.linear_m_s)
        for item in answers(run.recording, behind)
        if item.command.twist.linear_m_s > NO_SPEED_M_S
        and abs(run.bearing_error_rad(item.pose)) <= _FACING_RAD
    ]
    most = max((item.command for item in found), default=0.0)
    last = max((index for index, item in enumerate(found) if item.command >= most), default=0)
    return found[last:]


def _is_good(verdict: LawVerdict, parameters: Proportional) -> bool:
    return verdict.law is Law.PROPORTIONAL and verdict.r2 >= parameters.r2 and verdict.gain > 0.0


def _samples(
    run: Approach, parameters: Proportional, behind: int, limit_rad_s: float
) -> list[Sample]:
    known = answers(run.recording, behind)
    if parameters.phase == "position":
        return on_the_way(run, known, parameters.position)
    return at_the_goal(run, known, parameters.position, limit_rad_s)


def _judge_gain(verdict: LawVerdict, parameters: Proportional, evidence: Evidence) -> Finding:
    low, high = parameters.gain_min or 0.0, parameters.gain_max or math.inf
    seen = f"gain {verdict.gain:.3g} 1/s, R² {verdict.r2:.3f}, {counted(verdict.used, 'command')}"
    if low <= verdict.gain <= high:
        return Finding.as_asked(seen, evidence)
    size = "small" if verdict.gain < low else "large"
    hint = "The gain is the factor of the error."
    return Finding(f"{seen}: the gain is too {size}", hint, evidence)


def _words(verdict: LawVerdict, parameters: Proportional, number: int) -> tuple[str, str]:
    """What the commands are instead, and what to try."""
    formula = f"angular.z = gain * error, with the error {_FORMULA[parameters.phase]}"
    wrap = "normalised by atan2(sin(e), cos(e))"
    if verdict.law is Law.TOO_FEW:
        near = f", more than {metres(parameters.position)} from the goal"
        return (
            f"only {counted(number, 'command')} in this phase to judge"
            f"{near if parameters.phase == 'position' else ''}",
            f"Publish {formula}, in every callback.",
        )
    if verdict.law is Law.ZERO:
        return (
            f"all of {counted(number, 'command')} in this phase have angular.z = 0, although there "
            "is an error",
            f"Publish {formula}.",
        )
    if verdict.law is Law.STEPS:
        values = ", ".join(f"{value:.3g}" for value in verdict.values)
        return (
            f"angular.z has only {counted(len(verdict.values), 'size')} ({values} rad/s) whatever "
            "the error is: that is on-off control (bang-bang)",
            f"Publish {formula}.",
        )
    if verdict.law is Law.NOT_NORMALISED:
        return (
            f"{percent(round(verdict.share, 3))} of the commands fit an error that is a full turn "
            f"off: it is not normalised to [-pi, pi] (gain {verdict.gain:.3g} 1/s)",
            f"Publish {formula}, {wrap}.",
        )
    if verdict.law is Law.WRONG_SIGN:
        return (
            f"it turns away from the error: gain {verdict.gain:.3g} 1/s",
            f"Publish {formula}; counter-clockwise is positive (REP-103).",
        )
    return (
        f"the commands do not follow the error: gain {verdict.gain:.3g} 1/s, R² {verdict.r2:.2f}, "
        f"{counted(verdict.used, 'command')}",
        f"Publish {formula}, {wrap}, from the newest odometry, at 10 Hz or more: a {SLEEP} in a "
        "callback lets odometry grow old.",
    )


def _plot(samples: Sequence[Sample], phase: str) -> Plot:
    shown = samples[:: max(1, len(samples) // _MOST_POINTS)]
    return Plot(
        "Command over error",
        f"heading error to {_WHAT[phase]} (rad)",
        "angular.z (rad/s)",
        tuple(item.error for item in shown),
        tuple(item.command for item in shown),
    )
