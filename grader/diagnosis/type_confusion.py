"""How one message type is taken for another."""

from __future__ import annotations

from dataclasses import dataclass

from grader.checks.wording import code
from grader.diagnosis.explanation import Symptom, explanation
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


@dataclass(frozen=True)
class OtherType(Symptom[str]):
    """A topic has another message type than is expected.

    The explanations answer with a clause.
    """

    expected: str
    found: str

    @property
    def names(self) -> tuple[str, str]:
        """Both without their packages."""
        return self.expected.rpartition("/")[2], self.found.rpartition("/")[2]


@explanation(OtherType)
def other_package(symptom: OtherType) -> str | None:
    """The type has the right name, but is of another package."""
    wanted, other = symptom.names
    if wanted != other:
        return None
    return f"the same short name, but of the package {code(symptom.found.partition('/')[0])}"


@explanation(OtherType)
def other_case(symptom: OtherType) -> str | None:
    """Upper and lower case of the type's name differ."""
    wanted, other = symptom.names
    return "upper and lower case differ" if wanted.lower() == other.lower() else None


@explanation(OtherType)
def other_variant(symptom: OtherType) -> str | None:
    """The type is the Stamped, WithCovariance or Array variant, or the plain one."""
    wanted, other = symptom.names
    for suffix, words in _SUFFIXES.items():
        if other == wanted + suffix:
            return f"{code(other)} {words}, {code(wanted)} is the plain message"
        if wanted == other + suffix:
            return f"{code(wanted)} {words}, {code(other)} is the plain message"
    return None


@explanation(OtherType)
def part_or_whole(symptom: OtherType) -> str | None:
    """The type is a part of the expected one, such as Vector3 of Twist, or the whole of it."""
    wanted, other = symptom.names
    part = _PARTS.get((symptom.expected, symptom.found))
    if part:
        return f"{code(other)} is only a part of {code(wanted)} (its {part})"
    whole = _PARTS.get((symptom.found, symptom.expected))
    return f"{code(wanted)} is a part of it (its {whole})" if whole else None


@explanation(OtherType, general=True)
def similar_name(symptom: OtherType) -> str | None:
    """The type has a similar name."""
    wanted, other = symptom.names
    if not nearest(wanted, [other], cutoff=0.5):
        return None
    return f"{code(other)} is another message than {code(wanted)}"
