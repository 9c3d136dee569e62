"""The simulator: a world, a robot, a LiDAR and odometry, deterministic and without ROS.

Only :mod:`sim.node`, :mod:`sim.publishers` and :mod:`sim.live` import rclpy, and nothing here
imports them. The names below are the public surface; they are imported when they are first
used, so that reading a world needs no numpy.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim.description import SimulatorOptions, read_options
    from sim.motion import Pose, Twist
    from sim.simulation import Event, EventKind, Simulation, Step, make_simulation
    from sim.world import World, parse_world, read_world

__all__ = [
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

_HOMES = {
    "sim.description": ("SimulatorOptions", "read_options"),
    "sim.motion": ("Pose", "Twist"),
    "sim.simulation": ("Event", "EventKind", "Simulation", "Step", "make_simulation"),
    "sim.world": ("World", "parse_world", "read_world"),
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    for module, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
