"""Checks of reaching a goal pose: where the robot ends, when, and by which way."""

from __future__ import annotations

import math

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.robot_check import GoalParameters, RobotParameters, at_the_end
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.missed_goal import why_not_aligned, why_not_there
from grader.diagnosis.motion.no_motion import approach, why_not_moved, why_rejected
from grader.diagnosis.motion.off_course import why_interrupted, why_off_course, why_unsteered
from grader.findings.finding import Evidence, Finding, Plot, evidence_at
from grader.findings.words import degrees, metres, percent, point, speed, turn
from grader.measure.motion.approach import Approach
from grader.measure.motion.command import commands, stolen_s
from grader.measure.motion.track import final_rest, is_at_rest, speed_plot, way_m
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth
from grader.spec.quantity import Angle, Duration, PositiveLength, Ratio
from grader.spec.unit import format_duration

_MOST_POINTS = 400
# What is kept back a little before the robot arrives is missing when it should slow down.
_BRAKING_NS = NS // 2


class Reaches(GoalParameters):
    """Parameters of motion.reaches."""

    position: PositiveLength = Field(description="Largest distance from the goal at the end.")
    heading: Angle | None = Field(
        None, description="Largest heading error; by default the heading does not count."
    )
    at_rest: bool = Field(
        True,
        description="Whether the robot must be at rest there. Say `false` in a window (`before`, "
        "`while`, `to`) in which it may drive on.",
    )

    def _asked(self) -> str:
        return f"{'at rest ' if self.at_rest else ''}within {metres(self.position)} of the goal"

    def asked_of(self, subject: Recording) -> str:
        """With the place of the goal, which may be random."""
        run = approach(subject, self.goal)
        if isinstance(run, Finding):
            return self.asked_for
        expected = self.asked_for.removesuffix("the goal") + point(run.goal.x_m, run.goal.y_m)
        if self.heading is None:
            return expected
        return f"{expected} and {degrees(self.heading)} of the heading {degrees(run.goal.yaw_rad)}"


@check("motion.reaches", Subject.RECORDING, Reaches)
def reaches(recording: Recording, parameters: Reaches) -> Finding:
    """The robot reaches the goal and stays there.

    Judged by the true pose at the end of the run, or of each window of `after`, `before`, `while`
    and `to`: at rest, near the position, and with the heading (a full turn more or less is the
    same heading).
    """
    run, heading = parameters.approach(recording), parameters.heading
    last = run.truth[-1]
    stop_if(why_not_there(run, parameters.position))
    if heading is not None:
        stop_if(why_not_aligned(run, parameters.position, heading))
    if parameters.at_rest and not is_at_rest(last):
        stop_if(why_off_course(recording))
        return _restless(recording, last, "is at the goal, but")
    sent = commands(recording)
    # It stands because the robot refused the last command.
    if parameters.at_rest and sent and not sent[-1].twist.is_finite:
        stop_if(why_rejected(recording))
    seen = f"{metres(run.distance_m(last))} from the goal"
    if heading is not None:
        seen += f", {degrees(abs(run.heading_error_rad(last)))} off its heading"
    return Finding.as_asked(seen, Evidence(plots=(run.distance_plot, run.heading_plot)))


def _restless(recording: Recording, last: Truth, place: str) -> Finding:
    return mistaken(
        "restless",
        f"{place} not at rest when the observation ends: {speed(last.linear_m_s)} and "
        f"{turn(last.angular_rad_s)}",
        at_the_end(recording, "not at rest when the observation ended"),
    )


class Settles(RobotParameters):
    """Parameters of motion.settles."""

    within: Duration = Field(
        description="Longest simulated time from the beginning until the robot rests for good."
    )

    def _asked(self) -> str:
        return f"comes to rest for good within {format_duration(self.within)}"


@check("motion.settles", Subject.RECORDING, Settles)
def settles(recording: Recording, parameters: Settles) -> Finding:
    """The robot comes to rest in time.

    Judged by the true motion, from the beginning of simulated time (when the node is first
    connected) until the robot comes to rest for good. motion.reaches judges where it rests.
    """
    stop_if(why_not_moved(recording))
    truth = recording.truth
    rest = final_rest(truth)
    end = truth[-1] if rest is None else truth[rest]
    took_s = (end.time_ns - truth[0].time_ns) / NS
    seen = "never at rest" if rest is None else f"at rest after {format_duration(took_s)}"
    plot = speed_plot(recording)
    if rest is not None and took_s <= parameters.within:
        return Finding.as_asked(seen, Evidence(plots=(plot,)))
    stop_if(why_interrupted(recording))
    lost_s = stolen_s(recording, truth[0].time_ns, end.time_ns)
    if lost_s > 0.0 and took_s - lost_s <= parameters.within:
        return Finding.held_up(seen, lost_s)
    stop_if(why_unsteered(recording))
    if rest is None:
        return _restless(recording, end, f"after {format_duration(took_s)} it is")
    return mistaken("slow", seen, evidence_at(recording, "at rest", end.time_ns, plot))


class PathLength(GoalParameters):
    """Parameters of motion.path_length."""

    most: Ratio = Field(description="How much longer than the straight line the path may be.")

    def _asked(self) -> str:
        path = f"a path at most {percent(self.most)} longer than the straight line"
        return f"within {metres(self.position)} of the goal, on {path}"


@check("motion.path_length", Subject.RECORDING, PathLength)
def path_length(recording: Recording, parameters: PathLength) -> Finding:
    """The path to the goal is not much longer than the straight line.

    Judged by the true path of the whole run, against the straight line from its start to the
    goal.
    """
    run = parameters.approach(recording)
    straight_m = run.distance_m(run.truth[0])
    if straight_m <= parameters.position:
        start = f"the start is {metres(straight_m)} from the goal"
        return Finding.ours(f"{start}: there is no path to judge")
    stop_if(why_not_there(run, parameters.position))
    gone_m = way_m(run.truth)
    longer = gone_m / straight_m - 1.0
    words = f"{percent(round(longer, 3))} longer" if longer >= 0.0 else "not longer"
    seen = f"a path of {metres(gone_m)} for a straight line of {metres(straight_m)}: {words}"
    evidence = Evidence(plots=(run.distance_plot,))
    too_long_m = gone_m - straight_m * (1.0 + parameters.most)
    if too_long_m <= 0.0:
        return Finding.as_asked(seen, evidence)
    lost_s = stolen_s(recording, run.truth[0].time_ns, run.truth[-1].time_ns)
    fastest_m_s = max(abs(step.linear_m_s) for step in run.truth)
    # What it drives on without a command, it has to come back.
    if lost_s > 0.0 and 2.0 * lost_s * fastest_m_s >= too_long_m:
        return Finding.held_up(seen, lost_s)
    label, farthest = "farthest from the straight line to the goal", _farthest(run)
    shown = evidence_at(recording, label, farthest.time_ns, *evidence.plots)
    return mistaken("long_path", seen, shown)


def _farthest(run: Approach) -> Truth:
    """Where the robot was farthest from the straight line to the goal."""
    first, goal = run.truth[0], run.goal
    dx, dy = goal.x_m - first.x_m, goal.y_m - first.y_m
    return max(
        run.truth, key=lambda step: abs(dx * (step.y_m - first.y_m) - dy * (step.x_m - first.x_m))
    )


class Overshoot(GoalParameters):
    """Parameters of motion.overshoot."""

    most: PositiveLength = Field(
        description="Largest distance that it may drive away again from its nearest point."
    )

    def _asked(self) -> str:
        return f"at most {metres(self.most)} past the goal"


@check("motion.overshoot", Subject.RECORDING, Overshoot)
def overshoot(recording: Recording, parameters: Overshoot) -> Finding:
    """The robot does not go past its goal.

    Judged by the true motion: how much the distance from the goal grows again after the robot has
    come near.
    """
    run = parameters.approach(recording)
    arrival = parameters.arrival(run)
    past_m = _past_m(run, arrival)
    worst_ns = max(past_m, key=past_m.__getitem__)
    worst_m = past_m[worst_ns]
    seen, plot = f"{metres(worst_m)} past the goal", _plot(run, past_m, worst_ns, parameters.most)
    if worst_m <= parameters.most:
        return Finding.as_asked(seen, Evidence(plots=(plot,)))
    since_ns = run.truth[arrival].time_ns - _BRAKING_NS
    lost_s = stolen_s(recording, since_ns, worst_ns)
    steps = [step for step in run.truth if since_ns <= step.time_ns <= worst_ns]
    fastest_m_s = max(abs(step.linear_m_s) for step in steps)
    # The robot keeps its last command for as long as the machine keeps the next one back.
    if lost_s * fastest_m_s >= worst_m - parameters.most:
        return Finding.held_up(seen, lost_s)
    shown = evidence_at(recording, seen, worst_ns, plot)
    return why_off_course(recording) or mistaken("overshoots", seen, shown)


def _past_m(run: Approach, arrival: int) -> dict[int, float]:
    """How far the distance has grown again since it was least, by time, from the arrival on."""
    past_m = {}
    least_m = math.inf
    for step in run.truth[arrival:]:
        distance_m = run.distance_m(step)
        least_m = min(least_m, distance_m)
        past_m[step.time_ns] = distance_m - least_m
    return past_m


def _plot(run: Approach, past_m: dict[int, float], worst_ns: int, most_m: float) -> Plot:
    """How far it is past the goal by time, with the largest that is allowed and that is reached."""
    stride = max(1, len(past_m) // _MOST_POINTS)
    times = sorted({*list(past_m)[::stride], worst_ns})
    # In the unit of the text.
    unit, factor = ("cm", 100.0) if past_m[worst_ns] < 0.1 else ("m", 1.0)
    x = tuple(map(run.recording.since_launch_s, times))
    y = tuple(past_m[time_ns] * factor for time_ns in times)
    label, band = f"past the goal ({unit})", (-math.inf, most_m * factor)
    return Plot(f"How far {label}", "time since launch (s)", label, x, y, band)
