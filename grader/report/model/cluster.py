"""Failures of a class with the same cause.

A cause is what a check observed without what only one student has: names, numbers, files, lines.
"""

from __future__ import annotations

import builtins
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from grader.findings.finding import Status
from grader.grade.model import points_for, total
from grader.report.model.class_row import ClassRow
from grader.report.model.result_model import CheckPart
from grader.report.text.words import cut
from grader.spec.safe_text import one_line

MOST_CHARACTERS = 300
_MOST_READ = 1000
_ANY = "…"
# Whose names mean the same in every submission, besides those of the assignment.
_PUBLIC = {*sys.stdlib_module_names, *dir(builtins), "rclpy", "rclcpp", "numpy"}
_ROS = ("_msgs", "_interfaces", "_srvs")
_FILES = ("package.xml", "setup.py", "setup.cfg", "CMakeLists.txt")
_NAMES = re.compile(r"(`|\"|(?<!\w)')(.*?)\1(?!\w)")
_FILE = re.compile(r"[\w./-]*?([\w-]+\.(?:py|xml|cfg|txt|toml|ya?ml|[ch](?:pp)?|cc))(?::\d+)*\b")
_ONE = re.compile(r"\b1 ([a-z]{4,})\b(?P<of> of \d+)?(?: (was|is|has|differs)\b)?")
_MANY = {"was": " were", "is": " are", "has": " have", "differs": " differ"}
_NUMBER = re.compile(
    r"(?<![\w.…])[-+]?\d[\d.,/e+-]*(?<![.,])(?: (?:[num]?s|min|h|[mck]?m)(?![\w/]))?"
)


def cause(check: CheckPart) -> str:
    """Why a check failed, in words that are equal for those who made the same mistake.

    It is what the check observed; names of the assignment, of ROS and of Python stay, and any
    other name, number, file and line becomes ``…``. What a person named otherwise has that name.
    """
    if check.cause:
        return check.cause

    def name(match: re.Match[str]) -> str:
        mark, text = match.groups()
        first = re.split(r"\W", text.lstrip("/"), maxsplit=1)[0]
        public = first in _PUBLIC or first.endswith(_ROS) or f"`{text}`" in check.expected
        return f"{mark}{text if public else _ANY}{mark}"

    text = cut(one_line(check.observed), _MOST_READ)
    text = _FILE.sub(lambda file: file[1] if file[1] in _FILES else _ANY, text)
    text = _ONE.sub(_several, _NAMES.sub(name, text))
    return cut(_NUMBER.sub(_ANY, text), MOST_CHARACTERS)


def _several(match: re.Match[str]) -> str:
    """``1 message was`` as ``2 messages were``: how often it happened is no other mistake."""
    return f"2 {match[1]}s{match['of'] or ''}{_MANY.get(match[3], '')}"


_NO_SHARES: Mapping[tuple[str, str], float] = {}


@dataclass(frozen=True)
class Cluster:
    """Failures of one check for one cause.

    Attributes:
        check: Id of the check.
        title: Of the check.
        cause: In words; together with ``check`` it names the cluster, also in ``class.yaml``.
        example: What the check observed of the first of them, whole.
        lost: Key of each student -> points that the check cost; in the order of the rows.
        forgiven: Share of the points that is given back now, in [0, 1].
    """

    check: str
    title: str
    cause: str
    example: str
    lost: dict[str, float]
    forgiven: float = 0.0

    @property
    def at_stake(self) -> float:
        """Points that the class lost by it."""
        return total(self.lost.values())

    def gains(self, share: float = 1.0) -> dict[str, float]:
        """What each student gets back if it is forgiven."""
        return {key: points_for(lost, share) for key, lost in self.lost.items()}


def clusters(
    rows: Sequence[ClassRow], forgiven: Mapping[tuple[str, str], float] = _NO_SHARES
) -> tuple[Cluster, ...]:
    """Group the failures of a class by check and cause, the most frequent first.

    Args:
        forgiven: Check and cause -> share of the points that is given back.
    """
    found: dict[tuple[str, str], list[tuple[str, CheckPart]]] = {}
    for row in rows:
        for check in row.judged:
            if check.status is Status.FAILED:
                found.setdefault((check.id, cause(check)), []).append((row.id, check))
    grouped = [
        Cluster(
            name,
            members[0][1].title,
            why,
            cut(one_line(_example(members[0][1])), MOST_CHARACTERS),
            {key: total((check.max_points, -check.points)) for key, check in members},
            forgiven.get((name, why), 0.0),
        )
        for (name, why), members in found.items()
    ]
    return tuple(sorted(grouped, key=lambda one: (-len(one.lost), -one.at_stake)))


def _example(check: CheckPart) -> str:
    return f"{check.cause}: {check.observed}" if check.cause else check.observed
