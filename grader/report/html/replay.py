"""What is needed to play a run again in a browser: small, and the same for the reference.

``templates/report.js`` reads it. To keep a report of many runs small, keys are short and numbers
are integers: "milli" below means millimetres, thousandths of a radian, or these per second, and a
series holds differences, each from the value before.

=================  ================================================================================
``began, step``    time of the first sample after launch, time between samples; seconds
``x, y, yaw``      where the robot is at each sample: three series, milli
``v, w``           its true speeds, ``cv, cw`` those that it was sent: series, milli
``touches``        pairs of seconds: from when to when it touched something
``radius, limits`` of the robot: its size, and its highest linear and angular speed; milli
``walls, lines``   capsules (both ends, radius), and lines on the floor (points); milli
``moving``         other things: size, and where they are every 0.1 s or 0 while they are not
``lidar``          its pose on the robot, milli
``scans``          times in seconds, first angle ``from`` and angle ``by`` which the beams differ in
                   milliradians, how many ``beams`` are kept, ``ranges`` (see :func:`_two_digits`)
``log``            pairs of seconds and text
``given, values``  what was drawn at random: numbers, and texts with units
``goals``          where it should end: pose and radius in milli, and the radius as text
=================  ================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from markupsafe import Markup

from grader.assignment.model import Assignment, Scenario
from grader.findings.words import metres
from grader.recording.model import NS, Recording
from grader.recording.one_robot import each_robot
from grader.recording.simulated import Scene, Truth
from grader.report.drawing.ground_plan import places
from grader.report.drawing.path import targets
from grader.report.model.excerpt import printed
from grader.spec.safe_text import one_line
from grader.spec.unit import shown_in
from sim.shapes import ROBOTS

Replay = Mapping[str, Any]
"""One run, ready for JSON; templates/report.js reads it."""

_STEP = 10
"""Steps of the simulation, of 10 ms, from one sample to the next."""
_MOST = 1e6
"""Largest number that is kept, in metres or the like; a larger one becomes this."""
_MOST_BEAMS = 90
_MOST_SCANS = 200
_MOST_LINES = 120
_MOST_CHARACTERS = 160
DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
"""Of base 64, as base64url has them in RFC 4648."""
NO_RETURN_CM = len(DIGITS) ** 2 - 1
"""The largest number of two digits stands for a beam that did not return."""


def make_replay(recording: Recording, scenario: Scenario) -> Replay | None:
    """Make the replay of a run, or None in a scenario without a simulated robot.

    Of several robots it shows the first as the one that is followed.
    """
    recording = next(each_robot(recording))
    scene, truth = recording.scene, recording.truth
    if scene is None or len(truth) < 2:
        return None
    return {
        "robot": recording.robot,
        **_motion(recording),
        **_world(scene, (truth[-1].time_ns - scene.began_ns) / NS),
        **_drawn_values(recording, scenario),
        "scans": _scans(recording, scene),
        "log": [
            [
                round(recording.since_launch_s(line.time_ns), 2),
                one_line(line.text)[:_MOST_CHARACTERS],
            ]
            for line in printed(recording)[:_MOST_LINES]
        ],
    }


def _motion(recording: Recording) -> Replay:
    samples = recording.truth[::_STEP]
    began_s = recording.since_launch_s(samples[0].time_ns)
    is_one = len(samples) == 1
    step_s = 0.1 if is_one else (samples[1].time_ns - samples[0].time_ns) / NS
    return {
        "began": round(began_s, 3),
        "step": round(step_s, 3),
        "x": _differences(sample.x_m for sample in samples),
        "y": _differences(sample.y_m for sample in samples),
        "yaw": _differences(_continuous_yaws(samples)),
        "v": _differences(sample.linear_m_s for sample in samples),
        "w": _differences(sample.angular_rad_s for sample in samples),
        "cv": _differences(sample.command_m_s for sample in samples),
        "cw": _differences(sample.command_rad_s for sample in samples),
        "touches": _touches(recording),
    }


def _world(scene: Scene, until_s: float) -> Replay:
    return {
        "radius": _milli(scene.radius_m),
        "limits": _millis(scene.max_linear_m_s, scene.max_angular_rad_s),
        "walls": [_millis(*wall) for walls in scene.outlines.values() for wall in walls],
        "lines": [[_millis(*point) for point in points] for points in scene.lines],
        "moving": _moving(scene, until_s),
        "lidar": _millis(scene.lidar.x_m, scene.lidar.y_m, scene.lidar.yaw_rad),
    }


def _drawn_values(recording: Recording, scenario: Scenario) -> Replay:
    values = {
        name: recording.values[name] for name in sorted(scenario.random) if name in recording.values
    }
    texts = []
    for name, value in values.items():
        unit = scenario.random[name].unit
        texts.append(f"{name} = {shown_in(value, unit):.3g} {unit}".strip())
    return {"given": {name: round(value, 6) for name, value in values.items()}, "values": texts}


def with_goals(replay: Replay, assignment: Assignment, scenario: str) -> Replay:
    """Add where the robot should end, as the checks say it now."""
    goals = []
    for goal in targets(assignment, scenario, replay.get("given", {}), replay.get("robot", "")):
        pose = _millis(goal.pose.x_m, goal.pose.y_m, goal.pose.yaw_rad)
        goals.append([*pose, _milli(goal.radius_m), metres(goal.radius_m)])
    return {**replay, "goals": goals}


def embedded(data: Any) -> Markup:
    """Write data into a script element: nothing in it can end the element."""
    from jinja2.utils import htmlsafe_json_dumps

    return htmlsafe_json_dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _milli(value: float) -> int:
    return round(_finite(value) * 1e3)


def _millis(*values: float) -> list[int]:
    return list(map(_milli, values))


def _finite(value: float) -> float:
    """A finite number for JSON: a student's own scan may hold any number."""
    return 0.0 if math.isnan(value) else min(max(value, -_MOST), _MOST)


def _differences(values: Iterable[float]) -> list[int]:
    numbers = list(map(_milli, values))
    return [after - before for before, after in pairwise([0, *numbers])]


def _continuous_yaws(truth: Sequence[Truth]) -> Iterable[float]:
    """Headings without jumps at ±180°."""
    heading = truth[0].yaw_rad
    for step in truth:
        heading += math.remainder(step.yaw_rad - heading, math.tau)
        yield heading


def _moving(scene: Scene, until_s: float) -> list[dict[str, Any]]:
    return [
        {
            "radius": _milli(obstacle.radius_m) if obstacle.radius_m is not None else None,
            "size": _millis(*(obstacle.size_m or ())),
            "robot": obstacle.label.startswith(ROBOTS),
            "places": [
                _millis(place.x_m, place.y_m, place.yaw_rad) if place else 0
                for place in places(obstacle, until_s)
            ],
        }
        for obstacle in scene.moving
    ]


def _touches(recording: Recording) -> list[list[float]]:
    """From when to when the robot touched something."""
    touches: list[list[float]] = []
    for step in recording.truth:
        if step.contact:
            time_s = round(recording.since_launch_s(step.time_ns), 2)
            if touches and time_s - touches[-1][1] < 0.02:
                touches[-1][1] = time_s
            else:
                touches.append([time_s, time_s])
    return touches


def _scans(recording: Recording, scene: Scene) -> dict[str, Any] | None:
    scans = [scan for scan in recording.on(scene.scan_topic) if scan.value.get("ranges")]
    scans = scans[:: max(1, math.ceil(len(scans) / _MOST_SCANS))]
    if not scans:
        return None
    first = scans[0].value
    count = len(first["ranges"])
    every = max(1, math.ceil(count / _MOST_BEAMS))
    return {
        "times": [round(recording.since_launch_s(scan.stamp_ns), 3) for scan in scans],
        "from": _milli(first.get("angle_min", 0.0)),
        "by": round(_finite(first.get("angle_increment", 0.0)) * every * 1e3, 4),
        "beams": len(range(0, count, every)),
        "ranges": "".join(
            _two_digits(range_m) for scan in scans for range_m in scan.value["ranges"][::every]
        ),
    }


def _two_digits(range_m: float) -> str:
    """A range in centimetres as two digits of base 64."""
    returned = 0.0 < range_m < NO_RETURN_CM / 100.0
    range_cm = min(round(range_m * 100.0), NO_RETURN_CM - 1) if returned else NO_RETURN_CM
    high, low = divmod(range_cm, len(DIGITS))
    return DIGITS[high] + DIGITS[low]
