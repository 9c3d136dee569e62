"""The checks that a contract stands for, with their ids, points and what each requires."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from grader.assignment.contract.model import Contract
from grader.assignment.contract.standard import Fact, Spot, spots
from grader.findings.words import Words
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all

_STEP = 0.05


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
        written = {name for spot, _, _ in said for name in _own_ids(spot).values()}
        times = Counter(fact.name for spot, fact, _ in said if fact.name not in _own_ids(spot))
        self.every = tuple(
            Derived(_id(spot, fact, times[fact.name] > 1, written), fact, spot, asked)
            for spot, fact, asked in said
        )

    @cached_property
    def kept(self) -> tuple[Derived, ...]:
        """Those that are judged, in the order of the contract."""
        return tuple(one for one in self.every if one.id in self.points)

    @cached_property
    def points(self) -> Mapping[str, float]:
        """The points of those that are judged, by id."""
        given = self.contract.points
        return given if isinstance(given, dict) else _shared(given, self.every)

    def entry(self, one: Derived) -> dict[str, Any]:
        """A check as an author would write it."""
        words = one.spot.words
        asked = dict(one.asked)
        opened = next((other for other in self._before(one) if other.asked.get("remap")), None)
        if opened is not None and opened not in self.kept and one.fact.uses == "topic.type":
            asked["remap"] = True
        entry: dict[str, Any] = {
            "id": one.id,
            "title": one.fact.title.format(**words),
            "uses": one.fact.uses,
            "with": asked,
            "scenarios": list(one.spot.program.scenarios) if self._is_of_a_run(one) else [],
            "points": self.points[one.id],
            "requires": list(dict.fromkeys(found.id for found in self._required(one))),
            "hint": _filled(one.fact.hint, words),
        }
        other = self.contract.checks.get(one.id, {})
        if isinstance(other.get("with"), dict):
            changed = {**asked, **other["with"]}
            other = {**other, "with": {key: one for key, one in changed.items() if one is not None}}
        return {name: value for name, value in {**entry, **other}.items() if value not in ([], {})}

    def problems(self) -> Iterator[tuple[Place, str]]:
        """What contradicts itself."""
        ids = Counter(one.id for one in self.every)
        for one in self.every:
            if ids[one.id] > 1:
                yield (
                    one.place,
                    f"two checks of the contract would have the id {one.id!r}: give one of their "
                    f"parts 'ids', such as 'ids: {{{one.fact.name}: my_{one.fact.name}}}'",
                )
        for key, named in (("points", self.points), ("checks", self.contract.checks)):
            for name in named:
                if name not in ids:
                    advice = nearest_or_all(name, sorted(ids), "Its checks are")
                    yield ("contract", key, name), f"the contract has no check {name!r}.{advice}"
        for name, changed in self.contract.checks.items():
            for wrong in ("id", "uses", "python", "points"):
                if wrong in changed:
                    where = "under 'points'" if wrong == "points" else "among 'checks'"
                    yield (
                        ("contract", "checks", name, wrong),
                        f"a standard check keeps its {wrong!r}: write another one {where}",
                    )
        for spot, _ in spots(self.contract):
            yield from self._unknown_ids(spot)

    def _unknown_ids(self, spot: Spot) -> Iterator[tuple[Place, str]]:
        known = {one.fact.name for one in self.every if one.place == spot.place}
        for name in _own_ids(spot):
            if name not in known:
                advice = nearest_or_all(name, sorted(known), "It has")
                yield (*spot.place, "ids", name), f"nothing here makes a check {name!r}.{advice}"

    def _is_of_a_run(self, one: Derived) -> bool:
        return bool(one.spot.executable) and one.fact.uses != "package.executable"

    def _required(self, one: Derived) -> Iterator[Derived]:
        for other in self._before(one):
            if other in self.kept:
                yield other
            else:
                yield from self._required(other)

    def _before(self, one: Derived) -> Iterator[Derived]:
        """What a check requires, left out or not; what the contract does not say is stood for."""
        for name in one.fact.requires:
            yield from self._nearest(name, one.spot)

    def _nearest(self, name: str, spot: Spot) -> Iterable[Derived]:
        here = [other for other in self.every if other.fact.name == name]
        for level in (spot, *spot.around):
            same = [other for other in here if other.spot.place == level.place]
            inside = [
                other for other in here if other.spot.place[: len(level.place)] == level.place
            ]
            if same or inside:
                return same or inside
        if name == "generated":
            needed = spot.of_package.depends
            return [other for other in here if other.spot.package in needed]
        facts = [
            fact for level, every in spots(self.contract) for fact in every if _near(level, spot)
        ]
        unsaid = next((fact for fact in facts if fact.name == name), None)
        return (
            []
            if unsaid is None
            else [found for step in unsaid.requires for found in self._nearest(step, spot)]
        )


def _near(level: Spot, spot: Spot) -> bool:
    """Whether a part is another one's own, lies around it, or lies in it."""
    shorter = min(len(level.place), len(spot.place))
    return level.place[:shorter] == spot.place[:shorter]


def _id(spot: Spot, fact: Fact, several: bool, written: Collection[str]) -> str:
    """The id of a check: the author's, or the fact with a name before it where several have it."""
    own = _own_ids(spot)
    if fact.name in own:
        return own[fact.name]
    prefixes = [level.part.ids for level in (spot, *spot.around) if isinstance(level.part.ids, str)]
    prefix = next(filter(None, prefixes), "")
    if not prefix and several:
        prefix = re.sub(r"\W+", "_", spot.name.rpartition("/")[2]).lower()
    made = f"{prefix}_{fact.name}" if prefix else fact.name
    return f"{made}_{fact.name}" if made in written else made


def _shared(total: float, every: Collection[Derived]) -> dict[str, float]:
    """Points for all, by weight, in steps of 0.05; the heaviest gets what is left over."""
    weights = sum(one.fact.weight for one in every)
    shares: dict[str, float] = {
        one.id: math.floor(total * one.fact.weight / weights / _STEP + 1e-9) * _STEP
        for one in every
    }
    heaviest = max(every, key=lambda one: one.fact.weight)
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
