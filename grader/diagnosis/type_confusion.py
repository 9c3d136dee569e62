"""How one message type is taken for another."""

from __future__ import annotations

from dataclasses import dataclass

from grader.checks.wording import code
from grader.diagnosis.explanation import Symptom, explanation
from grader.spec.nearest_name import nearest

# Types that are taken for the whole of which they are a field.
_PARTS = {
    ("Twist", "Vector3"): "linear and angular",
    ("Pose", "Point"): "position",
    ("Pose", "Quaternion"): "orientation",
    ("Odometry", "Pose"): "pose.pose",
    ("Odometry", "Twist"): "twist.twist",
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
def other_package_or_case(symptom: OtherType) -> str | None:
    """The type has the right name, but is of another package, or its case differs."""
    wanted, other = symptom.names
    if wanted == other:
        return f"the same short name, but of the package {code(symptom.found.partition('/')[0])}"
    return "upper and lower case differ" if wanted.lower() == other.lower() else None


@explanation(OtherType)
def other_variant(symptom: OtherType) -> str | None:
    """The type is the Stamped, WithCovariance or Array variant, or the plain one."""
    plain, longer = sorted(symptom.names, key=len)
    words = _SUFFIXES.get(longer.removeprefix(plain))
    return f"{code(longer)} {words}, {code(plain)} is the plain message" if words else None


@explanation(OtherType)
def part_or_whole(symptom: OtherType) -> str | None:
    """The type is a part of the expected one, such as Vector3 of Twist, or the whole of it."""
    wanted, other = symptom.names
    part, whole = _PARTS.get((wanted, other)), _PARTS.get((other, wanted))
    if part:
        return f"{code(other)} is only a part of {code(wanted)} (its {part})"
    return f"{code(wanted)} is a part of it (its {whole})" if whole else None


@explanation(OtherType, general=True)
def similar_name(symptom: OtherType) -> str | None:
    """The type has a similar name."""
    wanted, other = symptom.names
    if not nearest(wanted, [other], cutoff=0.5):
        return None
    return f"{code(other)} is another message than {code(wanted)}"
