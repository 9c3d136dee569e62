"""What is needed to play a run again in a browser: small, and the same for the reference.

Lengths are in millimetres, angles in thousandths of a radian, speeds in both per second; all
are integers. What changes little is kept as differences from the value before.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from operator import sub
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

STEP = 10
"""Steps of 10 ms from one sample to the next."""
MOST = 1e6
"""Largest number that is kept, in metres or the like; a larger one becomes this."""
MOST_BEAMS = 90
MOST_SCANS = 200
MOST_LINES = 120
MOST_CHARACTERS = 160
DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
NOTHING = 64 * 64 - 1
"""A beam that did not return, in centimetres."""
_NUMBERS = tuple(high + low for high in DIGITS for low in DIGITS)
"""Every number of two digits."""


def make_replay(recording: Recording, scenario: Scenario) -> Replay | None:
    """Make the replay of a run, or None in a scenario without a simulated robot.

    Of several robots it shows the first as the one that is followed.
    """
    recording = next(each_robot(recording))
    scene, truth = recording.scene, recording.truth
    if scene is None or len(truth) < 2:
        return None
    samples = truth[::STEP]
    since = recording.since_launch_s
    lidar = scene.lidar
    given = {
        name: value for name, value in sorted(recording.values.items()) if name in scenario.random
    }
    return {
        "began": round(since(samples[0].time_ns), 3),
        "step": round((samples[1].time_ns - samples[0].time_ns) / NS, 3) if samples[1:] else 0.1,
        "robot": recording.robot,
        "radius": _milli(scene.radius_m),
        "limits": _millis(scene.max_linear_m_s, scene.max_angular_rad_s),
        "walls": [_millis(*one) for capsules in scene.outlines.values() for one in capsules],
        "lines": [[_millis(*point) for point in points] for points in scene.lines],
        "moving": _moving(scene, (truth[-1].time_ns - scene.began_ns) / NS),
        "x": _differences(step.x_m for step in samples),
        "y": _differences(step.y_m for step in samples),
        "yaw": _differences(_turns(samples)),
        "v": _differences(step.linear_m_s for step in samples),
        "w": _differences(step.angular_rad_s for step in samples),
        "cv": _differences(step.command_m_s for step in samples),
        "cw": _differences(step.command_rad_s for step in samples),
        "touches": _touches(recording),
        "lidar": _millis(lidar.x_m, lidar.y_m, lidar.yaw_rad),
        "scans": _scans(recording, scene),
        "log": [
            [round(since(entry.time_ns), 2), one_line(entry.text)[:MOST_CHARACTERS]]
            for entry in printed(recording)[:MOST_LINES]
        ],
        "values": [
            f"{name} = {shown_in(value, unit):.3g} {unit}".strip()
            for name, value in given.items()
            for unit in (scenario.random[name].unit,)
        ],
        "given": {name: round(value, 6) for name, value in given.items()},
    }


def with_goals(replay: Replay, assignment: Assignment, scenario: str) -> Replay:
    """Add where the robot should end, as the checks say it now."""
    goals = [
        [
            *_millis(one.pose.x_m, one.pose.y_m, one.pose.yaw_rad, one.radius_m),
            metres(one.radius_m),
        ]
        for one in targets(assignment, scenario, replay.get("given", {}), replay.get("robot", ""))
    ]
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
    return min(max(value, -MOST), MOST) if not math.isnan(value) else 0.0


def _differences(values: Iterable[float]) -> list[int]:
    found = [round(value * 1e3) if -MOST < value < MOST else _milli(value) for value in values]
    return list(map(sub, found, [0, *found]))


def _turns(truth: Sequence[Truth]) -> Iterable[float]:
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
    found: list[list[float]] = []
    for step in recording.truth:
        if not step.contact:
            continue
        time_s = round(recording.since_launch_s(step.time_ns), 2)
        if found and time_s - found[-1][1] < 0.02:
            found[-1][1] = time_s
        else:
            found.append([time_s, time_s])
    return found


def _scans(recording: Recording, scene: Scene) -> dict[str, Any] | None:
    scans = [scan for scan in recording.on(scene.scan_topic) if scan.value.get("ranges")]
    scans = scans[:: max(1, math.ceil(len(scans) / MOST_SCANS))]
    if not scans:
        return None
    first = scans[0].value
    count = len(first["ranges"])
    every = max(1, math.ceil(count / MOST_BEAMS))
    return {
        "times": [round(recording.since_launch_s(scan.stamp_ns), 3) for scan in scans],
        "from": _milli(first.get("angle_min", 0.0)),
        "by": round(_finite(first.get("angle_increment", 0.0)) * every * 1e3, 4),
        "beams": len(range(0, count, every)),
        "ranges": "".join(
            _digits(range_m) for scan in scans for range_m in scan.value["ranges"][::every]
        ),
    }


def _digits(range_m: float) -> str:
    """A range in centimetres."""
    if not 0.0 < range_m < NOTHING / 100.0:
        return _NUMBERS[NOTHING]
    return _NUMBERS[min(round(range_m * 100.0), NOTHING - 1)]
