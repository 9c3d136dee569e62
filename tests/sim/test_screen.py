"""What is shown in the terminal."""

from __future__ import annotations

import math
from pathlib import Path

from sim.description import SimulatorOptions
from sim.motion import Twist
from sim.pacing import Lateness
from sim.screen import Screen
from sim.simulation import make_simulation
from sim.world import read_world

WORLDS = Path(__file__).parent / "worlds"


def test_the_screen_shows_everything() -> None:
    world = read_world(WORLDS / "wall.yaml", {"wall_x": 0.3})
    simulation = make_simulation(world, SimulatorOptions())
    screen = Screen(simulation)
    assert "→" in screen.picture(80, 30).plain  # before the first step
    assert screen.line() == "starting"
    for index in range(300):
        screen.on_step(simulation.advance(Twist(0.2, 0.0) if index == 0 else None), 0)
    screen.on_late(Lateness(7, 3, 40_000_000))
    line = screen.line()
    assert "3.00 s  x +0.200 m" in line
    assert line.endswith("ahead -inf m  CONTACT with segments[0]  3 steps late")
    text = screen.picture(80, 30).plain
    for part in (
        "wall.yaml, burger",
        "x +0.200 m",
        "+0.200 m/s",
        "with segments[0]",
        "at most 40 ms",
        "→",
    ):
        assert part in text


def test_commands_that_are_not_finite_are_counted() -> None:
    simulation = make_simulation(read_world(WORLDS / "empty.yaml"), SimulatorOptions())
    screen = Screen(simulation)
    for speed in (math.nan, 0.1, math.inf):
        screen.on_step(simulation.advance(Twist(speed, 0.0)), 0)
    assert screen.line().endswith("2 commands not finite: the robot stops instead")
