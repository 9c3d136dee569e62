"""The robot: a differential drive with limits of speed and acceleration.

Sources of the figures:

- Speeds, wheel separation: ROBOTIS e-Manual, TurtleBot3, "Features", Hardware Specifications
  (https://emanual.robotis.com/docs/en/platform/turtlebot3/features/).
- Wheel separation and radius again, linear acceleration 1.0 m/s²: the DiffDrive system in
  ``turtlebot3_gazebo/models/turtlebot3_{burger,waffle}/model.sdf`` of
  ROBOTIS-GIT/turtlebot3_simulations. That file leaves braking and turning unlimited; here the
  same limit holds for braking (our choice: a robot that stops within one step would teach
  the wrong thing).
- Angular acceleration 3.2 rad/s² and radius of the footprint: ``acc_lim_theta`` and
  ``robot_radius`` in ``turtlebot3_navigation2/param/{burger,waffle}.yaml`` of
  ROBOTIS-GIT/turtlebot3 (for the Waffle the radius of the global costmap).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from sim.description import RobotOptions, SimulatorOptions
from sim.motion import Twist
from sim.shapes import Body
from sim.world import World


@dataclass(frozen=True, slots=True)
class RobotLimits:
    """What the drive can do, the same forwards and backwards."""

    speed_m_s: float
    angular_speed_rad_s: float
    acceleration_m_s2: float
    angular_acceleration_rad_s2: float


@dataclass(frozen=True, slots=True)
class RobotModel:
    """A kind of robot.

    Attributes:
        name: As in TURTLEBOT3_MODEL.
        radius_m: Radius of its circular footprint around base_footprint.
    """

    name: str
    limits: RobotLimits
    radius_m: float
    wheel_separation_m: float


BURGER = RobotModel("burger", RobotLimits(0.22, 2.84, 1.0, 3.2), 0.10, 0.160)
WAFFLE = RobotModel("waffle", RobotLimits(0.26, 1.82, 1.0, 3.2), 0.22, 0.287)
MODELS = {model.name: model for model in (BURGER, WAFFLE)}


def robot_model(options: RobotOptions) -> RobotModel:
    """The robot that the YAML describes."""
    model = MODELS[options.model]
    limits = RobotLimits(
        options.max_speed or model.limits.speed_m_s,
        options.max_angular_speed or model.limits.angular_speed_rad_s,
        options.max_acceleration or model.limits.acceleration_m_s2,
        options.max_angular_acceleration or model.limits.angular_acceleration_rad_s2,
    )
    return replace(model, limits=limits, radius_m=options.radius or model.radius_m)


def starting(world: World, robots: Mapping[str, SimulatorOptions]) -> dict[str, Body]:
    """The footprints of robots where they start, by their names.

    Raises:
        AssignmentError: One starts inside a wall or another robot.
    """
    found = {
        name: Body(name, one.start(world.start), robot_model(one.robot).radius_m)
        for name, one in robots.items()
    }
    for name, body in found.items():
        replace(world, bodies=others(found, name)).check_start(body.pose, body.radius_m)
    return found


def others(bodies: Mapping[str, Body], name: str) -> tuple[Body, ...]:
    """All robots but one."""
    return tuple(body for other, body in bodies.items() if other != name)


def next_velocity(twist: Twist, command: Twist, dt_s: float, limits: RobotLimits) -> Twist:
    """The velocity during the next step: as near to the command as the limits allow.

    Linear and angular velocity are limited one by one, as by Gazebo's DiffDrive.

    Args:
        command: What is asked for; must be finite.
    """
    change, turn = limits.acceleration_m_s2 * dt_s, limits.angular_acceleration_rad_s2 * dt_s
    return Twist(
        _approach(twist.linear_m_s, command.linear_m_s, limits.speed_m_s, change),
        _approach(twist.angular_rad_s, command.angular_rad_s, limits.angular_speed_rad_s, turn),
    )


def _approach(now: float, wanted: float, limit: float, change: float) -> float:
    wanted = min(max(wanted, -limit), limit)
    if abs(wanted - now) <= change:
        return wanted + 0.0  # a commanded -0.0 becomes 0.0
    return now + math.copysign(change, wanted - now)
