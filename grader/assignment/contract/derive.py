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
"""Points of which all shares but one are multiples."""
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
            elif "{" in one.spot.name and one.id.startswith(_in_ids(one.spot.name)):
                text = "its name is chosen by students, so its ids need one: write 'ids: my_part'"
                yield one.place, text
        for key, named, known, verb in (
            ("points", self.points, ids, "has"),
            ("checks", self.contract.checks, self.points, "judges"),
        ):
            for name in named:
                if name not in known:
                    advice = nearest_or_all(name, sorted(known), "Its checks are")
                    yield ("contract", key, name), f"the contract {verb} no check {name!r}.{advice}"
        for name, changed in self.contract.checks.items():
            for wrong, where in _KEPT.items():
                if wrong in changed:
                    yield ("contract", "checks", name, wrong), where
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
        """What a check requires, judged or not; for a fact not stated, what that requires."""
        for name in one.fact.requires:
            yield from self._nearest(name, one.spot)

    def _nearest(self, name: str, spot: Spot) -> Iterable[Derived]:
        here = [other for other in self.every if other.fact.name == name]
        inside = [one for one in here if one.spot.place[: len(spot.place)] == spot.place]
        for level in (spot, *spot.around):
            same = [other for other in here if other.spot.place == level.place]
            if same or (level is spot and inside):
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
        prefix = _in_ids(spot.name)
    made = f"{prefix}_{fact.name}" if prefix else fact.name
    return f"{made}_{fact.name}" if made in written else made


def _in_ids(name: str) -> str:
    """The name of a part as it stands in ids."""
    return re.sub(r"\W+", "_", name.rpartition("/")[2]).lower()


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
