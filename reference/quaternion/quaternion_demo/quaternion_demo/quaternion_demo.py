"""A node that converts rotations from one way to write them into another."""

from __future__ import annotations

import math

import rclpy
from geometry_msgs.msg import Quaternion, Vector3
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

# A sine of the pitch from which on it is 90 degrees: there, roll and yaw are one and the same.
GIMBAL_LOCK = 0.9999999


def from_axis_angle(x: float, y: float, z: float, angle: float) -> Quaternion:
    """Turn by an angle in radians about an axis of any length; about a zero axis not at all."""
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    sine = math.sin(angle / 2.0)
    return Quaternion(
        x=x / length * sine, y=y / length * sine, z=z / length * sine, w=math.cos(angle / 2.0)
    )


def from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Turn about the fixed axes x, y and z, in this order: q = q_yaw * q_pitch * q_roll."""
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return Quaternion(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def to_rpy(q: Quaternion) -> Vector3:
    """Roll, pitch and yaw in radians of a quaternion of any length; of a zero one no rotation."""
    length = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
    if length == 0.0:
        return Vector3()
    x, y, z, w = q.x / length, q.y / length, q.z / length, q.w / length
    sine = 2.0 * (w * y - z * x)
    if abs(sine) > GIMBAL_LOCK:
        return Vector3(x=0.0, y=math.copysign(math.pi / 2.0, sine), z=2.0 * math.atan2(z, w))
    return Vector3(
        x=math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        y=math.asin(sine),
        z=math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


class QuaternionDemo(Node):
    """Answers each message on three topics with the same rotation, written in another way."""

    def __init__(self) -> None:
        """Create publishers before subscriptions: a callback may be called at once."""
        super().__init__('quaternion_demo')
        self.quaternion_publisher = self.create_publisher(Quaternion, '/quaternion', 10)
        self.orientation_publisher = self.create_publisher(Quaternion, '/orientation', 10)
        self.rpy_publisher = self.create_publisher(Vector3, '/rpy_out', 10)
        self.create_subscription(Float64MultiArray, '/axis_angle', self.axis_angle_callback, 10)
        self.create_subscription(Vector3, '/rpy', self.rpy_callback, 10)
        self.create_subscription(Quaternion, '/quaternion_in', self.quaternion_callback, 10)

    def axis_angle_callback(self, message: Float64MultiArray) -> None:
        """Answer [x, y, z, angle] on /quaternion."""
        x, y, z, angle = message.data
        self.quaternion_publisher.publish(from_axis_angle(x, y, z, angle))

    def rpy_callback(self, message: Vector3) -> None:
        """Answer roll, pitch and yaw on /orientation."""
        self.orientation_publisher.publish(from_rpy(message.x, message.y, message.z))

    def quaternion_callback(self, message: Quaternion) -> None:
        """Answer a quaternion on /rpy_out."""
        self.rpy_publisher.publish(to_rpy(message))


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = QuaternionDemo()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
