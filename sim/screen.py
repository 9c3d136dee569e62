"""What the simulator shows in a terminal: a live view, or a line in a second."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from rich.console import Console
from rich.live import Live
from rich.text import Text

from sim.description import SimulatorOptions
from sim.lidar import Scan
from sim.motion import NS, Pose, Twist
from sim.pacing import Lateness
from sim.simulation import EventKind, Simulation, Step
from sim.view import Drawing, Layer, hit_points, range_towards
from sim.world import World

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
_REFRESH_NS = 100_000_000
_LINE_NS = NS
_SUMMARY_LINES = 9


class Screen:
    """What is shown; takes the truth from the simulator as its sink."""

    def __init__(self, world: World, simulation: Simulation, options: SimulatorOptions) -> None:
        """Begin with nothing to show."""
        self.simulator: RosSimulator | None = None
        self._world, self._simulation, self._options = world, simulation, options
        self._drawing = Drawing(world, simulation.robot.model.radius_m)
        self._step: Step | None = None
        self._scan: tuple[Scan, Pose] | None = None
        self._late_steps = 0
        self._worst_late_ns = 0
        self.rejected = 0

    @property
    def time_ns(self) -> int:
        """Simulated time of what is shown."""
        return self._step.time_ns if self._step else 0

    def on_step(self, step: Step, stamp_ns: int) -> None:
        """Keep the newest step and the newest scan."""
        self._step = step
        self.rejected += sum(event.kind is EventKind.COMMAND_REJECTED for event in step.events)
        if step.scan is not None:
            self._scan = (step.scan, step.pose)

    def on_late(self, lateness: Lateness) -> None:
        """Count late steps."""
        self._late_steps += lateness.steps
        self._worst_late_ns = max(self._worst_late_ns, lateness.late_ns)

    @contextmanager
    def shown(self, output: TextIO) -> Iterator[_Show]:
        """Show it while the block runs: a live view on a terminal, else a line in a second."""
        if not output.isatty():
            yield _Show(self, _LINE_NS, lambda: print(self.line(), file=output, flush=True))
            return
        console = Console(file=output)
        # We refresh it ourselves between two steps; a thread of rich's would disturb them.
        with Live(console=console, screen=True, auto_refresh=False, redirect_stdout=False) as live:
            yield _Show(self, _REFRESH_NS, lambda: live.update(self.picture(console), refresh=True))

    def line(self) -> str:
        """Everything that matters in one line."""
        step = self._step
        if step is None:
            return "starting"
        text = (
            f"{step.time_ns / NS:8.2f} s  x {step.pose.x_m:+.3f} m  y {step.pose.y_m:+.3f} m  "
            f"yaw {math.degrees(step.pose.yaw_rad):+.1f} deg  "
            f"v {step.twist.linear_m_s:+.3f} m/s  w {step.twist.angular_rad_s:+.3f} rad/s  "
            f"ahead {self._range(0.0)}"
        )
        if step.contact:
            text += f"  CONTACT with {step.contact}"
        if self._late_steps:
            text += f"  {self._late_steps} steps late"
        return "  ".join([text, *self._complaints()])

    def picture(self, console: Console) -> Text:
        """The live view."""
        columns, lines = console.size
        rows = max(4, lines - _SUMMARY_LINES - 1)
        pose = self._simulation.pose
        scan, at = self._scan or (None, pose)
        hits = hit_points(self._simulation.lidar, scan, at) if scan else []
        text = Text(no_wrap=True, overflow="crop")
        for line in self._drawing.lines(pose, self.time_ns, columns, rows, hits):
            for run in line:
                text.append(run.text, _STYLES[run.layer])
            text.append("\n")
        return text.append_text(self._summary())

    def _summary(self) -> Text:
        step, text = self._step, Text()
        if step is None:
            return text
        name = f"{self._world.file.name}, {self._simulation.robot.model.name}"
        pose = step.pose
        rows = [
            ("", name, f"{step.time_ns / NS:.1f} s", "Ctrl-C ends"),
            (
                "pose",
                f"x {pose.x_m:+.3f} m",
                f"y {pose.y_m:+.3f} m",
                f"yaw {math.degrees(pose.yaw_rad):+.1f} deg",
            ),
            ("velocity", *_speeds(step.twist)),
            ("command", *_speeds(step.command)),
            (
                "scan",
                f"ahead {self._range(0.0)}",
                f"left {self._range(math.pi / 2)}",
                f"behind {self._range(math.pi)}",
                f"right {self._range(-math.pi / 2)}",
            ),
            ("contact", f"with {step.contact}" if step.contact else "none"),
            *self._topics(),
        ]
        if self._late_steps:
            worst = f"at most {self._worst_late_ns / 1e6:.0f} ms"
            rows.append(("late", f"{self._late_steps} steps", worst))
        for label, *parts in rows:
            style = "bold red" if label == "contact" and step.contact else ""
            text.append(f"{label:<10}{'  '.join(parts)}\n", style)
        return text

    def _topics(self) -> list[tuple[str, ...]]:
        simulator, topics = self.simulator, self._options.topics
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
        if self.rejected:
            found.append(f"{self.rejected} commands not finite: the robot stops instead")
        unheard = self.simulator.unheard if self.simulator is not None else ()
        if unheard:
            wanted = self._options.topics.command.type
            found.append(f"{', '.join(unheard)} is not heard: the robot takes {wanted}")
        return found

    def _range(self, direction_rad: float) -> str:
        if self._scan is None:
            return "no scan"
        return f"{range_towards(self._simulation.lidar, self._scan[0], direction_rad):.2f} m"


class _Show:
    """Calls a function whenever so much simulated time has passed."""

    def __init__(self, screen: Screen, every_ns: int, show: Callable[[], object]) -> None:
        self._screen, self._every_ns, self._show = screen, every_ns, show
        self._next_ns = every_ns

    def __call__(self) -> None:
        time_ns = self._screen.time_ns
        if time_ns >= self._next_ns:
            self._next_ns = (time_ns // self._every_ns + 1) * self._every_ns
            self._show()


def _speeds(twist: Twist) -> tuple[str, str]:
    return f"{twist.linear_m_s:+.3f} m/s", f"{twist.angular_rad_s:+.3f} rad/s"
