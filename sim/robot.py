"""The robot: a differential drive with limits of speed and acceleration.

Pure functions of a state; no clock, no random numbers, no walls (see :mod:`sim.contact`).

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
from dataclasses import dataclass, replace

from sim.description import Push, RobotOptions
from sim.motion import NS, REST, Pose, Twist, integrate


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


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot and where it starts.

    Attributes:
        start: Where it starts, at rest, in the world's frame.
        command_timeout_ns: It stops when no command came for so long, or None.
        drives: Commands that it gets by itself, with the simulated time of each, in order.
        pushes: Pushes that it gets, in order of the way.
    """

    model: RobotModel
    start: Pose
    command_timeout_ns: int | None = None
    drives: tuple[tuple[int, Twist], ...] = ()
    pushes: tuple[Push, ...] = ()


@dataclass(frozen=True, slots=True)
class State:
    """A robot at a moment.

    Attributes:
        pose: In the world's frame.
    """

    pose: Pose
    twist: Twist = REST


def velocity(twist: Twist, command: Twist, dt_s: float, limits: RobotLimits) -> Twist:
    """The velocity during the next step: as near to the command as the limits allow.

    Args:
        command: What is asked for; must be finite.
        limits: What the drive can do; linear and angular are limited one by one, as
            Gazebo's DiffDrive does.
    """
    return Twist(
        _approach(
            twist.linear_m_s,
            command.linear_m_s,
            limits.speed_m_s,
            limits.acceleration_m_s2 * dt_s,
        ),
        _approach(
            twist.angular_rad_s,
            command.angular_rad_s,
            limits.angular_speed_rad_s,
            limits.angular_acceleration_rad_s2 * dt_s,
        ),
    )


def step(state: State, command: Twist, dt_s: float, limits: RobotLimits) -> State:
    """Move for one step in free space.

    The velocity changes at the beginning of the step and is constant in it, so that the path
    is an exact arc.

    Args:
        command: What is asked for; must be finite.

    Returns:
        The state after it. A robot at rest that is asked for nothing is returned as it is.
    """
    twist = velocity(state.twist, command, dt_s, limits)
    if twist == REST and state.twist == REST:
        return state
    return State(integrate(state.pose, twist.linear_m_s, twist.angular_rad_s, dt_s), twist)


def make_robot(options: RobotOptions, start: Pose) -> Robot:
    """The robot that the YAML describes, at a start pose."""
    model = MODELS[options.model]
    limits = RobotLimits(
        options.max_speed or model.limits.speed_m_s,
        options.max_angular_speed or model.limits.angular_speed_rad_s,
        options.max_acceleration or model.limits.acceleration_m_s2,
        options.max_angular_acceleration or model.limits.angular_acceleration_rad_s2,
    )
    model = replace(model, limits=limits, radius_m=options.radius or model.radius_m)
    timeout_s = options.command_timeout
    drives = ((round(one.at * NS), Twist(one.linear, one.angular)) for one in options.drives)
    return Robot(
        model,
        start,
        None if timeout_s is None else round(timeout_s * NS),
        tuple(sorted(drives, key=lambda drive: drive[0])),
        tuple(sorted(options.pushes, key=lambda push: push.after)),
    )


def _approach(now: float, wanted: float, limit: float, change: float) -> float:
    wanted = min(max(wanted, -limit), limit)
    if abs(wanted - now) <= change:
        return wanted + 0.0  # a commanded -0.0 becomes 0.0
    return now + math.copysign(change, wanted - now)
