"""What the sensors besides LiDAR and odometry publish: one function for each kind of message."""

from __future__ import annotations

import math
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import BatteryState, Imu, JointState, Range

from sim import sensors
from sim.publishers import make_publisher, set_time, set_yaw
from sim.sensor_options import BatteryOptions, ImuOptions, JointOptions, RangeOptions

_EMPTY_V, _FULL_V, _NOMINAL_AH = 9.9, 12.6, 1.8
"""Three cells of lithium polymer, of 3.3 to 4.2 V each."""


class SensorPublisher:
    """Publishes what a sensor measured, in a message that is reused."""

    def __init__(self, node: Node, sensor: sensors.Sensor) -> None:
        """Create the publisher."""
        make, self._fill = _KINDS[type(sensor)]
        self._message = make(sensor.options)
        self._message.header.frame_id = sensor.options.frame
        topic = sensor.options.topic
        self.publisher = make_publisher(node, type(self._message), topic, sensor.options)

    def publish(self, reading: Any, stamp_ns: int) -> None:
        """Publish a reading."""
        set_time(self._message.header.stamp, stamp_ns)
        self._fill(self._message, reading)
        self.publisher.publish(self._message)


def _imu(options: ImuOptions) -> Imu:
    message = Imu()
    for axis in range(3):
        message.angular_velocity_covariance[4 * axis] = options.noise.angular**2
        message.linear_acceleration_covariance[4 * axis] = options.noise.linear**2
    return message


def _fill_imu(message: Imu, reading: sensors.Inertia) -> None:
    set_yaw(message.orientation, reading.yaw_rad)
    message.angular_velocity.z = reading.angular_rad_s
    message.linear_acceleration.x = reading.ahead_m_s2
    message.linear_acceleration.y = reading.left_m_s2
    message.linear_acceleration.z = reading.up_m_s2


def _joints(options: JointOptions) -> JointState:
    return JointState(name=["wheel_left_joint", "wheel_right_joint"])


def _fill_joints(message: JointState, reading: sensors.Joints) -> None:
    message.position, message.velocity = [*reading.angles_rad], [*reading.speeds_rad_s]


def _battery(options: BatteryOptions) -> BatteryState:
    return BatteryState(
        temperature=math.nan,
        current=math.nan,
        capacity=_NOMINAL_AH,
        design_capacity=_NOMINAL_AH,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_GOOD,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
        present=True,
    )


def _fill_battery(message: BatteryState, share: float) -> None:
    message.percentage, message.charge = share, share * _NOMINAL_AH
    message.voltage = _EMPTY_V + share * (_FULL_V - _EMPTY_V)


def _range(options: RangeOptions) -> Range:
    is_sound = options.radiation == "ultrasound"
    return Range(
        radiation_type=Range.ULTRASOUND if is_sound else Range.INFRARED,
        field_of_view=options.fov,
        min_range=options.range_min,
        max_range=options.range_max,
        variance=options.noise**2,
    )


def _fill_range(message: Range, distance_m: float) -> None:
    message.range = distance_m


_KINDS: dict[type, tuple[Any, Any]] = {
    sensors.Imu: (_imu, _fill_imu),
    sensors.Wheels: (_joints, _fill_joints),
    sensors.Battery: (_battery, _fill_battery),
    sensors.DistanceSensor: (_range, _fill_range),
}
"""For each kind of sensor: how its message is made, and how a reading is written into it."""
