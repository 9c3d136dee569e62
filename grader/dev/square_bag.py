"""The bag of the example real_robot_bag: a TurtleBot3 drives a square, and its computer records it.

The robot is the simulator's, and its odometry drifts a little. The messages are real ones, in the
bytes that DDS sends.

python -m grader.dev.square_bag FOLDER [mcap|sqlite3]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from grader.recording.bag import BagChannel, BagMessage
from grader.recording.bag_writer import write_bag
from grader.recording.model import NS, Qos
from sim.description import DriftOptions, OdometryOptions
from sim.motion import REST, Pose, Twist, integrate
from sim.odometry import OdometrySample, WheelOdometry
from sim.robot import BURGER, next_velocity

BEGIN_NS = 1_760_000_000 * NS
STEP_S = 0.01
SIDE_M, SPEED_M_S, TURN_RAD_S = 1.0, 0.2, 0.6
# Where its odometry says that it is when the recording begins: it has driven before.
START = Pose(0.42, -0.17, 0.3)

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
ODOMETRY, TWIST = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"
RELIABLE = Qos("reliable", "volatile", "unknown", liveliness="automatic")


def command(time_s: float) -> Twist:
    """What the program commands: a side, a turn, and so on, four times; then rest."""
    side_s, turn_s = SIDE_M / SPEED_M_S, math.pi / 2.0 / TURN_RAD_S
    number, inside_s = divmod(time_s - 1.0, side_s + turn_s)
    if not 0 <= number < 4:
        return REST
    return Twist(SPEED_M_S, 0.0) if inside_s < side_s else Twist(0.0, TURN_RAD_S)


def steps() -> Iterator[tuple[int, Twist, OdometrySample]]:
    """Times from the beginning in ns, commands, and what the odometry says."""
    drift = DriftOptions.model_validate({"radius": "0.2 %", "slip": "2 mm"})
    random = np.random.default_rng(4)
    odometry = WheelOdometry(OdometryOptions(drift=drift), START, BURGER.wheel_separation_m, random)
    twist, pose = REST, START
    for number in range(3500):
        now_ns = round(number * STEP_S * NS)
        twist = next_velocity(twist, command(number * STEP_S), STEP_S, BURGER.limits)
        way_m, turn_rad = twist.linear_m_s * STEP_S, twist.angular_rad_s * STEP_S
        pose = integrate(pose, twist.linear_m_s, twist.angular_rad_s, STEP_S)
        odometry.move(way_m, turn_rad)
        yield now_ns, command(number * STEP_S), odometry.sample(now_ns, pose, twist)


def twist_message(twist: Twist) -> Any:
    """A twist as a message."""
    vector = TYPES["geometry_msgs/msg/Vector3"]
    return TYPES[TWIST](vector(twist.linear_m_s, 0.0, 0.0), vector(0.0, 0.0, twist.angular_rad_s))


def odometry_message(at_ns: int, sample: OdometrySample) -> Any:
    """What the odometry says as a message."""

    def typed(name: str, *fields: Any) -> Any:
        return TYPES[f"geometry_msgs/msg/{name}"](*fields)

    stamp = TYPES["builtin_interfaces/msg/Time"](*divmod(at_ns, NS))
    half_rad = sample.pose.yaw_rad / 2.0
    turn = typed("Quaternion", 0.0, 0.0, math.sin(half_rad), math.cos(half_rad))
    pose = typed("Pose", typed("Point", sample.pose.x_m, sample.pose.y_m, 0.0), turn)
    covariance = np.zeros(36)
    return TYPES[ODOMETRY](
        TYPES["std_msgs/msg/Header"](stamp, "odom"),
        "base_footprint",
        typed("PoseWithCovariance", pose, covariance),
        typed("TwistWithCovariance", twist_message(sample.twist), covariance),
    )


def messages() -> Iterator[BagMessage]:
    """What is recorded, some milliseconds after it was published."""
    delay = np.random.default_rng(5)
    odometry, commands = (
        BagChannel(f"/robot1/{name}", kind, STORE.hash_rihs01(kind), (RELIABLE,))
        for name, kind in (("odom", ODOMETRY), ("cmd_vel", TWIST))
    )
    for number, (time_ns, twist, sample) in enumerate(steps()):
        at_ns = BEGIN_NS + time_ns
        late_ns = round(delay.gamma(2.0, 3e6))
        if number % 5 == 0:
            data = STORE.serialize_cdr(odometry_message(at_ns, sample), ODOMETRY)
            yield BagMessage(odometry, at_ns + late_ns, at_ns, bytes(data))
        if number % 10 == 3:
            data = STORE.serialize_cdr(twist_message(twist), TWIST)
            yield BagMessage(commands, at_ns + late_ns, at_ns, bytes(data))


if __name__ == "__main__":
    definitions = {
        kind: STORE.generate_msgdef(kind, ros_version=2)[0] for kind in (ODOMETRY, TWIST)
    }
    write_bag(Path(sys.argv[1]), messages(), definitions, *sys.argv[2:])
