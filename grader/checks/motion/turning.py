"""Checks of how a robot turns on its way to a goal pose."""

from __future__ import annotations

import math
from itertools import pairwise

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.robot_check import GoalParameters
from grader.checks.need import SimulatedRobot
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.missed_goal import why_not_there
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.findings.words import counted, degrees, metres, speed
from grader.measure.motion.approach import Approach, long_turns
from grader.measure.motion.track import speed_plot, way_m
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth
from grader.spec.quantity import Angle, PositiveLength, Speed

# Way that the delay of odometry may still cost after the position is reached: 2 cm of the slowest
# robot, and as much as a faster one goes in a tenth of a second.
_RUN_OUT_M = 0.02
_RUN_OUT_S = 0.09
_OFF_RAD = 0.5
_STRAIGHT_RAD_S = 0.01
_PAUSE_NS = NS // 5


class TwoPhases(GoalParameters):
    """Parameters of motion.two_phases."""

    needs = (SimulatedRobot(commanded=True),)

    position: PositiveLength = Field(description="How near the goal counts as reached.")
    speed: Speed = Field(0.01, description="Commanded speed that still counts as none.")

    def _asked(self) -> str:
        return f"no linear motion once within {metres(self.position)} of the goal, only turning"


@check("motion.two_phases", Subject.RECORDING, TwoPhases, concept="angles")
def two_phases(recording: Recording, parameters: TwoPhases) -> Finding:
    """At the goal's position the robot turns and no longer drives.

    Judged by the active commands and the true path. Within `position` of the goal, the robot may
    still drive and turn towards it. It must not drive while it turns away from the goal's position,
    nor after it has turned away on the spot. Odometry comes late, so 2 cm are allowed, or what the
    robot drives in 0.09 s at full speed if that is more.
    """
    run = parameters.approach(recording)
    stray = _stray(run, parameters.arrival(run), parameters.speed)
    plots = speed_plot(recording), run.distance_plot
    way = sum(way_m(pair) for pair in stray)
    top_speed = 0.0 if recording.scene is None else recording.scene.max_linear_m_s
    if way <= max(_RUN_OUT_M, _RUN_OUT_S * top_speed):
        seen = f"drove {metres(way)} after it had begun to turn"
        return Finding.as_asked(seen, Evidence(plots=plots))
    first = stray[0][1]
    fastest = max(abs(after.command_m_s) for _, after in stray)
    when_s = recording.since_launch_s(first.time_ns)
    return why_off_course(recording) or mistaken(
        "drives_and_turns",
        f"drove {metres(way)} while it turned at the goal, commanded with up to {speed(fastest)} "
        f"(from {when_s:.2f} s after launch)",
        evidence_at(recording, "drives again", first.time_ns, *plots),
    )


def _stray(run: Approach, arrival: int, none_m_s: float) -> list[tuple[Truth, Truth]]:
    """Pairs of steps between which the robot drives where it should only turn."""
    found = []
    only_turns = False
    still_since_ns: int | None = None
    for before, after in pairwise(run.truth[arrival:]):
        turns_away = _turns_away(run, after)
        if abs(after.command_m_s) > none_m_s:
            still_since_ns = None
            if only_turns or turns_away:
                found.append((before, after))
            continue
        if still_since_ns is None:
            still_since_ns = after.time_ns
        if turns_away and after.time_ns - still_since_ns >= _PAUSE_NS:
            only_turns = True
    return found


def _turns_away(run: Approach, step: Truth) -> bool:
    """Whether it turns away from the goal's position, as no robot on its way there does.

    In the first phase it turns towards the goal, also where it comes in by a curve; a robot that
    drives straight past the goal overshoots, but does not align yet.
    """
    error_rad, turn_rad_s = run.bearing_error_rad(step), step.command_rad_s
    return (
        abs(error_rad) > _OFF_RAD and abs(turn_rad_s) > _STRAIGHT_RAD_S
        and error_rad * turn_rad_s < 0.0
    )  # fmt: skip


class ShortWay(GoalParameters):
    """Parameters of motion.short_way."""

    needs = (SimulatedRobot(commanded=True),)
    asks = "turns the short way, never more than half a turn"

    tolerance: Angle = Field(
        math.radians(30.0),
        description="How far it may turn the wrong way before it passes half a turn. Near half a "
        "turn, both ways are short.",
    )


@check("motion.short_way", Subject.RECORDING, ShortWay, concept="angles")
def short_way(recording: Recording, parameters: ShortWay) -> Finding:
    """The robot always turns the short way.

    Judged by the true heading, in the first phase against the direction of the goal, in the second
    (once driving has ended near the goal) against the goal's heading. The long way goes away from
    the goal direction and through half a turn. Overshooting by less is not the long way.
    """
    run = parameters.approach(recording)
    arrival, driven = run.arrival(parameters.position), run.driven(parameters.position)
    tolerance_rad = parameters.tolerance
    detours = [
        ("the goal", run.bearing_error_rad(step), step)
        for step in long_turns(run.truth[:arrival], run.bearing_error_rad, tolerance_rad)
    ]
    if driven is not None:
        detours += [
            ("the goal's heading", run.heading_error_rad(step), step)
            for step in long_turns(run.truth[driven:], run.heading_error_rad, tolerance_rad)
        ]
    evidence = Evidence(plots=(run.heading_plot,))
    if not detours:
        if arrival is None:
            # A robot that drives off has shown nothing of how it turns to this goal.
            stop_if(why_not_there(run, parameters.position))
        return Finding.as_asked("it never turned the long way", evidence)
    what, error_rad, step = detours[0]
    when_s = recording.since_launch_s(step.time_ns)
    more = f", and {counted(len(detours) - 1, 'more time')}" if len(detours) > 1 else ""
    return why_off_course(recording) or mistaken(
        "long_turn",
        f"turned away from {what} through half a turn: {degrees(math.tau - abs(error_rad))} "
        f"{_sense(-error_rad)} where {degrees(abs(error_rad))} {_sense(error_rad)} would do "
        f"({when_s:.2f} s after launch{more})",
        evidence_at(recording, "turns the long way", step.time_ns, *evidence.plots),
    )


def _sense(angle_rad: float) -> str:
    return "counter-clockwise" if angle_rad > 0.0 else "clockwise"
