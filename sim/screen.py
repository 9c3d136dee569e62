"""What the simulator shows in a terminal: a live view, or a line in a second."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from sim.lidar import Scan
from sim.motion import NS, Pose, Twist
from sim.pacing import Lateness
from sim.simulation import EventKind, Simulation, Step
from sim.view import Layer, draw, hit_points, range_towards

if TYPE_CHECKING:
    from sim.node import RosSimulator

_STYLES = {
    Layer.EMPTY: "",
    Layer.WALL: "bold",
    Layer.MOVING: "bold magenta",
    Layer.HIT: "red",
    Layer.FOOTPRINT: "green",
    Layer.ROBOT: "bold green",
}
_SUMMARY_LINES = 9


class Screen:
    """What is shown; receives the truth from the simulator as its sink."""

    def __init__(self, simulation: Simulation) -> None:
        """Begin with nothing to show."""
        self.simulator: RosSimulator | None = None
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

    def on_step(self, step: Step, stamp_ns: int) -> None:
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
            parts.append(f"CONTACT with {step.contact}")
        if self._late_steps:
            parts.append(f"{self._late_steps} steps late")
        return "  ".join([*parts, *self._complaints()])

    def picture(self, columns: int, lines: int) -> Text:
        """The live view, for a terminal of so many columns and lines."""
        simulation, text = self._simulation, Text(no_wrap=True, overflow="crop")
        hits = hit_points(simulation.lidar, *self._scan) if self._scan else np.empty((0, 2))
        rows = max(4, lines - _SUMMARY_LINES - 1)
        radius_m = simulation.model.radius_m
        for line in draw(
            simulation.world, simulation.pose, radius_m, self.time_ns, hits, columns, rows
        ):
            for characters, layer in line:
                text.append(characters, _STYLES[layer])
            text.append("\n")
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
            ("contact", f"with {step.contact}" if step.contact else "none"),
            *self._topics(),
        ]
        if self._late_steps:
            worst = f"at most {self._worst_late_ns / 1e6:.0f} ms"
            rows.append(("late", f"{self._late_steps} steps", worst))
        return rows

    def _topics(self) -> list[tuple[str, ...]]:
        simulator, topics = self.simulator, self._simulation.options.topics
        if simulator is None:
            return []
        publishers = simulator.command.get_publisher_count()
        odometry = simulator.odometry.publisher.get_subscription_count()
        scan = simulator.scan.publisher.get_subscription_count()
        command = f"{topics.command.topic} ({publishers} publishers)"
        return [
            ("from", command, f"{simulator.commands} commands", *self._complaints()),
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
        unheard = self.simulator.unheard if self.simulator is not None else ()
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
