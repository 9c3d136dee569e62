"""Checks of stopping in front of an obstacle, of staying there, and of touching nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile
from typing import Literal

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.robot_check import RobotParameters, moved_in
from grader.checks.need import OfSimulator, SimulatedRobot
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.contact import why_touched
from grader.diagnosis.motion.no_motion import why_cut_short, why_not_judged, why_not_moved
from grader.diagnosis.motion.off_course import why_interrupted
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import exited, why_it_exited
from grader.findings.finding import Evidence, Finding, Table, evidence_at, until_the_end
from grader.findings.words import counted, metres, speed
from grader.measure.motion.command import commands, scans, stolen_s
from grader.measure.motion.ground import Sight, ahead
from grader.measure.motion.scan import front, misreading
from grader.measure.motion.track import (
    REST_M_S,
    first_rest,
    gone_ahead_m,
    index_at,
    is_at_rest,
    over_time,
    speed_plot,
    way_m,
)
from grader.recording.model import NS, Recording
from grader.recording.simulated import Scene, Truth
from grader.spec.quantity import Length, PositiveLength, Speed
from grader.spec.unit import format_duration

_SCANS = 6


class Stops(RobotParameters):
    """Parameters of motion.stops."""

    needs = (SimulatedRobot(), OfSimulator("map"))

    distance: PositiveLength = Field(
        description="Distance of the obstacle straight ahead, from the LiDAR."
    )
    early: Length = Field(0.03, description="How much farther away the robot may stop.")
    late: Length = Field(0.05, description="How much nearer the robot may stop.")

    def _asked(self) -> str:
        return (
            f"comes to rest with the obstacle ahead at {metres(self.distance)} (up to "
            f"{metres(self.early)} earlier, {metres(self.late)} later)"
        )


@check("motion.stops", Subject.RECORDING, Stops)
def stops(recording: Recording, parameters: Stops) -> Finding:
    """The robot stops at the right distance from the obstacle ahead.

    Judged by the true distance from the LiDAR, straight ahead, at the moment the robot came to rest
    after it had moved. Delays of the machine cost no points.
    """
    scene, wanted_m = moved_in(recording), parameters.distance
    rest = first_rest(recording.truth)
    deeper = why_interrupted(recording)
    if rest is None:
        return deeper or _never_stopped(recording)
    step = recording.truth[rest]
    sight = ahead(scene, step)
    evidence = _evidence(recording, scene, rest, parameters)
    off_m = None if sight is None or step.contact else sight.distance_m - wanted_m
    if sight is not None and off_m is not None and -parameters.late <= off_m <= parameters.early:
        seen = f"{sight.name} at {metres(sight.distance_m)}"
        return Finding.as_asked(seen, evidence)
    stop_if(deeper)
    if sight is not None and off_m is not None and off_m < 0.0:
        return _late(recording, scene, rest, sight, parameters)
    where = f"{sight.name} still {metres(sight.distance_m)} ahead" if sight else "nothing ahead"
    seen = f"stopped early, with {where}"
    if gone_ahead_m(recording.truth[: rest + 1]) < 0.0:
        return mistaken("drove_backwards", f"{seen}: it drove backwards", evidence)
    misread = misreading(recording, step)
    if misread:
        return mistaken("misread_scan", f"{seen}: {misread.words}", evidence, hint=misread.hint)
    return mistaken("stopped_early", seen, evidence)


def _never_stopped(recording: Recording) -> Finding:
    last = recording.truth[-1]
    sight = ahead(recording.scene, last)
    where = (
        f"{sight.name} is still {metres(sight.distance_m)} ahead"
        if sight
        else "nothing is ahead any more"
    )
    return mistaken(
        "never_stopped",
        "the robot has not come to rest: it turns on the spot"
        if abs(last.linear_m_s) < REST_M_S
        else f"the robot never stopped: it still drives at {speed(last.linear_m_s)} when the "
        f"observation ends, after {metres(way_m(recording.truth))}; {where}",
        Evidence(
            moments=(until_the_end(recording, "not at rest when the observation ended"),),
            plots=(speed_plot(recording),),
        ),
    )


def _late(
    recording: Recording, scene: Scene, rest: int, sight: Sight, parameters: Stops
) -> Finding:
    truth, wanted_m = recording.truth, parameters.distance
    seen = f"stopped late, with {sight.name} at {metres(sight.distance_m)}"
    begin = rest
    while begin and (other := ahead(scene, truth[begin - 1])) is not None:
        if other.distance_m > wanted_m:
            break
        begin -= 1
    begin_ns, end_ns = truth[begin].time_ns, truth[rest].time_ns
    fastest = max((abs(item.linear_m_s) for item in truth[begin : rest + 1]), default=0.0)
    lost_s = stolen_s(recording, begin_ns, end_ns)
    missing_m = wanted_m - parameters.late - sight.distance_m
    if lost_s > 0.0 and lost_s * fastest >= missing_m:
        return Finding.held_up(seen, lost_s)
    shown = [one.stamp_ns for one in scans(recording) if begin_ns <= one.stamp_ns <= end_ns]
    within = f"; {counted(len(shown), 'scan')} came meanwhile" if shown else ""
    return mistaken(
        "stopped_late",
        f"{seen}: it drove on for {format_duration((end_ns - begin_ns) / NS)} below "
        f"{metres(wanted_m)}, at up to {speed(fastest)}{within}",
        _evidence(recording, scene, rest, parameters),
    )


def _evidence(recording: Recording, scene: Scene, rest: int, parameters: Stops) -> Evidence:
    rest_ns, wanted_m = recording.truth[rest].time_ns, parameters.distance
    band = (wanted_m - parameters.late, wanted_m + parameters.early)

    def distance_m(step: Truth) -> float | None:
        sight = ahead(scene, step)
        return None if sight is None else sight.distance_m

    title = "Distance to what is straight ahead"
    distance_plot = over_time(recording, title, "distance (m)", distance_m, band)
    still = takewhile(is_at_rest, recording.truth[rest:])
    judged = [recording.since_launch_s(step.time_ns) for step in still]
    distance_plot = replace(distance_plot, judged=(judged[0], judged[-1]))
    plots = distance_plot, speed_plot(recording)
    found = evidence_at(recording, "the robot came to rest", rest_ns, *plots)
    return replace(found, tables=tuple(_table(recording, scene, rest)))


def _table(recording: Recording, scene: Scene, rest: int) -> Iterator[Table]:
    """The last scans before the robot came to rest, with the commands that followed."""
    truth, rest_ns = recording.truth, recording.truth[rest].time_ns
    heard = [scan for scan in scans(recording) if scan.stamp_ns <= rest_ns][-_SCANS:]
    ends_ns = [*(scan.stamp_ns for scan in heard[1:]), rest_ns]
    rows = []
    for scan, end_ns in zip(heard, ends_ns, strict=bool(heard)):
        sent = [one for one in commands(recording) if scan.stamp_ns <= one.time_ns < end_ns]
        sight = ahead(scene, truth[index_at(truth, scan.stamp_ns)])
        measured = front(recording, scan)
        rows.append(
            (
                f"{recording.since_launch_s(scan.stamp_ns):.2f} s",
                "none" if measured is None else f"{measured:.3f} m",
                ", ".join(dict.fromkeys(speed(one.twist.linear_m_s) for one in sent)) or "none",
                "nothing ahead" if sight is None else f"{sight.distance_m:.3f} m",
            )
        )
    header = ("time", "beam ahead", "linear.x sent then", "true distance")
    if rows:
        yield Table("The last scans before it came to rest", header, tuple(rows))


class StaysAtRest(RobotParameters):
    """Parameters of motion.stays_at_rest."""

    after: Literal["start", "stop"] = Field(
        "stop",
        description="`start`: the robot never moves. `stop`: after it has stopped, it stays there.",
    )
    tolerance: Speed = Field(0.001, description="Speed that still counts as rest.")

    def _asked(self) -> str:
        return "does not move at all" if self.after == "start" else "stays where it stopped"


@check("motion.stays_at_rest", Subject.RECORDING, StaysAtRest)
def stays_at_rest(recording: Recording, parameters: StaysAtRest) -> Finding:
    """The robot stays at rest.

    Judged by the true speed: with `after: start` in the whole run, with `after: stop` from the
    moment it first came to rest after it had moved (for half a second or more) to the end.
    """
    is_start = parameters.after == "start"
    if is_start:
        stop_if(why_not_judged(recording) or why_no_node(recording))
    else:
        stop_if(why_not_moved(recording))
    truth = recording.truth
    rest = 0 if is_start else first_rest(truth)
    if rest is None:
        return why_interrupted(recording) or _never_stopped(recording)
    moved = next((step for step in truth[rest:] if _moves(step, parameters.tolerance)), None)
    if moved is None:
        if is_start and (ended := exited(recording)):
            return why_it_exited(recording, ended[0])
        watched = format_duration((truth[-1].time_ns - truth[rest].time_ns) / NS)
        evidence = Evidence(plots=() if is_start else (speed_plot(recording),))
        seen = f"at rest for {watched}, to the end"
        return Finding.as_asked(seen, evidence)
    stop_if(None if is_start else why_cut_short(recording))
    heard = scans(recording)
    is_blind = is_start and bool(heard) and moved.time_ns < heard[0].stamp_ns
    return _set_off(recording, truth[rest:], moved, is_blind, is_start)


def _moves(step: Truth, tolerance_m_s: float) -> bool:
    return abs(step.linear_m_s) > tolerance_m_s or abs(step.angular_rad_s) > 0.01


def _set_off(
    recording: Recording, truth: tuple[Truth, ...], step: Truth, is_blind: bool, is_start: bool
) -> Finding:
    """How a robot that was at rest began to move."""
    when_s = recording.since_launch_s(step.time_ns)
    sight = ahead(recording.scene, step)
    words = "set off" if is_start else "set off again"
    if abs(step.linear_m_s) < REST_M_S:
        words = "turned on the spot"
    elif step.linear_m_s < 0.0:
        words += " backwards"
    words += f" {when_s:.2f} s after launch"
    words += ", before the first scan had come" if is_blind else ""
    words += f", with {sight.name} {metres(sight.distance_m)} ahead" if sight else ""
    fastest = max(abs(item.linear_m_s) for item in truth)
    mistake = "blind_start" if is_blind else "set_off" if is_start else "set_off_again"
    return mistaken(
        mistake,
        f"{words}: {metres(way_m(truth))} in all, at up to {speed(fastest)}",
        evidence_at(recording, "the robot set off", step.time_ns, speed_plot(recording)),
    )


class NoContact(RobotParameters):
    """Parameters of motion.no_contact."""

    needs = (SimulatedRobot(), OfSimulator("contact"))

    asks = "touches nothing"


@check("motion.no_contact", Subject.RECORDING, NoContact)
def no_contact(recording: Recording, parameters: NoContact) -> Finding:
    """The robot touches nothing.

    Judged by the simulator. An obstacle that drives into a robot at rest does not count. A robot
    that never moved does not pass.
    """
    touched = why_touched(recording)
    if touched is not None:
        cause = why_cut_short(recording)
        return cause.after(touched.observed) if cause else touched
    stop_if(why_not_moved(recording))
    way, evidence = metres(way_m(recording.truth)), Evidence(plots=(speed_plot(recording),))
    return Finding.as_asked(f"no contact on a path of {way}", evidence)
