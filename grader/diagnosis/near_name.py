"""How a name in the ROS graph misses the one that was wanted: case, namespace, spelling."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from grader.checks.finding import Evidence
from grader.checks.wording import code
from grader.diagnosis.cause import Cause
from grader.spec.nearest_name import nearest


@dataclass(frozen=True)
class Named:
    """Something of the student's that is there under another name."""

    name: str
    node: str


def why_misnamed(
    wanted: str, there: Iterable[Named], does: str, write: str, evidence: Evidence
) -> Cause | None:
    """Why nothing has the wanted name, if something has nearly that name."""
    names = tuple(there)
    for item in names:
        told = _same_but_for_its_place(wanted, item)
        if told is not None:
            why, hint = told
            found = f"{does} {code(item.name)} instead of {code(wanted)}"
            return Cause(f"{found}: {why}", hint, evidence)
    match = nearest(wanted, [item.name for item in names])
    if match is None:
        return None
    return Cause(f"{does} {code(match)} instead of {code(wanted)}", write, evidence)


def _same_but_for_its_place(wanted: str, item: Named) -> tuple[str, str] | None:
    """What differs, and what to try."""
    base = wanted.rpartition("/")[2]
    if item.name.lower() == wanted.lower():
        return (
            "upper and lower case differ",
            f"Names in ROS are case-sensitive: write '{base}'.",
        )
    if item.name == item.node + wanted:
        return (
            "a private name, below the node's own name",
            f"`~/{base}` puts the node's name in front: write '{base}', without `~/`.",
        )
    if item.name.endswith(wanted):
        return _prefixed(wanted, item)
    if wanted.endswith(item.name):
        return (
            "an absolute name, which stays outside of the node's namespace",
            f"Begin the name without `/`: '{item.name.lstrip('/')}' is relative, and ROS puts "
            "the node's namespace in front of it.",
        )
    return None


def _prefixed(wanted: str, item: Named) -> tuple[str, str]:
    prefix = item.name[: -len(wanted)]
    namespace = item.node.rpartition("/")[0]
    if namespace == prefix:
        return (
            f"the node is in the namespace {code(namespace)}, and a relative name goes there "
            "with it",
            f"Create the node without namespace, or write the absolute name '{wanted}'.",
        )
    if prefix == item.node or prefix.lstrip("/") == item.node.rpartition("/")[2]:
        return (
            "the node's name stands in front of it",
            f"Write '{wanted.lstrip('/')}', without `~/` and without the node's name.",
        )
    return (
        f"{code(prefix)} stands in front of the name",
        f"Write '{wanted.lstrip('/')}' in the code.",
    )
