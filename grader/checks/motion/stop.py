"""Checks of stopping in front of an obstacle, and of staying there."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Plot
from grader.checks.first_seen import until_the_end
from grader.checks.motion.robot_check import RobotParameters
from grader.checks.wording import code, counted
from grader.diagnosis.cause import Cause
from grader.diagnosis.motion.contact import why_touched
from grader.diagnosis.motion.no_motion import why_cut_short, why_not_judged, why_not_moved
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import exited, why_it_exited
from grader.measure.motion.command import commands, scans
from grader.measure.motion.ground import Sight, ahead, edge_m, nearest
from grader.measure.motion.lateness import stolen_s
from grader.measure.motion.quantities import metres, speed
from grader.measure.motion.scan import misreading
from grader.measure.motion.track import REST_M_S, first_rest, over_time, speed_plot, way_m
from grader.recording.model import NS, Recording
from grader.recording.simulated import Scene, Truth
from grader.spec.quantity import Length, PositiveLength, Speed
from grader.spec.unit import format_duration

_EARLY_HINT = "Which range made it stop? Log the value that the callback compares."
_LATE_HINT = (
    "Publish the stop in the scan callback itself, from the newest scan: a sleep, a slow timer or "
    "an old stored value costs way."
)
_OTHER_LIMIT_HINT = (
    "It answered these scans with a command to drive: which number does the callback compare the "
    "front range with? Ranges are in metres, -inf is nearer than the LiDAR can measure, and an "
    "average of several scans comes late."
)
# A callback that sleeps, or a slow timer, answers fewer scans than come.
_ANSWERED = 3


class Stops(RobotParameters):
    """Parameters of motion.stops."""

    distance: PositiveLength = Field(
        description="Distance of the obstacle straight ahead, from the LiDAR."
    )
    early: Length = Field(0.03, description="How much farther away it may stop.")
    late: Length = Field(0.05, description="How much nearer it may stop.")


@check("motion.stops", Subject.RECORDING, Stops)
def stops(recording: Recording, parameters: Stops) -> Finding:
    """The robot stops at the right distance of the obstacle ahead.

    Judged by the true distance from the LiDAR, straight ahead, at the moment the robot came to
    rest after it had moved.
    What the machine took from the run never costs a point.
    """
    wanted_m = parameters.distance
    expected = (
        f"comes to rest with the obstacle ahead at {metres(wanted_m)} (up to "
        f"{metres(parameters.early)} earlier, {metres(parameters.late)} later)"
    )
    cause = why_not_moved(recording)
    if cause is not None or recording.scene is None:
        return (cause or Cause("there is no world", ours=True)).finding(expected)
    truth, scene = recording.truth, recording.scene
    rest = first_rest(truth)
    deeper = why_cut_short(recording) or why_touched(recording)
    if rest is None:
        return (deeper or _never_stopped(recording, scene)).finding(expected)
    step = truth[rest]
    sight = ahead(scene, step)
    if sight is not None and step.contact is None:
        off_m = sight.distance_m - wanted_m
        if -parameters.late <= off_m <= parameters.early:
            return Finding.passed(
                expected,
                f"{code(sight.name)} at {metres(sight.distance_m)}",
                _evidence(recording, scene, rest, parameters),
            )
        if deeper is None and off_m < 0.0:
            deeper = _late(recording, scene, rest, sight, parameters)
    if deeper is not None:
        return deeper.finding(expected)
    return _early(recording, scene, rest, sight, parameters).finding(expected)


def _never_stopped(recording: Recording, scene: Scene) -> Cause:
    truth = recording.truth
    last = truth[-1]
    sight = ahead(scene, last)
    evidence = Evidence(
        moments=(until_the_end(recording, "not at rest when the observation ended"),),
        plots=(speed_plot(recording),),
    )
    if abs(last.linear_m_s) < 1e-3:
        return Cause(
            "the robot has not come to rest: it turns on the spot",
            "To stop, publish a Twist with linear.x = 0.0 and angular.z = 0.0.",
            evidence,
        )
    where = (
        f"{code(sight.name)} is still {metres(sight.distance_m)} ahead"
        if sight
        else ("nothing is ahead any more")
    )
    return Cause(
        f"the robot never stopped: it still drives at {speed(last.linear_m_s)} when the "
        f"observation ends, after {metres(way_m(truth))}; {where}",
        "The last command holds until the next: publish a Twist with linear.x = 0.0 to stop.",
        evidence,
    )


def _early(
    recording: Recording, scene: Scene, rest: int, sight: Sight | None, parameters: Stops
) -> Cause:
    step = recording.truth[rest]
    where = (
        f"{code(sight.name)} still {metres(sight.distance_m)} ahead" if sight else ("nothing ahead")
    )
    seen = f"stopped early, with {where}"
    evidence = _evidence(recording, scene, rest, parameters)
    if sight is not None and _near(sight.distance_m - edge_m(scene), parameters):
        return Cause(
            f"{seen}: {metres(sight.distance_m - edge_m(scene))} from the robot's edge, its radius "
            f"is {metres(scene.radius_m)}",
            "Ranges are measured from the LiDAR: compare them with the distance as they are.",
            evidence,
        )
    misread = misreading(recording, step.time_ns, nearest(scene, step))
    if misread is not None:
        return Cause(f"{seen}: {misread.words}", misread.hint, evidence)
    return Cause(seen, _EARLY_HINT, evidence)


def _near(distance_m: float, parameters: Stops) -> bool:
    return -parameters.late <= distance_m - parameters.distance <= parameters.early


def _late(recording: Recording, scene: Scene, rest: int, sight: Sight, parameters: Stops) -> Cause:
    truth, wanted_m = recording.truth, parameters.distance
    seen = f"stopped late, with {code(sight.name)} at {metres(sight.distance_m)}"
    evidence = _evidence(recording, scene, rest, parameters)
    begin = rest
    while begin and (other := ahead(scene, truth[begin - 1])) is not None:
        if other.distance_m > wanted_m:
            break
        begin -= 1
    crossed, step = truth[begin], truth[rest]
    took_s = (step.time_ns - crossed.time_ns) / NS
    fastest = max((abs(item.linear_m_s) for item in truth[begin : rest + 1]), default=0.0)
    lost_s = stolen_s(recording, crossed.time_ns, step.time_ns)
    missing_m = wanted_m - parameters.late - sight.distance_m
    if lost_s > 0.0 and lost_s * fastest >= missing_m:
        return Cause.to_repeat(
            f"{seen}; the machine took up to {format_duration(lost_s)} from the run meanwhile, "
            "which may explain it"
        )
    told = [
        item.stamp_ns
        for item in scans(recording)
        if crossed.time_ns <= item.stamp_ns <= step.time_ns
    ]
    driving = [item.time_ns for item in commands(recording) if item.twist.linear_m_s > 0.0]
    answered = sum(
        any(begin_ns <= time_ns < end_ns for time_ns in driving)
        for begin_ns, end_ns in pairwise(told)
    )
    within = f"; {counted(len(told), 'scan')} told of it meanwhile" if told else ""
    if answered >= _ANSWERED and answered == len(told) - 1:
        within += ", and commands to drive on followed them"
    return Cause(
        f"{seen}: it came to rest {format_duration(took_s)} after that distance was reached, at up "
        f"to {speed(fastest)}{within}",
        _OTHER_LIMIT_HINT if "commands" in within else _LATE_HINT,
        evidence,
    )


def _evidence(recording: Recording, scene: Scene, rest: int, parameters: Stops) -> Evidence:
    when_s = recording.since_launch_s(recording.truth[rest].time_ns)
    wanted_m = parameters.distance
    band = (wanted_m - parameters.late, wanted_m + parameters.early)
    return Evidence(
        moments=(Moment("the robot came to rest", when_s),),
        plots=(_distance_plot(recording, scene, band), speed_plot(recording)),
    )


def _distance_plot(recording: Recording, scene: Scene, band: tuple[float, float]) -> Plot:
    def distance_m(step: Truth) -> float | None:
        sight = ahead(scene, step)
        return None if sight is None else sight.distance_m

    return over_time(
        recording, "Distance to what is straight ahead", "distance (m)", distance_m, band
    )


class StaysAtRest(RobotParameters):
    """Parameters of motion.stays_at_rest."""

    after: Literal["start", "stop"] = Field(
        "stop",
        description="`start`: it never moves at all. `stop`: once it has stopped it stays there.",
    )
    tolerance: Speed = Field(0.001, description="Speed that still counts as rest.")


@check("motion.stays_at_rest", Subject.RECORDING, StaysAtRest)
def stays_at_rest(recording: Recording, parameters: StaysAtRest) -> Finding:
    """The robot stays at rest.

    Judged by the true speed: with `after: start` in the whole run, with `after: stop` from the
    moment it first came to rest after it had moved (for half a second or more) to the end.
    """
    if parameters.after == "start":
        return _from_start(recording, parameters)
    expected = "stays where it stopped"
    cause = why_not_moved(recording)
    if cause is not None:
        return cause.finding(expected)
    truth = recording.truth
    rest = first_rest(truth)
    if rest is None:
        cause = why_cut_short(recording) or why_touched(recording)
        scene = recording.scene
        if cause is None and scene is not None:
            cause = _never_stopped(recording, scene)
        return (cause or Cause("there is no world", ours=True)).finding(expected)
    again = _moves_from(recording, rest, parameters.tolerance)
    watched_s = (truth[-1].time_ns - truth[rest].time_ns) / NS
    evidence = Evidence(plots=(speed_plot(recording),))
    if again is None:
        return Finding.passed(
            expected, f"at rest for {format_duration(watched_s)}, to the end", evidence
        )
    cause = why_cut_short(recording)
    if cause is not None:
        return cause.finding(expected)
    step = truth[again]
    when_s = recording.since_launch_s(step.time_ns)
    sight = ahead(recording.scene, step) if recording.scene is not None else None
    where = f", with {code(sight.name)} {metres(sight.distance_m)} ahead" if sight else ""
    fastest = max(abs(item.linear_m_s) for item in truth[again:])
    return Finding.failed(
        expected,
        f"{_began(step, ' again')} {when_s:.2f} s after launch{where}: "
        f"{metres(way_m(truth[rest:]))} at up to {speed(fastest)}",
        "Remember that the robot has stopped, or compare the same range in every callback: two "
        "places that publish contradict each other.",
        Evidence(moments=(Moment("set off again", when_s),), plots=evidence.plots),
    )


def _from_start(recording: Recording, parameters: StaysAtRest) -> Finding:
    expected = "does not move at all"
    cause = why_not_judged(recording) or why_no_node(recording)
    if cause is not None:
        return cause.finding(expected)
    truth = recording.truth
    moved = _moves_from(recording, 0, parameters.tolerance)
    ended = exited(recording)
    if moved is None:
        if ended:
            return why_it_exited(recording, ended[0]).finding(expected)
        watched_s = (truth[-1].time_ns - truth[0].time_ns) / NS
        return Finding.passed(expected, f"at rest for {format_duration(watched_s)}, to the end")
    step = truth[moved]
    when_s = recording.since_launch_s(step.time_ns)
    seen = scans(recording)
    sight = ahead(recording.scene, step) if recording.scene is not None else None
    where = f", with {code(sight.name)} {metres(sight.distance_m)} ahead" if sight else ""
    blind = bool(seen) and step.time_ns < seen[0].stamp_ns
    words = ", before the first scan had come" if blind else ""
    hint = (
        "Publish no speed before the first scan: until then the node cannot know what is ahead."
        if blind
        else "Stand still near an obstacle: linear.x = 0.0, not less."
        if step.linear_m_s < 0.0
        else "Compare the range before you drive, in the first callback already."
    )
    return Finding.failed(
        expected,
        f"{_began(step)} {when_s:.2f} s after launch{words}{where}: {metres(way_m(truth))} in all",
        hint,
        Evidence(moments=(Moment("set off", when_s),), plots=(speed_plot(recording),)),
    )


def _began(step: Truth, again: str = "") -> str:
    """What a robot that was at rest began to do."""
    if abs(step.linear_m_s) < REST_M_S:
        return "turned on the spot"
    return f"set off{again}{' backwards' if step.linear_m_s < 0.0 else ''}"


def _moves_from(recording: Recording, begin: int, tolerance_m_s: float) -> int | None:
    """Index of the first step from ``begin`` on in which the robot moves or turns, or None."""
    truth = recording.truth
    for index in range(begin, len(truth)):
        step = truth[index]
        if abs(step.linear_m_s) > tolerance_m_s or abs(step.angular_rad_s) > 0.01:
            return index
    return None
