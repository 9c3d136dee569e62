"""The checks that a contract stands for, with their ids, points and what each requires."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from grader.assignment.contract.model import Contract
from grader.assignment.contract.spot import Fact, Spot
from grader.assignment.contract.standard import spots
from grader.findings.words import Words
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all

_STEP = 0.05
"""Points of which all shares but one are multiples."""
_ROUNDING = 1e-9
"""A share that is a step short by the rounding of floats is that step."""
_OTHER = "a standard check keeps it: write another check among 'checks'"
_KEPT = {
    **dict.fromkeys(("id", "uses", "python"), _OTHER),
    "points": "its points stand under 'points'",
    "visibility": "the contract is what students are told: write a hidden check among 'checks'",
}


@dataclass(frozen=True)
class Derived:
    """A standard check of a contract."""

    id: str
    fact: Fact
    spot: Spot
    asked: Mapping[str, Any]

    @property
    def place(self) -> Place:
        """The part of the contract that it comes from."""
        return self.spot.place


class Derivation:
    """All standard checks of a contract, and what does not fit together in it."""

    def __init__(self, contract: Contract) -> None:
        self.contract = contract
        said = [
            (spot, fact, asked)
            for spot, facts in spots(contract)
            for fact in facts
            if (asked := fact.asked(spot)) is not None
        ]
        authors_ids = {name for spot, _, _ in said for name in _own_ids(spot).values()}
        times = Counter(fact.name for spot, fact, _ in said if fact.name not in _own_ids(spot))
        self.every = tuple(
            Derived(_id(spot, fact, times[fact.name] > 1, authors_ids), fact, spot, asked)
            for spot, fact, asked in said
        )

    @cached_property
    def kept(self) -> tuple[Derived, ...]:
        """Those that are judged, in the order of the contract."""
        return tuple(check for check in self.every if check.id in self.points)

    @cached_property
    def points(self) -> Mapping[str, float]:
        """The points of those that are judged, by id."""
        points = self.contract.points
        return points if isinstance(points, dict) else _shared(points, self.every)

    def entry(self, check: Derived) -> dict[str, Any]:
        """A check as an author would write it."""
        words = check.spot.words
        asked = {**check.asked, **self._taken_over(check)}
        is_of_run = bool(check.spot.executable) and check.fact.uses != "package.executable"
        entry: dict[str, Any] = {
            "id": check.id,
            "title": check.fact.title.format(**words),
            "uses": check.fact.uses,
            "with": asked,
            "scenarios": list(check.spot.program.scenarios) if is_of_run else [],
            "points": self.points[check.id],
            "requires": list(dict.fromkeys(required.id for required in self._required(check))),
            "hint": _filled(check.fact.hint, words),
        }
        changes = self.contract.checks.get(check.id, {})
        entry |= changes
        if isinstance(changes.get("with"), dict):
            parameters = {**asked, **changes["with"]}
            entry["with"] = {key: value for key, value in parameters.items() if value is not None}
        return {key: value for key, value in entry.items() if value not in ([], {})}

    def _taken_over(self, check: Derived) -> dict[str, Any]:
        """A topic's check that is not judged leaves it to that of its type to take a near name."""
        openers = (before for before in self._before(check) if before.asked.get("remap"))
        opener = next(openers, None)
        if check.fact.uses != "topic.type" or opener is None or opener in self.kept:
            return {}
        return {"remap": True}

    def problems(self) -> Iterator[tuple[Place, str]]:
        """What contradicts itself."""
        ids = Counter(check.id for check in self.every)
        for check in self.every:
            if ids[check.id] > 1:
                fact = check.fact.name
                yield (
                    check.place,
                    f"two checks of the contract would have the id {check.id!r}: give one of their "
                    f"parts 'ids', such as 'ids: {{{fact}: my_{fact}}}'",
                )
            elif "{" in check.spot.name and check.id.startswith(_in_ids(check.spot.name)):
                text = "its name is chosen by students, so its ids need one: write 'ids: my_part'"
                yield check.place, text
        yield from self._unknown("points", self.points, ids, "has")
        yield from self._unknown("checks", self.contract.checks, self.points, "judges")
        for name, changes in self.contract.checks.items():
            for key, advice in _KEPT.items():
                if key in changes:
                    yield ("contract", "checks", name, key), advice
        for spot, _ in spots(self.contract):
            yield from self._unknown_ids(spot)

    def _unknown(
        self, key: str, names: Collection[str], known: Collection[str], verb: str
    ) -> Iterator[tuple[Place, str]]:
        for name in names:
            if name not in known:
                advice = nearest_or_all(name, sorted(known), "Its checks are")
                yield ("contract", key, name), f"the contract {verb} no check {name!r}.{advice}"

    def _unknown_ids(self, spot: Spot) -> Iterator[tuple[Place, str]]:
        known = {check.fact.name for check in self.every if check.place == spot.place}
        for name in _own_ids(spot):
            if name not in known:
                advice = nearest_or_all(name, sorted(known), "It has")
                yield (*spot.place, "ids", name), f"nothing here makes a check {name!r}.{advice}"

    def _required(self, check: Derived) -> Iterator[Derived]:
        """What a check requires; in place of what is not judged, what that requires."""
        for before in self._before(check):
            if before in self.kept:
                yield before
            else:
                yield from self._required(before)

    def _before(self, check: Derived) -> Iterator[Derived]:
        """What a check requires, judged or not."""
        for name in check.fact.requires:
            yield from self._nearest(name, check.spot)

    def _nearest(self, name: str, spot: Spot) -> list[Derived]:
        """The checks of a fact that is required at a part: of the nearest part that has some.

        That is the part itself, else what lies in it, else the parts around it. Where the contract
        does not say the fact, what that fact requires stands for it.
        """
        of_fact = [check for check in self.every if check.fact.name == name]
        at_part = [check for check in of_fact if check.place == spot.place]
        inside = [check for check in of_fact if check.place[: len(spot.place)] == spot.place]
        if at_part or inside:
            return at_part or inside
        for outer in spot.around:
            at_outer = [check for check in of_fact if check.place == outer.place]
            if at_outer:
                return at_outer
        if name == "generated":
            # Interfaces lie in other packages, on which this one depends.
            packages = spot.of_package.depends
            return [check for check in of_fact if check.spot.package in packages]
        near = (facts for other, facts in spots(self.contract) if _is_near(other, spot))
        unsaid = next((fact for facts in near for fact in facts if fact.name == name), None)
        steps = unsaid.requires if unsaid is not None else ()
        return [check for step in steps for check in self._nearest(step, spot)]


def _is_near(other: Spot, spot: Spot) -> bool:
    """Whether a part is the other one, lies around it, or lies in it."""
    shorter = min(len(other.place), len(spot.place))
    return other.place[:shorter] == spot.place[:shorter]


def _id(spot: Spot, fact: Fact, has_several: bool, authors_ids: Collection[str]) -> str:
    """The id of a check: the author's, or the fact with a name before it where several have it."""
    own = _own_ids(spot)
    if fact.name in own:
        return own[fact.name]
    ids = [part.part.ids for part in (spot, *spot.around)]
    prefix = next((prefix for prefix in ids if isinstance(prefix, str) and prefix), "")
    if not prefix and has_several:
        prefix = _in_ids(spot.name)
    id_ = f"{prefix}_{fact.name}" if prefix else fact.name
    return f"{id_}_{fact.name}" if id_ in authors_ids else id_


def _in_ids(name: str) -> str:
    """The name of a part as it stands in ids."""
    return re.sub(r"\W+", "_", name.rpartition("/")[2]).lower()


def _shared(total: float, checks: Collection[Derived]) -> dict[str, float]:
    """Points for all, by weight, in steps of 0.05; the heaviest gets what is left over."""
    weights = sum(check.fact.weight for check in checks)
    shares = {}
    for check in checks:
        share = total * check.fact.weight / weights
        shares[check.id] = math.floor(share / _STEP + _ROUNDING) * _STEP
    heaviest = max(checks, key=lambda check: check.fact.weight)
    shares[heaviest.id] += total - math.fsum(shares.values())
    return {name: round(points, 6) for name, points in shares.items()}


def _filled(hint: str | Words, words: Mapping[str, str]) -> str | dict[str, str]:
    """A hint as an author would write it."""
    if isinstance(hint, str):
        return hint.format(**words)
    return {"python": hint.python.format(**words), "cpp": hint.cpp.format(**words)}


def _own_ids(spot: Spot) -> Mapping[str, str]:
    """The ids that the author gives, by fact."""
    return spot.part.ids if isinstance(spot.part.ids, dict) else {}
