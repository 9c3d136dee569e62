"""What ``sim`` offers."""

from __future__ import annotations

import pytest

import sim

PUBLIC = [
    "Event",
    "EventKind",
    "Pose",
    "Simulation",
    "SimulatorOptions",
    "Step",
    "Twist",
    "World",
    "make_simulation",
    "parse_world",
    "read_options",
    "read_world",
]


def test_the_public_surface_is_this() -> None:
    assert sorted(sim.__all__) == sorted(PUBLIC)
    for name in PUBLIC:
        assert getattr(sim, name).__name__ == name


def test_nothing_else_is_offered() -> None:
    with pytest.raises(AttributeError, match="module 'sim' has no attribute 'Gazebo'"):
        _ = sim.Gazebo
