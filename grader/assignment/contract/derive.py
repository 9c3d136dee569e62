"""The standard checks of a contract, with their ids, their points and what each requires.

From this contract::

    packages: {bot: {executables: {bot_pub: {publishes: {/cmd_vel: {type: Twist}}}}}}
    points: {starts: 1, type: 2}

each fact of ``standard.py`` that it says makes a check: ``package``, ``builds`` and
``dependencies`` of the package, ``executable``, ``starts`` and ``alive`` of the program, ``topic``
and ``type`` of the topic. Only ``starts`` and ``type`` have points, so only they are judged. The
fact ``type`` requires ``topic``, which is not judged; ``topic`` requires ``starts``: so the check
``type`` requires the check ``starts``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from grader.assignment.contract.check_ids import CheckIds, Said, ids_by_fact, in_ids
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
_UNCHANGEABLE = {
    **dict.fromkeys(
        ("id", "uses", "python"),
        "a standard check keeps it: write another check among 'checks'",
    ),
    "points": "its points stand under 'points'",
    "visibility": "the contract is what students are told: write a hidden check among 'checks'",
}
"""Keys of a standard check that its author cannot change, and what to do instead."""


@dataclass(frozen=True)
class StandardCheck:
    """A check that a contract makes, judged or not.

    Attributes:
        spot: The part of the contract that it is about.
        parameters: What stands under ``with``, before the author's changes.
    """

    id: str
    spot: Spot
    fact: Fact
    parameters: Mapping[str, Any]

    @property
    def place(self) -> Place:
        """The part of the contract that it comes from."""
        return self.spot.place


class Derivation:
    """The standard checks of a contract, and what does not fit together in it.

    Attributes:
        checks: All of them, judged or not, in the order of the contract.
    """

    def __init__(self, contract: Contract) -> None:
        self.contract = contract
        said = [
            Said(spot, fact, parameters)
            for spot, facts in spots(contract)
            for fact in facts
            if (parameters := fact.asked(spot)) is not None
        ]
        ids = CheckIds(said)
        self.checks = tuple(StandardCheck(ids.id_of(one), *one) for one in said)

    @cached_property
    def judged(self) -> tuple[StandardCheck, ...]:
        """Those that have points, in the order of the contract."""
        return tuple(check for check in self.checks if self._is_judged(check))

    @cached_property
    def points(self) -> Mapping[str, float]:
        """The points of those that are judged, by id."""
        points = self.contract.points
        return points if isinstance(points, dict) else _shared(points, self.checks)

    def _is_judged(self, check: StandardCheck) -> bool:
        return check.id in self.points

    def entry(self, check: StandardCheck) -> dict[str, Any]:
        """A check as an author would write it."""
        words = check.spot.words
        parameters = dict(check.parameters)
        if self._takes_remap_over(check):
            parameters["remap"] = True
        is_of_run = bool(check.spot.executable) and not check.fact.is_before_runs
        entry: dict[str, Any] = {
            "id": check.id,
            "title": check.fact.title.format(**words),
            "uses": check.fact.uses,
            "with": parameters,
            "scenarios": list(check.spot.program.scenarios) if is_of_run else [],
            "points": self.points[check.id],
            "requires": list(dict.fromkeys(required.id for required in self._required(check))),
            "hint": _filled(check.fact.hint, words),
        }
        changes = self.contract.checks.get(check.id, {})
        entry |= changes
        if isinstance(changes.get("with"), dict):
            parameters |= changes["with"]
            entry["with"] = {key: value for key, value in parameters.items() if value is not None}
        return {key: value for key, value in entry.items() if value not in ([], {})}

    def _takes_remap_over(self, check: StandardCheck) -> bool:
        """Whether a nearly right name is put right here, as the check that does so is not judged.

        Such as ``type`` where ``topic`` has no points.
        """
        if not check.fact.may_take_remap_over:
            return False
        renaming = [one for one in self._required_facts(check) if one.parameters.get("remap")]
        return bool(renaming) and not self._is_judged(renaming[0])

    def problems(self) -> Iterator[tuple[Place, str]]:
        """What contradicts itself."""
        ids = Counter(check.id for check in self.checks)
        for check in self.checks:
            if ids[check.id] > 1:
                fact = check.fact.name
                yield (
                    check.place,
                    f"two checks of the contract would have the id {check.id!r}: give one of their "
                    f"parts 'ids', such as 'ids: {{{fact}: my_{fact}}}'",
                )
            elif "{" in check.spot.name and check.id.startswith(in_ids(check.spot.name)):
                text = "its name is chosen by students, so its ids need one: write 'ids: my_part'"
                yield check.place, text
        yield from self._unknown("points", self.points, ids, "has")
        yield from self._unknown("checks", self.contract.checks, self.points, "judges")
        for name, changes in self.contract.checks.items():
            for key, advice in _UNCHANGEABLE.items():
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
        known = {check.fact.name for check in self.checks if check.place == spot.place}
        for name in ids_by_fact(spot):
            if name not in known:
                advice = nearest_or_all(name, sorted(known), "It has")
                yield (*spot.place, "ids", name), f"nothing here makes a check {name!r}.{advice}"

    def _required(self, check: StandardCheck) -> Iterator[StandardCheck]:
        """The judged checks that a check requires; in place of another, what that requires."""
        for required in self._required_facts(check):
            if self._is_judged(required):
                yield required
            else:
                yield from self._required(required)

    def _required_facts(self, check: StandardCheck) -> Iterator[StandardCheck]:
        """The checks, judged or not, of the facts that the fact of a check requires."""
        for name in check.fact.requires:
            yield from self._nearest(name, check.spot)
        for name in check.fact.requires_in_depends:
            of_fact = self._of_fact(name)
            yield from _inside(of_fact, check.spot) or _in_depends(of_fact, check.spot)

    def _nearest(self, name: str, spot: Spot) -> list[StandardCheck]:
        """The checks of a fact that a part requires, of the nearest part that has some.

        A service asks for ``node`` of its program. Where no name of a node is said, it asks
        for what ``node`` requires, which is ``starts``.
        """
        of_fact = self._of_fact(name)
        return (
            _at(of_fact, spot)
            or _inside(of_fact, spot)
            or _around(of_fact, spot)
            or self._required_by_unsaid(name, spot)
        )

    def _of_fact(self, name: str) -> list[StandardCheck]:
        return [check for check in self.checks if check.fact.name == name]

    def _required_by_unsaid(self, name: str, spot: Spot) -> list[StandardCheck]:
        """What stands for a fact that could be said near a part, but is not: what it requires."""
        facts_near = (facts for near, facts in spots(self.contract) if _is_near(near, spot))
        unsaid = next((fact for facts in facts_near for fact in facts if fact.name == name), None)
        names = unsaid.requires if unsaid is not None else ()
        return [check for name in names for check in self._nearest(name, spot)]


def _at(checks: list[StandardCheck], spot: Spot) -> list[StandardCheck]:
    """Those of the part itself: of a topic for ``type``, which requires ``topic``."""
    return [check for check in checks if check.place == spot.place]


def _inside(checks: list[StandardCheck], spot: Spot) -> list[StandardCheck]:
    """Those of the parts in it: of its topics for ``responsive``, which requires ``sent``."""
    return [check for check in checks if check.place[: len(spot.place)] == spot.place]


def _around(checks: list[StandardCheck], spot: Spot) -> list[StandardCheck]:
    """Those of the innermost part around: of a program for ``topic``, which requires ``starts``."""
    return next(filter(None, (_at(checks, outer) for outer in spot.around)), [])


def _in_depends(checks: list[StandardCheck], spot: Spot) -> list[StandardCheck]:
    """Those of packages that a part's package depends on, as on a package of interfaces."""
    return [check for check in checks if check.spot.package in spot.of_package.depends]


def _is_near(other: Spot, spot: Spot) -> bool:
    """Whether a part is the other one, lies around it, or lies in it."""
    shorter = min(len(other.place), len(spot.place))
    return other.place[:shorter] == spot.place[:shorter]


def _shared(total: float, checks: Collection[StandardCheck]) -> dict[str, float]:
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
