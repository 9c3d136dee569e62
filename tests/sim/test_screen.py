"""What is shown in the terminal."""

from __future__ import annotations

import io
import math
from pathlib import Path

from rich.console import Console

from sim.description import SimulatorOptions
from sim.motion import Twist
from sim.pacing import Lateness
from sim.screen import Screen
from sim.simulation import make_simulation
from sim.world import read_world

WORLDS = Path(__file__).parent / "worlds"


def test_the_screen_shows_everything() -> None:
    world, options = read_world(WORLDS / "wall.yaml", {"wall_x": 0.3}), SimulatorOptions()
    simulation = make_simulation(world, options)
    screen = Screen(world, simulation, options)
    console = Console(
        file=io.StringIO(), width=80, height=30, force_terminal=True, color_system=None
    )
    console.print(screen.picture(console))  # before the first step
    assert screen.line() == "starting"
    for index in range(300):
        screen.on_step(simulation.advance(Twist(0.2, 0.0) if index == 0 else None), 0)
    screen.on_late(Lateness(7, 3, 40_000_000))
    line = screen.line()
    assert "3.00 s  x +0.200 m" in line
    assert line.endswith("ahead -inf m  CONTACT with segments[0]  3 steps late")
    with console.capture() as capture:
        console.print(screen.picture(console))
    text = capture.get()
    for part in (
        "wall.yaml, burger",
        "x +0.200 m",
        "+0.200 m/s",
        "segments[0]",
        "at most 40 ms",
        "→",
    ):
        assert part in text


def test_commands_that_are_not_finite_are_counted() -> None:
    world, options = read_world(WORLDS / "empty.yaml"), SimulatorOptions()
    simulation = make_simulation(world, options)
    screen = Screen(world, simulation, options)
    for speed in (math.nan, 0.1, math.inf):
        screen.on_step(simulation.advance(Twist(speed, 0.0)), 0)
    assert screen.rejected == 2
    assert screen.line().endswith("2 commands not finite: the robot stops instead")


def test_without_a_terminal_it_is_a_line_for_every_second() -> None:
    world, options = read_world(WORLDS / "empty.yaml"), SimulatorOptions()
    simulation = make_simulation(world, options)
    screen, output = Screen(world, simulation, options), io.StringIO()
    with screen.shown(output) as show:
        for _ in range(350):
            screen.on_step(simulation.advance(), 0)
            show()
    assert [line.split()[0] for line in output.getvalue().splitlines()] == ["1.00", "2.00", "3.00"]
