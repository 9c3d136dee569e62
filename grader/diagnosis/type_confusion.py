"""How one message type is taken for another."""

from __future__ import annotations

from grader.checks.wording import code
from grader.spec.nearest_name import nearest

# Types that are fields of others, and so are taken for the whole.
_PARTS = {
    ("geometry_msgs/msg/Twist", "geometry_msgs/msg/Vector3"): "linear and angular",
    ("geometry_msgs/msg/Accel", "geometry_msgs/msg/Vector3"): "linear and angular",
    ("geometry_msgs/msg/Wrench", "geometry_msgs/msg/Vector3"): "force and torque",
    ("geometry_msgs/msg/Pose", "geometry_msgs/msg/Point"): "position",
    ("geometry_msgs/msg/Pose", "geometry_msgs/msg/Quaternion"): "orientation",
    ("geometry_msgs/msg/Transform", "geometry_msgs/msg/Vector3"): "translation",
    ("geometry_msgs/msg/Transform", "geometry_msgs/msg/Quaternion"): "rotation",
    ("nav_msgs/msg/Odometry", "geometry_msgs/msg/Pose"): "pose.pose",
    ("nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"): "twist.twist",
    ("nav_msgs/msg/Path", "geometry_msgs/msg/PoseStamped"): "poses",
}
_SUFFIXES = {
    "Stamped": "adds a header with a time and a frame",
    "WithCovariance": "adds a covariance",
    "Array": "holds many of them",
}


def explain(expected: str, found: str) -> str:
    """Say in a clause how the two types are related, or nothing."""
    wanted, other = expected.rpartition("/")[2], found.rpartition("/")[2]
    if wanted == other:
        return f"the same short name, but of the package {code(found.partition('/')[0])}"
    if wanted.lower() == other.lower():
        return "upper and lower case differ"
    for suffix, words in _SUFFIXES.items():
        if other == wanted + suffix:
            return f"{code(other)} {words}, {code(wanted)} is the plain message"
        if wanted == other + suffix:
            return f"{code(wanted)} {words}, {code(other)} is the plain message"
    part = _PARTS.get((expected, found))
    if part:
        return f"{code(other)} is only a part of {code(wanted)} (its {part})"
    whole = _PARTS.get((found, expected))
    if whole:
        return f"{code(wanted)} is a part of it (its {whole})"
    if nearest(wanted, [other], cutoff=0.5):
        return f"{code(other)} is another message than {code(wanted)}"
    return ""
