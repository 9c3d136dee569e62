"""Why the goal pose was not reached: the place, the way, or the heading."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

from grader.checks.finding import Evidence, Moment
from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.motion.contact import why_touched
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.diagnosis.motion.no_motion import why_cut_short
from grader.diagnosis.motion.off_course import why_unsteered
from grader.diagnosis.process.blocked_executor import stuck_callback
from grader.measure.motion.approach import NO_SPEED_M_S, Approach
from grader.measure.motion.detour import WRAP_HINT, away
from grader.measure.motion.lateness import stolen_s
from grader.measure.motion.quantities import metres, point, speed, turn
from grader.measure.motion.track import is_at_rest, turned_rad
from grader.recording.model import NS, Ending, Recording
from grader.recording.simulated import Truth
from grader.spec.unit import format_duration

_WEAVES = 4
# Share of the way: who ends so near the goal knows where it is.
_A_LITTLE = 0.25
# As far from the heading of the goal, in rad, as a tolerance may reasonably leave it.
_A_LITTLE_RAD = 0.15
_STRAIGHT_RAD_S = 0.02
_ASTRAY_RAD = math.radians(30.0)
# So long after it was there a node may see it at the latest: odometry, a timer of 10 Hz, and some
# of the machine's doing.
_SEEN_LATE_NS = 300 * NS // 1000
# How far from the heading that it was sent to a robot rests: the default of angle_tolerance.
_AS_SENT_RAD = 0.06
# An error of angle that a proportional controller has done away with.
_EXACTLY_RAD = 3e-3
_YAW_HINT = (
    "Print yaw while it turns: it has to go with the robot, from -pi to pi. A quaternion in ROS is "
    "x, y, z, w; yaw = atan2(2 (w z + x y), 1 - 2 (y y + z z)), and z alone is no angle."
)


@dataclass(frozen=True)
class GoalMissed(Symptom[Cause]):
    """The robot is not at the goal in the end."""

    run: Approach
    position_m: float

    @property
    def recording(self) -> Recording:
        """Of the run."""
        return self.run.recording

    @property
    def last(self) -> Truth:
        """The end of the way."""
        return self.run.truth[-1]

    @property
    def left_m(self) -> float:
        """Distance from the goal in the end."""
        return self.run.distance_m(self.last)

    @property
    def began_m(self) -> float:
        """Distance from the goal at the start."""
        return self.run.distance_m(self.run.truth[0])

    @property
    def nearest(self) -> Truth:
        """Where the robot was nearest to the goal."""
        return min(self.run.truth, key=self.run.distance_m)

    @property
    def nearest_m(self) -> float:
        """How near that was."""
        return self.run.distance_m(self.nearest)

    @property
    def watched_s(self) -> float:
        """How long the run was observed."""
        return (self.last.time_ns - self.run.truth[0].time_ns) / NS

    @property
    def is_at_rest(self) -> bool:
        """Whether the robot stands in the end."""
        return is_at_rest(self.last)

    @property
    def seen(self) -> str:
        """The symptom in words."""
        left = metres(self.left_m)
        if self.is_at_rest:
            return f"came to rest at {point(self.last.x_m, self.last.y_m)}, {left} from the goal"
        return f"is still {left} from the goal when the observation ends"

    @property
    def moving(self) -> str:
        """How it moves in the end."""
        return f"at {speed(self.last.linear_m_s)} and {turn(self.last.angular_rad_s)}"

    @property
    def evidence(self) -> Evidence:
        """When it was nearest, and the distance over time."""
        when_s = self.recording.since_launch_s(self.nearest.time_ns)
        return Evidence(
            moments=(Moment("nearest to the goal", when_s),), plots=(self.run.distance_plot,)
        )


def why_not_there(run: Approach, position_m: float) -> Cause | None:
    """Why the robot is not at the goal's position in the end; None if it is."""
    symptom = GoalMissed(run, position_m)
    return None if symptom.left_m <= position_m else cause_of(symptom)


@explanation(GoalMissed)
def cut_short(symptom: GoalMissed) -> Cause | None:
    """The process ended, or sent a command that is not finite."""
    return why_cut_short(symptom.recording)


@explanation(GoalMissed)
def touched(symptom: GoalMissed) -> Cause | None:
    """The robot touched an obstacle."""
    return why_touched(symptom.recording)


@explanation(GoalMissed)
def wrong_place(symptom: GoalMissed) -> Cause | None:
    """It drove to another place: x and y swapped, a wrong sign, or counted from its start."""
    found = _wrong_place(symptom.run, symptom.position_m) if symptom.is_at_rest else None
    return found and Cause(f"{symptom.seen}: {found[0]}", found[1], symptom.evidence)


@explanation(GoalMissed)
def drove_on(symptom: GoalMissed) -> Cause | None:
    """It was at the goal, drove on, and stopped elsewhere."""
    if not symptom.is_at_rest or symptom.nearest_m > symptom.position_m:
        return None
    return Cause(
        f"{symptom.seen}: it had been there, {metres(symptom.nearest_m)} near, and drove on",
        "Compare the distance in every callback, and stop where it is small.",
        symptom.evidence,
    )


@explanation(GoalMissed)
def stopped_too_early(symptom: GoalMissed) -> Cause | None:
    """It stopped a little before the goal: another tolerance, or the wrong distance."""
    if not symptom.is_at_rest or symptom.left_m > _A_LITTLE * symptom.began_m:
        return None
    return Cause(
        f"{symptom.seen}: it ended a little before it",
        "Compare the distance, math.hypot(dx, dy) in metres, with the tolerance as it is "
        "now asked for, and drive on until it is smaller.",
        symptom.evidence,
    )


@explanation(GoalMissed)
def stopped_elsewhere(symptom: GoalMissed) -> Cause | None:
    """It stopped somewhere else."""
    if not symptom.is_at_rest:
        return None
    return Cause(
        symptom.seen,
        "Print the goal that your node reads. The distance is "
        "math.hypot(goal's x - x, goal's y - y).",
        symptom.evidence,
    )


@explanation(GoalMissed)
def no_cpu_time(symptom: GoalMissed) -> Cause | None:
    """The machine gave the run too little CPU time; an error, and never a lost point."""
    recording, truth = symptom.recording, symptom.run.truth
    lost_s = stolen_s(recording, truth[0].time_ns, truth[-1].time_ns)
    if lost_s <= 0.25 * symptom.watched_s or recording.ending is not Ending.TIMEOUT:
        return None
    return Cause.to_repeat(
        f"{symptom.seen}; the machine took up to {format_duration(lost_s)} of "
        f"{format_duration(symptom.watched_s)} from the run"
    )


@explanation(GoalMissed)
def unsteered(symptom: GoalMissed) -> Cause | None:
    """No command came for a long time while the robot moved."""
    cause = why_unsteered(symptom.recording)
    return cause and cause.after(symptom.seen)


@explanation(GoalMissed)
def loop_in_a_callback(symptom: GoalMissed) -> Cause | None:
    """A callback does not return: its loop never sees newer odometry."""
    stuck = stuck_callback(symptom.recording)
    if stuck is None:
        return None
    return Cause(
        f"{symptom.seen}, {symptom.moving}: a callback was at {stuck.file}:{stuck.line} when it "
        "was interrupted",
        "A loop in a callback never sees newer odometry, because the next message waits for "
        "its end: compute one command for each, publish it and return.",
        replace(symptom.evidence, places=(stuck,)),
    )


@explanation(GoalMissed)
def yaw_misread(symptom: GoalMissed) -> Cause | None:
    """The yaw is computed wrongly from the quaternion."""
    misread = misread_yaw(symptom.run, symptom.position_m)
    return Cause(f"{symptom.seen}: {misread}", misread.hint, symptom.evidence) if misread else None


@explanation(GoalMissed)
def angle_not_wrapped(symptom: GoalMissed) -> Cause | None:
    """It turns the long way round: the error of angle is not wrapped to -pi .. pi."""
    run = symptom.run
    far = [step for step in run.truth if run.distance_m(step) > symptom.position_m]
    detours = list(away(far, run.bearing_error_rad, _ASTRAY_RAD, "the goal"))
    turns = abs(turned_rad(run.truth)) / math.tau
    if not detours and turns < 1.5:
        return None
    times = "once" if len(detours) == 1 else f"{len(detours)} times"
    turned = (
        f"on its way it turned away from the goal through half a turn, {times}"
        if detours
        else f"it turned {turns:.1f} times around"
    )
    return Cause(
        f"{symptom.seen}: {turned}",
        "Print yaw, the error and the command while it turns. Yaw goes with the robot, from "
        f"-pi to pi; the error is atan2(dy, dx) - yaw. {WRAP_HINT}",
        symptom.evidence,
    )


@explanation(GoalMissed)
def never_stops(symptom: GoalMissed) -> Cause | None:
    """It was at the goal, and drives on."""
    if symptom.nearest_m > symptom.position_m:
        return None
    return Cause(
        f"{symptom.seen}: it had been there, {metres(symptom.nearest_m)} near, and drove on "
        f"{symptom.moving}",
        "Stop where the distance is below your tolerance: publish linear.x = 0.0.",
        symptom.evidence,
    )


def _farther(symptom: GoalMissed) -> str:
    return f"{symptom.seen}, farther than at its start ({metres(symptom.began_m)})"


@explanation(GoalMissed)
def drives_backwards(symptom: GoalMissed) -> Cause | None:
    """It drives backwards, away from the goal."""
    if symptom.left_m <= symptom.began_m or symptom.last.linear_m_s >= 0.0:
        return None
    return Cause(
        f"{_farther(symptom)}: it drives backwards, {symptom.moving}",
        "linear.x is negative: it is a gain times the distance math.hypot(dx, dy), which never "
        "is, and not times dx. Turn towards the goal, also where dx is negative.",
        symptom.evidence,
    )


@explanation(GoalMissed)
def keeps_the_heading_of_the_goal(symptom: GoalMissed) -> Cause | None:
    """On the way it already keeps the heading that it is to have at the goal."""
    if symptom.left_m <= symptom.began_m or not _keeps_the_heading(symptom.run):
        return None
    return Cause(
        f"{_farther(symptom)}: it has turned to the heading "
        f"that it is to have at the goal, and drives that way, {symptom.moving}",
        "On the way the error is the direction to the goal, math.atan2(dy, dx) - yaw; only at "
        "the goal it is the goal's heading - yaw.",
        symptom.evidence,
    )


@explanation(GoalMissed)
def drives_away(symptom: GoalMissed) -> Cause | None:
    """It drives away from the goal: atan(dy / dx), or x and y exchanged in atan2()."""
    if symptom.left_m <= symptom.began_m:
        return None
    return Cause(
        f"{_farther(symptom)}, {symptom.moving}",
        "Print the direction of the goal, yaw and the command while it drives. The direction "
        "changes with the position: it is atan2(dy, dx), dy first, with dx = goal's x - x, and "
        "not atan(dy / dx). A positive error turns left.",
        symptom.evidence,
    )


@explanation(GoalMissed)
def weaves(symptom: GoalMissed) -> Cause | None:
    """It weaves from side to side: the angular gain is too large."""
    if not _weaves(symptom.run):
        return None
    return Cause(
        f"{symptom.seen}: it weaves from side to side, {symptom.moving}",
        "The angular gain is too large for the delay of odometry: make it smaller.",
        symptom.evidence,
    )


@explanation(GoalMissed, general=True)
def too_slow(symptom: GoalMissed) -> Cause:
    """It is on its way, but too slow."""
    return Cause(
        f"{symptom.seen}, {symptom.moving}, after {format_duration(symptom.watched_s)}",
        "If it is on its way, it is too slow: a larger gain, within the limits of the robot.",
        symptom.evidence,
    )


def _keeps_the_heading(run: Approach) -> bool:
    """Whether it has turned to the heading of the goal, and drives on with it."""
    last, first = run.truth[-1], run.truth[0]
    return (
        _drives_straight(last)
        and abs(run.heading_error_rad(last)) < _EXACTLY_RAD
        and abs(run.heading_error_rad(first)) > _A_LITTLE_RAD
    )


def _drives_straight(step: Truth) -> bool:
    return step.linear_m_s > NO_SPEED_M_S and abs(step.angular_rad_s) < _STRAIGHT_RAD_S


def _weaves(run: Approach) -> bool:
    """Whether the turn changes its sense again and again, with some force."""
    left = [step.angular_rad_s > 0.0 for step in run.truth if abs(step.angular_rad_s) > 0.3]
    return sum(a != b for a, b in pairwise(left)) >= _WEAVES


def _wrong_place(run: Approach, position_m: float) -> tuple[str, str] | None:
    """A classic place to go to instead of the goal."""
    goal, last, first = run.goal, run.truth[-1], run.truth[0]
    cos, sin = math.cos(first.yaw_rad), math.sin(first.yaw_rad)
    frame = (
        "that is the goal counted from where the robot started",
        "The goal is in the frame of odometry: subtract the position that odometry reports.",
    )
    swapped = "x and y are swapped", "The goal's x belongs to position.x; atan2 takes y first."
    sign = "Look at the signs: dx = goal's x - x, dy = goal's y - y."
    places: tuple[tuple[float, float, tuple[str, str]], ...] = (
        (first.x_m + goal.x_m, first.y_m + goal.y_m, frame),
        (
            first.x_m + cos * goal.x_m - sin * goal.y_m,
            first.y_m + sin * goal.x_m + cos * goal.y_m,
            frame,
        ),
        (goal.y_m, goal.x_m, swapped),
        (goal.x_m, -goal.y_m, ("that is the goal with the sign of y changed", sign)),
        (-goal.x_m, goal.y_m, ("that is the goal with the sign of x changed", sign)),
        (-goal.x_m, -goal.y_m, ("that is the goal with both signs changed", sign)),
    )
    for x_m, y_m, words in places:
        if math.hypot(goal.x_m - x_m, goal.y_m - y_m) > 2.0 * position_m and (
            math.hypot(last.x_m - x_m, last.y_m - y_m) <= position_m
        ):
            return words
    pushed = next((item for item in run.recording.incidents if item.kind == "pushed"), None)
    if pushed is None:
        return None
    when_s = run.recording.since_launch_s(pushed.time_ns)
    return (
        f"it was pushed {when_s:.2f} s after launch, and what it commanded since leads elsewhere",
        "Compute every command from the newest odometry: what was commanded before does not tell "
        "where the robot is.",
    )
