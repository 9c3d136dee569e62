"""What turtles offer, by name: services and actions with their types."""

from __future__ import annotations

from collections.abc import Iterable

TWIST = "geometry_msgs/msg/Twist"
_OF_ALL = {
    "/spawn": "turtlesim/srv/Spawn",
    "/kill": "turtlesim/srv/Kill",
    "/clear": "std_srvs/srv/Empty",
    "/reset": "std_srvs/srv/Empty",
}
_OF_EACH = {
    "set_pen": "turtlesim/srv/SetPen",
    "teleport_absolute": "turtlesim/srv/TeleportAbsolute",
    "teleport_relative": "turtlesim/srv/TeleportRelative",
    "rotate_absolute": "turtlesim/action/RotateAbsolute",
}


def servers(turtles: Iterable[str]) -> dict[str, str]:
    """Name -> type of the services and actions of some turtles, and of those of all turtles."""
    own = {f"/{name}/{end}": type for name in turtles for end, type in _OF_EACH.items()}
    return _OF_ALL | own


def published(turtles: Iterable[str]) -> set[str]:
    """The topics on which some turtles publish."""
    return {f"/{name}/{end}" for name in turtles for end in ("pose", "color_sensor")}


def commands(turtles: Iterable[str]) -> dict[str, str]:
    """Topic -> type of the velocity commands of some turtles."""
    return {f"/{name}/cmd_vel": TWIST for name in turtles}
