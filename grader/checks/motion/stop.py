"""Checks of stopping in front of an obstacle, of staying there, and of touching nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import takewhile
from typing import Literal

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.robot_check import RobotParameters, at_the_end, moved_in
from grader.checks.need import OfSimulator, SimulatedRobot
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.contact import why_touched
from grader.diagnosis.motion.no_motion import why_cut_short, why_not_judged, why_not_moved
from grader.diagnosis.motion.off_course import why_interrupted
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.process_exit import exited, why_it_exited
from grader.findings.finding import Evidence, Finding, Table, evidence_at
from grader.findings.words import counted, metres, speed
from grader.measure.motion.command import commands, scans, stolen_s
from grader.measure.motion.ground import Sight, ahead, ahead_m
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
# What `tolerance` is for driving, this is for turning.
_TURNS_RAD_S = 0.01


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
    scene, truth = moved_in(recording), recording.truth
    rest = first_rest(truth)
    deeper = why_interrupted(recording)
    if rest is None:
        return deeper or _never_stopped(recording)
    step = truth[rest]
    sight = ahead(scene, step)
    evidence = _evidence(recording, scene, rest, parameters)
    if sight is not None and not step.contact:
        off_m = sight.distance_m - parameters.distance
        if -parameters.late <= off_m <= parameters.early:
            return Finding.as_asked(f"{sight.name} at {metres(sight.distance_m)}", evidence)
        if off_m < 0.0:
            return deeper or _late(recording, rest, sight, parameters, evidence)
    return deeper or _early(recording, rest, sight, evidence)


def _never_stopped(recording: Recording) -> Finding:
    last = recording.truth[-1]
    if abs(last.linear_m_s) < REST_M_S:
        seen = "the robot has not come to rest: it turns on the spot"
    else:
        sight = ahead(recording.scene, last)
        ahead_of_it = "nothing is ahead any more"
        if sight is not None:
            ahead_of_it = f"{sight.name} is still {metres(sight.distance_m)} ahead"
        seen = (
            f"the robot never stopped: it still drives at {speed(last.linear_m_s)} when the "
            f"observation ends, after {metres(way_m(recording.truth))}; {ahead_of_it}"
        )
    shown = at_the_end(recording, "not at rest when the observation ended")
    return mistaken("never_stopped", seen, shown)


def _early(recording: Recording, rest: int, sight: Sight | None, shown: Evidence) -> Finding:
    ahead_of_it = "nothing ahead"
    if sight is not None:
        ahead_of_it = f"{sight.name} still {metres(sight.distance_m)} ahead"
    seen = f"stopped early, with {ahead_of_it}"
    if gone_ahead_m(recording.truth[: rest + 1]) < 0.0:
        return mistaken("drove_backwards", f"{seen}: it drove backwards", shown)
    misread = misreading(recording, recording.truth[rest])
    if misread is None:
        return mistaken("stopped_early", seen, shown)
    return mistaken("misread_scan", f"{seen}: {misread.words}", shown, hint=misread.hint)


def _late(
    recording: Recording, rest: int, sight: Sight, parameters: Stops, shown: Evidence
) -> Finding:
    seen = f"stopped late, with {sight.name} at {metres(sight.distance_m)}"
    too_near = recording.truth[_too_near_since(recording, rest, parameters.distance) : rest + 1]
    begin_ns, end_ns = too_near[0].time_ns, too_near[-1].time_ns
    fastest = max(abs(step.linear_m_s) for step in too_near)
    lost_s = stolen_s(recording, begin_ns, end_ns)
    missing_m = parameters.distance - parameters.late - sight.distance_m
    if lost_s > 0.0 and lost_s * fastest >= missing_m:
        return Finding.held_up(seen, lost_s)
    seen += (
        f": it drove on for {format_duration((end_ns - begin_ns) / NS)} below "
        f"{metres(parameters.distance)}, at up to {speed(fastest)}"
    )
    received = sum(begin_ns <= scan.stamp_ns <= end_ns for scan in scans(recording))
    if received:
        seen += f"; {counted(received, 'scan')} came meanwhile"
    return mistaken("stopped_late", seen, shown)


def _too_near_since(recording: Recording, rest: int, distance_m: float) -> int:
    """Index of the step from which on something ahead was too near until the robot rested."""
    begin = rest
    while begin:
        sight = ahead(recording.scene, recording.truth[begin - 1])
        if sight is None or sight.distance_m > distance_m:
            break
        begin -= 1
    return begin


def _evidence(recording: Recording, scene: Scene, rest: int, parameters: Stops) -> Evidence:
    least_m = parameters.distance - parameters.late
    most_m = parameters.distance + parameters.early
    title, label = "Distance to what is straight ahead", "distance (m)"
    plot = over_time(recording, title, label, partial(ahead_m, scene), (least_m, most_m))
    still = list(takewhile(is_at_rest, recording.truth[rest:]))
    begin_s, end_s = (recording.since_launch_s(step.time_ns) for step in (still[0], still[-1]))
    plots = replace(plot, judged=(begin_s, end_s)), speed_plot(recording)
    shown = evidence_at(recording, "the robot came to rest", still[0].time_ns, *plots)
    return replace(shown, tables=tuple(_table(recording, scene, rest)))


def _table(recording: Recording, scene: Scene, rest: int) -> Iterator[Table]:
    """The last scans before the robot came to rest, with the commands that followed."""
    truth, rest_ns = recording.truth, recording.truth[rest].time_ns
    received = [scan for scan in scans(recording) if scan.stamp_ns <= rest_ns][-_SCANS:]
    if not received:
        return
    rows = []
    for scan, end_ns in zip(
        received, [*(scan.stamp_ns for scan in received[1:]), rest_ns], strict=True
    ):
        sent = [one for one in commands(recording) if scan.stamp_ns <= one.time_ns < end_ns]
        measured_m = front(recording, scan)
        true_m = ahead_m(scene, truth[index_at(truth, scan.stamp_ns)])
        rows.append(
            (
                f"{recording.since_launch_s(scan.stamp_ns):.2f} s",
                "none" if measured_m is None else f"{measured_m:.3f} m",
                ", ".join(dict.fromkeys(speed(one.twist.linear_m_s) for one in sent)) or "none",
                "nothing ahead" if true_m is None else f"{true_m:.3f} m",
            )
        )
    header = ("time", "beam ahead", "linear.x sent then", "true distance")
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
    if not is_start:
        stop_if(why_cut_short(recording))
        return _set_off(recording, truth[rest:], moved, "set_off_again")
    received = scans(recording)
    is_blind = bool(received) and moved.time_ns < received[0].stamp_ns
    return _set_off(recording, truth[rest:], moved, "blind_start" if is_blind else "set_off")


def _moves(step: Truth, tolerance_m_s: float) -> bool:
    return abs(step.linear_m_s) > tolerance_m_s or abs(step.angular_rad_s) > _TURNS_RAD_S


def _set_off(recording: Recording, truth: tuple[Truth, ...], step: Truth, mistake: str) -> Finding:
    """How a robot that was at rest began to move."""
    words = "set off again" if mistake == "set_off_again" else "set off"
    if abs(step.linear_m_s) < REST_M_S:
        words = "turned on the spot"
    elif step.linear_m_s < 0.0:
        words += " backwards"
    words += f" {recording.since_launch_s(step.time_ns):.2f} s after launch"
    if mistake == "blind_start":
        words += ", before the first scan had come"
    sight = ahead(recording.scene, step)
    if sight is not None:
        words += f", with {sight.name} {metres(sight.distance_m)} ahead"
    fastest = max(abs(item.linear_m_s) for item in truth)
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
