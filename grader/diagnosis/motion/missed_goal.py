"""Why the goal was not reached: its position, or its heading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import dropwhile, takewhile

from grader.diagnosis.explanation import Symptom, cause_of, explanation, remedy
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.diagnosis.motion.off_course import why_off_course
from grader.diagnosis.process.not_called import at_its_place
from grader.diagnosis.process.standing import stuck
from grader.findings.finding import Evidence, Finding, evidence_at, until_the_end
from grader.findings.words import degrees, metres, point, speed, turn
from grader.measure.motion.approach import Approach, long_turns
from grader.measure.motion.command import stolen_s
from grader.measure.motion.track import is_at_rest, turned_rad
from grader.recording.model import NS, Ending, Kind, Owner
from grader.recording.simulated import Truth
from grader.spec.unit import format_duration

# A turn away from the goal is one by more than this.
_ASTRAY_RAD = math.radians(30.0)
# No way to a goal needs so many full turns.
_MANY_TURNS = 1.5
# Share of the run that the machine may take from it.
_STARVED = 0.25
# What tells a program what is around the robot, and not where it is.
_SIGHTS = {
    *(
        f"sensor_msgs/msg/{name}"
        for name in ("Image", "CompressedImage", "CameraInfo", "LaserScan")
    ),
    "visualization_msgs/msg/MarkerArray",
}


@dataclass(frozen=True)
class GoalMissed(Symptom[Finding]):
    """The robot is not at the goal at the end."""

    run: Approach
    position_m: float

    @property
    def last(self) -> Truth:
        """The end of the way."""
        return self.run.truth[-1]

    def is_far(self, step: Truth) -> bool:
        """Whether the robot is not at the goal's position."""
        return self.run.distance_m(step) > self.position_m

    @cached_property
    def way(self) -> tuple[Truth, ...]:
        """Every step since it was away from the goal: it may have started there."""
        return tuple(dropwhile(lambda step: not self.is_far(step), self.run.truth))

    @property
    def nearest(self) -> Truth:
        """Where the robot was nearest to the goal on its way."""
        return min(self.way, key=self.run.distance_m)

    @property
    def is_at_rest(self) -> bool:
        """Whether the robot stands in the end."""
        return is_at_rest(self.last)

    @property
    def watched_s(self) -> float:
        """How long the run was observed."""
        return (self.last.time_ns - self.run.truth[0].time_ns) / NS

    @property
    def seen(self) -> str:
        """The symptom in words."""
        left = metres(self.run.distance_m(self.last))
        if self.is_at_rest:
            return f"came to rest at {point(self.last.x_m, self.last.y_m)}, {left} from the goal"
        return (
            f"is still {left} from the goal when the observation ends, at "
            f"{speed(self.last.linear_m_s)} and {turn(self.last.angular_rad_s)}"
        )

    @property
    def drove_on(self) -> str:
        """That it was at the goal on its way, in words; empty if it was not."""
        if self.is_far(self.nearest):
            return ""
        return f": it came as near as {metres(self.run.distance_m(self.nearest))}, and drove on"

    def cause(self, words: str, hint: str) -> Finding:
        """The symptom in words, followed by more, with the distance over time."""
        evidence = evidence_at(
            self.run.recording, "nearest to the goal", self.nearest.time_ns, self.run.distance_plot
        )
        return Finding(f"{self.seen}{words}", hint, evidence)


@dataclass(frozen=True)
class HeadingMissed(Symptom[Finding], concept="angles"):
    """The robot is at the goal with the wrong heading."""

    run: Approach
    position_m: float
    heading_rad: float

    @property
    def last(self) -> Truth:
        """The end of the way."""
        return self.run.truth[-1]

    def cause(self, words: str, hint: str) -> Finding:
        """The symptom in words, followed by more, with the heading over time."""
        plots = (self.run.heading_plot,)
        return Finding(
            f"is at the goal's position, but faces {degrees(self.last.yaw_rad)} instead of "
            f"{degrees(self.run.goal.yaw_rad)}{words}",
            hint,
            Evidence(moments=(until_the_end(self.run.recording),), plots=plots),
        )


def why_not_there(run: Approach, position_m: float) -> Finding | None:
    """Why the robot is not at the goal's position in the end; None if it is."""
    symptom = GoalMissed(run, position_m)
    return None if run.distance_m(symptom.last) <= position_m else cause_of(symptom)


def why_not_aligned(run: Approach, position_m: float, heading_rad: float) -> Finding | None:
    """Why the robot does not look as the goal does in the end; None if it does."""
    if abs(run.heading_error_rad(run.truth[-1])) <= heading_rad:
        return None
    return cause_of(HeadingMissed(run, position_m, heading_rad))


@explanation(GoalMissed)
def no_cpu_time(symptom: GoalMissed) -> Finding | None:
    """The machine gave the run too little CPU time; this is an error and costs no points."""
    recording, truth = symptom.run.recording, symptom.run.truth
    lost_s = stolen_s(recording, truth[0].time_ns, truth[-1].time_ns)
    is_starved = lost_s > _STARVED * symptom.watched_s
    if symptom.is_at_rest or not is_starved or recording.ending is not Ending.TIMEOUT:
        return None
    return Finding.held_up(symptom.seen, lost_s)


@explanation(GoalMissed, HeadingMissed)
def off_course(symptom: GoalMissed | HeadingMissed) -> Finding | None:
    """The process ended, the robot touched something, or no command came for a long time."""
    return why_off_course(symptom.run.recording)


@explanation(GoalMissed, concept="executors")
def loop_in_a_callback(symptom: GoalMissed) -> Finding | None:
    """A callback does not return: its loop never sees newer odometry."""
    if symptom.is_at_rest:
        return None
    stand = stuck(symptom.run.recording)
    if stand is None:
        return None
    return at_its_place(symptom.cause("", ""), symptom.seen, stand)


@explanation(GoalMissed)
def not_told_where(symptom: GoalMissed) -> Finding | None:
    """It steers by a camera or a LiDAR alone: nothing tells it where it and the goal are."""
    recording = symptom.run.recording
    heard = {one.topic for one in recording.student_endpoints(Kind.SUBSCRIPTION)}
    types = {
        one.type
        for one in recording.endpoints
        if one.kind is Kind.PUBLISHER and one.owner is not Owner.STUDENT and one.topic in heard
    }
    if not types or not types <= _SIGHTS:
        return None
    return symptom.cause(symptom.drove_on, remedy("not_told_where"))


@explanation(GoalMissed)
def still_driving(symptom: GoalMissed) -> Finding | None:
    """A bag ends while the robot drives."""
    if symptom.is_at_rest or symptom.run.recording.bag is None:
        return None
    return symptom.cause(symptom.drove_on, remedy("still_driving"))


@explanation(GoalMissed)
def wrong_place(symptom: GoalMissed) -> Finding | None:
    """It drove to another place: x and y swapped, a wrong sign, or counted from its start."""
    goal, last, first = symptom.run.goal, symptom.last, symptom.run.truth[0]
    if not symptom.is_at_rest:
        return None
    from_start = "the goal measured from where the robot started"
    places = (
        (first.x_m + goal.x_m, first.y_m + goal.y_m, from_start, "from_the_start"),
        (goal.y_m, goal.x_m, "the goal with x and y swapped", "swapped"),
        (goal.x_m, -goal.y_m, "the goal with the sign of y changed", "wrong_sign"),
        (-goal.x_m, goal.y_m, "the goal with the sign of x changed", "wrong_sign"),
    )
    for x_m, y_m, words, mistake in places:
        is_another = math.hypot(goal.x_m - x_m, goal.y_m - y_m) > 2.0 * symptom.position_m
        is_there = math.hypot(last.x_m - x_m, last.y_m - y_m) <= symptom.position_m
        if is_another and is_there:
            return symptom.cause(f": that is {words}", remedy(mistake))
    return None


@explanation(GoalMissed, concept="angles")
def yaw_misread(symptom: GoalMissed) -> Finding | None:
    """The yaw is computed wrongly from the quaternion."""
    misread = None if symptom.is_at_rest else misread_yaw(symptom.run, symptom.position_m)
    return symptom.cause(f": {misread}", remedy(misread.mistake)) if misread else None


@explanation(GoalMissed, concept="angles")
def angle_not_wrapped(symptom: GoalMissed) -> Finding | None:
    """It turns the long way: the angle error is not wrapped to -pi .. pi."""
    if symptom.is_at_rest:
        return None
    run = symptom.run
    far = list(takewhile(symptom.is_far, symptom.way))
    detours = list(long_turns(far, run.bearing_error_rad, _ASTRAY_RAD))
    turns = abs(turned_rad(far)) / math.tau
    if detours:
        times = "once" if len(detours) == 1 else f"{len(detours)} times"
        turned = f"on its way it turned away from the goal, the long way round, {times}"
    elif turns >= _MANY_TURNS:
        turned = f"it made {turns:.1f} full turns"
    else:
        return None
    return symptom.cause(f": {turned}", remedy("angle_not_wrapped", remedy=remedy("long_turn")))


@explanation(GoalMissed)
def drove_on(symptom: GoalMissed) -> Finding | None:
    """It was at the goal and drove on."""
    return symptom.cause(symptom.drove_on, remedy("drove_on")) if symptom.drove_on else None


@explanation(GoalMissed)
def stopped_elsewhere(symptom: GoalMissed) -> Finding | None:
    """It stopped before the goal, or somewhere else."""
    if not symptom.is_at_rest:
        return None
    return symptom.cause("", remedy("stopped_elsewhere"))


@explanation(GoalMissed)
def drives_away(symptom: GoalMissed) -> Finding | None:
    """It drives away from the goal: atan(dy / dx), or x and y exchanged in atan2()."""
    first = symptom.run.truth[0]
    began_m = symptom.run.distance_m(first)
    if not symptom.is_far(first) or symptom.run.distance_m(symptom.last) <= began_m:
        return None
    return symptom.cause(f", farther than at the start ({metres(began_m)})", remedy("drives_away"))


@explanation(GoalMissed, general=True)
def too_slow(symptom: GoalMissed) -> Finding:
    """It is on its way, but too slow, or it weaves from side to side."""
    return symptom.cause(f", after {format_duration(symptom.watched_s)}", remedy("too_slow"))


@explanation(HeadingMissed)
def heading_misread(symptom: HeadingMissed) -> Finding | None:
    """The yaw is computed wrongly from the quaternion."""
    misread = misread_yaw(symptom.run, symptom.position_m)
    return symptom.cause(f": {misread}", remedy(misread.mistake)) if misread else None


@explanation(HeadingMissed, general=True)
def stopped_turning(symptom: HeadingMissed) -> Finding:
    """It stopped turning too early or too late, never turned to the heading, or still turns."""
    words, driven = "", symptom.run.driven(math.inf)
    if not is_at_rest(symptom.last):
        words = f" and still turns at {turn(symptom.last.angular_rad_s)} when the observation ends"
    elif driven is not None and abs(turned_rad(symptom.run.truth[driven:])) < symptom.heading_rad:
        words = ": it has not turned since it arrived"
    return symptom.cause(words, remedy("stopped_turning"))
