"""Names that a program uses and did not import, and where they are to be had."""

from __future__ import annotations

import re

from grader.checks.wording import code

_UNDEFINED = re.compile(r"name '(\w+)' is not defined")
_FROM = {
    "rclpy.action": "ActionClient ActionServer CancelResponse GoalResponse",
    "rclpy.callback_groups": "MutuallyExclusiveCallbackGroup ReentrantCallbackGroup",
    "rclpy.executors": "ExternalShutdownException MultiThreadedExecutor SingleThreadedExecutor",
    "rclpy.node": "Node",
    "rclpy.qos": "DurabilityPolicy HistoryPolicy LivelinessPolicy QoSProfile ReliabilityPolicy "
    "qos_profile_sensor_data",
    "geometry_msgs.msg": "Point Pose PoseStamped PoseWithCovarianceStamped Quaternion Transform "
    "TransformStamped Twist TwistStamped Vector3 Vector3Stamped",
    "nav_msgs.msg": "OccupancyGrid Odometry",
    "sensor_msgs.msg": "BatteryState CompressedImage Image Imu JointState LaserScan PointCloud2",
    "std_msgs.msg": "Bool Float32 Float64 Float64MultiArray Header Int32 Int64 String UInt8",
    "std_srvs.srv": "SetBool Trigger",
}
_HOMES = {name: module for module, names in _FROM.items() for name in names.split()}
_MODULES = {
    **{name: f"import {name}" for name in ("math", "os", "random", "rclpy", "sys", "time")},
    "np": "import numpy as np",
}
_ELSE = "Otherwise it is used before it is defined, or misspelt."


def import_hint(message: str) -> str | None:
    """What to try where a well-known name was not imported; None for any other name."""
    found = _UNDEFINED.match(message)
    name = found[1] if found else ""
    if name == "self":
        return (
            "There is a self only in a method that takes it, as in def timer_callback(self): look "
            "at the line's indentation, and at the brackets of the function that it is in."
        )
    if name in _HOMES:
        line = code(f"from {_HOMES[name]} import {name}")
        return f"If you mean that of ROS, import it at the top of the file: {line}. {_ELSE}"
    if name in _MODULES:
        line = code(_MODULES[name])
        return f"If you mean the module, import it at the top of the file: {line}. {_ELSE}"
    return None
