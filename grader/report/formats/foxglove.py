"""A layout for Foxglove, so that a recording opens with something to see.

Panels are chosen from what was recorded: the robot's path where there is a robot, every numeric
field of every topic over time, and the scan in 3D.
Source of the form: a layout exported by Foxglove (Layouts, Export to file).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from grader.assignment.model import LASER_SCAN
from grader.recording.mcap_writer import LAUNCHED
from grader.recording.model import Recording

LAYOUT_FILE = "foxglove-layout.json"
_MOST_PATHS = 8
_MOST_ELEMENTS = 4


def render_layout(recordings: Iterable[Recording]) -> str:
    """Render the layout for all recordings of one submission, as JSON that Foxglove imports."""
    panels: dict[str, dict[str, Any]] = {}
    runs = tuple(recordings)
    scenes = (scene for run in runs for scene in run.scenes.values())
    for topic in dict.fromkeys(scene.odometry_topic for scene in scenes):
        if any(run.on(topic) for run in runs):
            place = f"{topic}.pose.pose.position"
            title = f"Path by {topic} (m)"
            panels[f"Plot!path {topic}"] = _plot(title, [f"{place}.y"], f"{place}.x")
    for topic, (kind, paths) in _topics(runs).items():
        if kind == LASER_SCAN:
            panels[f"3D!{topic}"] = {"topics": {topic: {"visible": True}}, "layers": {}}
        elif paths:
            panels[f"Plot!{topic}"] = _plot(topic, paths)
        else:
            panels[f"RawMessages!{topic}"] = {"topicPath": topic, "diffEnabled": False}
    if not panels:
        panels["RawMessages!launched"] = {"topicPath": LAUNCHED, "diffEnabled": False}
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _arrange(list(panels)),
    }
    return json.dumps(layout, indent=2, ensure_ascii=False) + "\n"


def _topics(runs: Iterable[Recording]) -> dict[str, tuple[str, list[str]]]:
    """Topic -> its type and the paths of its numbers, sorted by topic."""
    found: dict[str, tuple[str, list[str]]] = {}
    for run in runs:
        for topic, messages in run.messages.items():
            if messages and topic not in found:
                paths = [f"{topic}.{path}" for path in _numbers(messages[0].value)]
                found[topic] = (messages[0].type, paths[:_MOST_PATHS])
    return dict(sorted(found.items()))


def _numbers(value: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Paths of the numeric fields; stamps and long arrays, such as covariances, are left out."""
    for name, field in value.items():
        if name == "header":
            continue
        if isinstance(field, Mapping):
            yield from _numbers(field, f"{prefix}{name}.")
        elif isinstance(field, int | float):
            yield f"{prefix}{name}"
        elif isinstance(field, list | tuple) and len(field) <= _MOST_ELEMENTS:
            numeric = [index for index, item in enumerate(field) if isinstance(item, int | float)]
            yield from (f"{prefix}{name}[{index}]" for index in numeric)


def _plot(title: str, paths: list[str], x_axis: str | None = None) -> dict[str, Any]:
    panel: dict[str, Any] = {
        "foxglovePanelTitle": title,
        "paths": [
            {"value": path, "enabled": True, "timestampMethod": "receiveTime"} for path in paths
        ],
        "showLegend": True,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": x_axis is None,
        "xAxisVal": "timestamp" if x_axis is None else "custom",
    }
    if x_axis is not None:
        panel["xAxisPath"] = {"value": x_axis, "enabled": True}
    return panel


def _arrange(names: list[str], direction: str = "row") -> Any:
    """Halve the space again and again, side by side and one above the other in turn."""
    if len(names) == 1:
        return names[0]
    half = (len(names) + 1) // 2
    other = "column" if direction == "row" else "row"
    return {
        "direction": direction,
        "first": _arrange(names[:half], other),
        "second": _arrange(names[half:], other),
        "splitPercentage": round(100 * half / len(names)),
    }
