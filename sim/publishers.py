"""What the simulator publishes: one class for each topic, with messages reused.

Only what changes from one message to the next is written again.
"""

from __future__ import annotations

import importlib
import math
from array import array
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan

from sim.description import OdometryOptions, SimulatorOptions
from sim.lidar import Lidar, Scan
from sim.motion import NS, Pose
from sim.odometry import OdometrySample
from sim.topic_options import TopicOptions

UNKNOWN_VARIANCE = 1e12
"""Variance of what wheels cannot measure (z, roll, pitch), as Gazebo Classic's diff drive."""


def qos_profile(options: TopicOptions) -> QoSProfile:
    """The QoS that the YAML describes."""
    # Any: rclpy is typed in parts only.
    make: Any = QoSProfile
    profile: QoSProfile = make(
        history=HistoryPolicy.KEEP_LAST,
        depth=options.depth,
        reliability=ReliabilityPolicy[options.reliability.upper()],
        durability=DurabilityPolicy[options.durability.upper()],
    )
    return profile


class OdometryPublisher:
    """Publishes nav_msgs/msg/Odometry."""

    def __init__(self, node: Node, topic: TopicOptions, options: OdometryOptions) -> None:
        """Create the publisher."""
        self._message = Odometry()
        self._message.header.frame_id = options.frame
        self._message.child_frame_id = options.child_frame
        self._is_continuous = options.continuous
        variances = options.covariance
        diagonal = (variances.x, variances.y, *[UNKNOWN_VARIANCE] * 3, variances.yaw)
        for index, variance in enumerate(diagonal):
            self._message.pose.covariance[7 * index] = variance
            self._message.twist.covariance[7 * index] = variance
        self.publisher = make_publisher(node, Odometry, topic.topic, topic)

    def publish(self, sample: OdometrySample, stamp_ns: int) -> None:
        """Publish a sample."""
        message = self._message
        set_time(message.header.stamp, stamp_ns)
        message.pose.pose.position.x = sample.pose.x_m
        message.pose.pose.position.y = sample.pose.y_m
        quaternion = message.pose.pose.orientation
        z, w = quaternion.z, quaternion.w
        set_yaw(quaternion, sample.pose.yaw_rad)
        # It still held the one before: of the two that say the same, take the nearer.
        if self._is_continuous and z * quaternion.z + w * quaternion.w < 0.0:
            quaternion.z, quaternion.w = -quaternion.z, -quaternion.w
        message.twist.twist.linear.x = sample.twist.linear_m_s
        message.twist.twist.angular.z = sample.twist.angular_rad_s
        self.publisher.publish(message)


class ScanPublisher:
    """Publishes sensor_msgs/msg/LaserScan."""

    def __init__(self, node: Node, topic: TopicOptions, lidar: Lidar) -> None:
        """Create the publisher."""
        self._has_intensities = lidar.options.intensities
        self._message = LaserScan(
            angle_min=lidar.angle_min_rad,
            angle_max=lidar.angle_max_rad,
            angle_increment=lidar.angle_increment_rad,
            scan_time=1.0 / lidar.options.rate,
            range_min=lidar.options.range_min,
            range_max=lidar.options.range_max,
        )
        self._message.header.frame_id = lidar.options.frame
        self.publisher = make_publisher(node, LaserScan, topic.topic, topic)

    def publish(self, scan: Scan, stamp_ns: int) -> None:
        """Publish a scan."""
        set_time(self._message.header.stamp, stamp_ns)
        # An array('f') is taken over as it is; a list would be checked number by number.
        self._message.ranges = array("f", scan.ranges_m.tobytes())
        if self._has_intensities:
            self._message.intensities = array("f", scan.intensities.tobytes())
        self.publisher.publish(self._message)


class ClockPublisher:
    """Publishes rosgraph_msgs/msg/Clock."""

    def __init__(self, node: Node, topic: TopicOptions) -> None:
        """Create the publisher."""
        self.publisher = make_publisher(node, Clock, topic.topic, topic)

    def publish(self, stamp_ns: int) -> None:
        """Publish a ROS time."""
        message = Clock()
        set_time(message.clock, stamp_ns)
        self.publisher.publish(message)


class TransformPublisher:
    """Publishes odom -> base_footprint, and once the frames that are fixed to the robot."""

    def __init__(self, node: Node, options: SimulatorOptions, tf: Any) -> None:
        """Create the publishers of ``tf``, the type tf2_msgs/msg/TFMessage."""
        topic = options.topics.tf
        self._moving = TransformStamped(child_frame_id=options.odometry.child_frame)
        self._moving.header.frame_id = options.odometry.frame
        self._fixed, self._of_camera = options.fixed_frames, options.camera_frames
        self._type = tf
        self._message = tf(transforms=[self._moving])
        self.publisher = make_publisher(node, tf, topic.topic, topic)
        latched = topic.model_copy(update={"durability": "transient_local", "depth": 1})
        self.static_publisher = make_publisher(node, tf, topic.static_topic, latched)

    def publish_static(self, stamp_ns: int) -> None:
        """Publish what is fixed to the robot, all in one message; late joiners get it too."""
        message = self._type()
        for parent, child, pose, z_m in self._fixed:
            transform = TransformStamped(child_frame_id=child)
            transform.header.frame_id = parent
            transform.transform.translation.z = z_m
            _set_transform(transform, pose, stamp_ns)
            message.transforms.append(transform)
        for parent, child, position, rotation in self._of_camera:
            transform = TransformStamped(child_frame_id=child)
            transform.header.frame_id = parent
            set_time(transform.header.stamp, stamp_ns)
            moved, turned = transform.transform.translation, transform.transform.rotation
            moved.x, moved.y, moved.z = position
            turned.x, turned.y, turned.z, turned.w = rotation
            message.transforms.append(transform)
        self.static_publisher.publish(message)

    def publish(self, sample: OdometrySample, stamp_ns: int) -> None:
        """Publish where odometry believes the robot to be."""
        _set_transform(self._moving, sample.pose, stamp_ns)
        self.publisher.publish(self._message)


def transform_type() -> Any | None:
    """The type tf2_msgs/msg/TFMessage, or None where tf2_msgs is not installed."""
    try:
        return importlib.import_module("tf2_msgs.msg").TFMessage
    except ImportError:
        return None


def make_publisher(node: Node, message_type: Any, name: str, options: TopicOptions) -> Any:
    """A publisher with the QoS of the options."""
    # Without event callbacks the publisher needs no executor.
    callbacks = PublisherEventCallbacks(use_default_callbacks=False)
    return node.create_publisher(
        message_type, name, qos_profile(options), event_callbacks=callbacks
    )


def _set_transform(transform: TransformStamped, pose: Pose, stamp_ns: int) -> None:
    set_time(transform.header.stamp, stamp_ns)
    transform.transform.translation.x = pose.x_m
    transform.transform.translation.y = pose.y_m
    set_yaw(transform.transform.rotation, pose.yaw_rad)


def set_time(time: Time, stamp_ns: int) -> None:
    """Write a time into a message."""
    time.sec, time.nanosec = divmod(stamp_ns, NS)


def set_yaw(quaternion: Quaternion, yaw_rad: float) -> None:
    """Write a turn around the z axis into a message."""
    quaternion.z = math.sin(0.5 * yaw_rad)
    quaternion.w = math.cos(0.5 * yaw_rad)
