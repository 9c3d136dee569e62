"""What the simulator shows in a terminal: a live view, or a line in a second.

In the map walls and hits of the LiDAR are drawn in braille, whose characters hold 2 x 4 dots, so
that dots are about square in a terminal.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from sim.lidar import Lidar, Scan
from sim.motion import NS, Pose, Twist, compose
from sim.pacing import Lateness
from sim.shapes import Shape, circle, obstacle_words
from sim.simulation import EventKind, Simulation, Step
from sim.world import World

if TYPE_CHECKING:
    from sim.robot_topics import RobotTopics

ARROWS = "→↗↑↖←↙↓↘"
_DOTS = np.array(((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80)))
# Nothing, walls, what moves, hits of the LiDAR, footprint, robot; the later one wins.
STYLES = ("", "bold", "bold magenta", "red", "green", "bold green")
_SUMMARY_LINES = 9
_MARGIN_M = 0.3
_LEAST_M = 2.0
# More dots than a map has across show nothing more.
_MOST_DOTS = 2_000

Points = NDArray[np.float64]
"""Shape (n, 2): x and y in the world's frame, in metres."""


class Screen:
    """What is shown; receives the truth from the simulator as its sink."""

    def __init__(self, simulation: Simulation) -> None:
        """Begin with nothing to show."""
        self.robot: RobotTopics | None = None
        self._simulation = simulation
        self._step: Step | None = None
        self._scan: tuple[Scan, Pose] | None = None
        self._late_steps = 0
        self._worst_late_ns = 0
        self._rejected = 0

    @property
    def time_ns(self) -> int:
        """Simulated time of what is shown."""
        return self._step.time_ns if self._step else 0

    def on_step(self, step: Step, stamp_ns: int, robot: str) -> None:
        """Keep the newest step and the newest scan."""
        self._step = step
        self._rejected += sum(event.kind is EventKind.COMMAND_REJECTED for event in step.events)
        if step.scan is not None:
            self._scan = (step.scan, step.pose)

    def on_late(self, lateness: Lateness) -> None:
        """Count late steps."""
        self._late_steps += lateness.steps
        self._worst_late_ns = max(self._worst_late_ns, lateness.late_ns)

    def line(self) -> str:
        """Everything that matters in one line."""
        step = self._step
        if step is None:
            return "starting"
        parts = [f"{step.time_ns / NS:8.2f} s", *_place(step.pose), *_speeds(step.twist)]
        parts.append(f"ahead {self._range(0.0)}")
        if step.contact:
            parts.append(f"CONTACT with {obstacle_words(step.contact)}")
        if self._late_steps:
            parts.append(f"{self._late_steps} steps late")
        return "  ".join([*parts, *self._complaints()])

    def picture(self, columns: int, lines: int) -> Text:
        """The live view, for a terminal of so many columns and lines."""
        simulation = self._simulation
        hits = hit_points(simulation.lidar, *self._scan) if self._scan else np.empty((0, 2))
        text = draw(
            simulation.world,
            simulation.pose,
            simulation.model.radius_m,
            self.time_ns,
            hits,
            (columns, max(4, lines - _SUMMARY_LINES - 1)),
        )
        for label, *parts in self._summary(self._step) if self._step else ():
            style = "bold red" if label == "contact" and parts != ["none"] else ""
            text.append(f"{label:<10}{'  '.join(parts)}\n", style)
        return text

    def _summary(self, step: Step) -> list[tuple[str, ...]]:
        name = f"{self._simulation.world.file.name}, {self._simulation.model.name}"
        directions = {"ahead": 0.0, "left": 0.5, "behind": 1.0, "right": -0.5}
        rows = [
            ("", name, f"{step.time_ns / NS:.1f} s", "Ctrl-C ends"),
            ("pose", *_place(step.pose)),
            ("velocity", *_speeds(step.twist)),
            ("command", *_speeds(step.command)),
            (
                "scan",
                *(f"{side} {self._range(turn * math.pi)}" for side, turn in directions.items()),
            ),
            ("contact", f"with {obstacle_words(step.contact)}" if step.contact else "none"),
            *self._topics(),
        ]
        if self._late_steps:
            worst = f"at most {self._worst_late_ns / 1e6:.0f} ms"
            rows.append(("late", f"{self._late_steps} steps", worst))
        return rows

    def _topics(self) -> list[tuple[str, ...]]:
        robot, topics = self.robot, self._simulation.options.topics
        if robot is None:
            return []
        publishers = robot.command.get_publisher_count()
        odometry = robot.odometry.publisher.get_subscription_count()
        scan = robot.scan.publisher.get_subscription_count()
        command = f"{topics.command.topic} ({publishers} publishers)"
        return [
            ("from", command, f"{robot.commands} commands", *self._complaints()),
            (
                "to",
                f"{topics.odometry.topic} ({odometry} subscriptions)",
                f"{topics.scan.topic} ({scan} subscriptions)",
            ),
        ]

    def _complaints(self) -> list[str]:
        """What is wrong with the commands."""
        found = []
        if self._rejected:
            found.append(f"{self._rejected} commands not finite: the robot stops instead")
        unheard = self.robot.unheard if self.robot is not None else ()
        if unheard:
            wanted = self._simulation.options.topics.command.type
            found.append(f"{', '.join(unheard)} is not heard: the robot takes {wanted}")
        return found

    def _range(self, direction_rad: float) -> str:
        if self._scan is None:
            return "no scan"
        return f"{range_towards(self._simulation.lidar, self._scan[0], direction_rad):.2f} m"


def _place(pose: Pose) -> tuple[str, str, str]:
    yaw_deg = math.degrees(pose.yaw_rad)
    return f"x {pose.x_m:+.3f} m", f"y {pose.y_m:+.3f} m", f"yaw {yaw_deg:+.1f} deg"


def _speeds(twist: Twist) -> tuple[str, str]:
    return f"v {twist.linear_m_s:+.3f} m/s", f"w {twist.angular_rad_s:+.3f} rad/s"


def draw(
    world: World, pose: Pose, radius_m: float, time_ns: int, hits: Points, size: tuple[int, int]
) -> Text:
    """Draw a world with its robot from above.

    Args:
        hits: Where the beams of the LiDAR ended (see :func:`hit_points`).
        size: Columns and rows of characters.
    """
    columns, rows = size
    x_min, y_min, x_max, y_max = world.extent((pose.x_m, pose.y_m))
    width_m = max(x_max - x_min + 2 * _MARGIN_M, _LEAST_M)
    height_m = max(y_max - y_min + 2 * _MARGIN_M, _LEAST_M)
    dots_per_m = min(2 * columns / width_m, 4 * rows / height_m)
    middle = np.array((0.5 * (x_min + x_max), 0.5 * (y_min + y_max)))
    characters = np.zeros((rows, columns), dtype=np.int64)
    layers = np.zeros((rows, columns), dtype=np.int64)
    at = np.array(((pose.x_m, pose.y_m),))
    drawn = (
        _outlines(world.shapes, dots_per_m),
        _outlines(world.moving_at(time_ns), dots_per_m),
        hits,
        _outlines([circle("", pose.x_m, pose.y_m, radius_m)], dots_per_m),
        at,
    )
    for layer, points in enumerate(drawn, start=1):
        dots = np.floor((points - middle) * (dots_per_m, -dots_per_m)).astype(np.int64)
        dots += (columns, 2 * rows)
        dots = dots[((dots >= 0) & (dots < (2 * columns, 4 * rows))).all(axis=1)]
        column, row = dots.T
        place = row // 4, column // 2
        np.bitwise_or.at(characters, place, _DOTS[row % 4, column % 2])
        np.maximum.at(layers, place, layer)
    characters[characters > 0] += 0x2800
    characters[characters == 0] = ord(" ")
    arrow = ARROWS[round(pose.yaw_rad / (math.pi / 4)) % 8]
    characters[layers == len(drawn)] = ord(arrow)
    text = Text(no_wrap=True, overflow="crop")
    for line in zip(characters, layers, strict=True):
        for layer, run in groupby(zip(*line, strict=True), key=lambda pair: pair[1]):
            text.append("".join(chr(one) for one, _ in run), STYLES[layer])
        text.append("\n")
    return text


def _outlines(shapes: Iterable[Shape], dots_per_m: float) -> Points:
    """Points on walls and circles, so near to each other that they make lines."""
    found = [np.empty((0, 2))]
    for x1, y1, x2, y2, radius in (item for shape in shapes for item in shape.capsules):
        length_m = math.tau * radius or math.hypot(x2 - x1, y2 - y1)
        share = np.linspace(0.0, 1.0, min(_MOST_DOTS, math.ceil(length_m * dots_per_m) + 2))
        x, y = x1 + share * (x2 - x1), y1 + share * (y2 - y1)
        angle = math.tau * share
        found.append(np.column_stack((x + radius * np.cos(angle), y + radius * np.sin(angle))))
    return np.concatenate(found)


def hit_points(lidar: Lidar, scan: Scan, pose: Pose) -> Points:
    """Where the beams of a scan ended."""
    sensor = compose(pose, lidar.options.pose)
    angles = sensor.yaw_rad + lidar.angles_rad
    ranges = scan.ranges_m.astype(np.float64)
    seen = np.isfinite(ranges) & (ranges > 0.0)
    x = sensor.x_m + ranges[seen] * np.cos(angles[seen])
    y = sensor.y_m + ranges[seen] * np.sin(angles[seen])
    return np.column_stack((x, y))


def range_towards(lidar: Lidar, scan: Scan, direction_rad: float) -> float:
    """What a scan says in a direction of the sensor: 0 ahead, pi/2 left."""
    index = round((direction_rad - lidar.angle_min_rad) / lidar.angle_increment_rad)
    return float(scan.ranges_m[index % lidar.options.beams])
