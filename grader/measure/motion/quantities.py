"""Measures of motion as people read them, each with its unit."""

from __future__ import annotations

import math

_SIDES = ("ahead", "on its left", "behind it", "on its right")


def metres(length_m: float) -> str:
    """Write a length: ``1.25 m``, ``3.2 cm`` or ``0.4 mm``, three digits."""
    size = abs(length_m)
    if size >= 0.1:
        return f"{length_m:.3g} m"
    if size >= 1e-3:
        return f"{length_m * 1e2:.3g} cm"
    return f"{length_m * 1e3:.2g} mm" if size else "0 m"


def speed(speed_m_s: float) -> str:
    """Write a speed: ``0.1 m/s``."""
    return f"{speed_m_s:.3g} m/s"


def turn(speed_rad_s: float) -> str:
    """Write an angular speed: ``0.5 rad/s``."""
    return f"{round(speed_rad_s, 6) + 0.0:.3g} rad/s"


def degrees(angle_rad: float) -> str:
    """Write an angle: ``90°``, ``2.5°``."""
    shown = math.degrees(angle_rad)
    return f"{shown:.0f}°" if abs(shown) >= 10.0 else f"{shown:.2g}°"


def point(x_m: float, y_m: float) -> str:
    """Write a position in the world's frame: ``(1.20, -0.35) m``."""
    return f"({x_m + 0.0:.2f}, {y_m + 0.0:.2f}) m"


def side(bearing_rad: float) -> str:
    """Write where something is as seen from the robot, by its bearing from straight ahead."""
    return _SIDES[round(math.remainder(bearing_rad, math.tau) / (math.pi / 2.0)) % 4]
