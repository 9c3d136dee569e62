"""Groups: what several checks or scenarios have in common, said once above them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from grader.assignment.model import CheckSpec, Scenario
from grader.errors import AssignmentError
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all
from grader.spec.rewriting import Rewriting
from grader.spec.source import Model, Source, in_order

MODELS: Mapping[str, type[Model]] = {"scenarios": Scenario, "checks": CheckSpec}
"""Key of a list that may have groups, and of the list of members in a group -> its entries."""
OF_EACH = ("id", "title")
"""What each member says itself."""
_POINTS = "points"


def ungrouped(source: Source) -> Source:
    """A document with the members of each group in its place, with all that the group says.

    What a member says itself counts, and `null` takes away what the group says. A mapping that
    both have is joined in this way, key by key. The points of a group stand by the ids of its
    checks.

    Raises:
        AssignmentError: A group is not as it must be.
    """
    lists = {key: source.data.get(key) for key in MODELS}
    grouped = {
        key: entries
        for key, entries in lists.items()
        if isinstance(entries, list) and any(_is_group(key, one) for one in entries)
    }
    if not grouped:
        return source
    flattening = _Flattening(Rewriting(source))
    flat = {key: [*flattening.entries(key, entries)] for key, entries in grouped.items()}
    if flattening.mistakes:
        problems = [source.problem(place, text) for place, text in flattening.mistakes]
        raise AssignmentError(source.file, in_order(problems))
    return flattening.rewriting.document({**source.data, **flat})


def keys_of(key: str) -> tuple[str, ...]:
    """The keys of an entry of a list, in the order of its documentation."""
    return tuple(one.alias or name for name, one in MODELS[key].model_fields.items())


def _is_group(key: str, entry: Any) -> bool:
    return isinstance(entry, dict) and key in entry


@dataclass
class _Flattening:
    """Puts the members of groups in their places, and collects what is wrong in the groups."""

    rewriting: Rewriting
    mistakes: list[tuple[Place, str]] = field(default_factory=list)

    def entries(self, key: str, entries: list[Any]) -> Iterator[Any]:
        """The entries of a list, with members in the places of groups."""
        self.rewriting.empty(key)
        count = 0
        for index, entry in enumerate(entries):
            origin: Place = (key, index)
            if not _is_group(key, entry):
                self.rewriting.moved(entry, origin, (key, count))
                yield entry
                count += 1
                continue
            self.mistakes += _mistakes(key, entry, origin)
            members = entry[key] if isinstance(entry[key], list) else ()
            for number, member in enumerate(members):
                inside = (*origin, key, number)
                yield self._member(entry, member, inside, (key, count))
                count += 1

    def _member(self, group: dict[str, Any], member: Any, origin: Place, place: Place) -> Any:
        """A member with what its group says; ``origin`` is where it is written."""
        self.rewriting.moved(member, origin, place)
        if not isinstance(member, dict):
            return member
        key, above = str(place[0]), origin[:2]
        shared = {name: value for name, value in group.items() if name not in (key, _POINTS)}
        whole = self._joined(shared, member, above, place)
        for name, value in shared.items():
            if isinstance(value, dict) and isinstance(member.get(name), dict):
                inside = (*place, name)
                whole[name] = self._joined(value, member[name], (*above, name), inside)
        own_id, points = member.get("id"), group.get(_POINTS)
        if isinstance(points, dict) and isinstance(own_id, str) and own_id in points:
            whole[_POINTS] = points[own_id]
            self.rewriting.moved(whole[_POINTS], (*above, _POINTS, own_id), (*place, _POINTS))
        return {name: whole[name] for name in (*keys_of(key), *whole) if name in whole}

    def _joined(
        self, shared: dict[str, Any], own: dict[str, Any], above: Place, place: Place
    ) -> dict[str, Any]:
        """The keys of both: a member's own count, and `null` takes one of the group away."""
        for name in shared.keys() - own.keys():
            self.rewriting.moved(shared[name], (*above, name), (*place, name))
        taken_away = {name for name in shared if name in own and own[name] is None}
        both = {**shared, **own}
        return {name: value for name, value in both.items() if name not in taken_away}


def _mistakes(key: str, group: dict[str, Any], place: Place) -> Iterator[tuple[Place, str]]:
    """What is wrong in a group itself, and not in its members."""
    members = group[key]
    if not isinstance(members, list) or not members:
        text = f"a group has at least one of its {key}, in a list: each begins with '- '"
        yield (*place, key), text
        return
    allowed = [name for name in keys_of(key) if name not in OF_EACH]
    for name in group:
        if name in OF_EACH:
            text = f"each of the {key} in a group has its own {name!r}: leave it out here"
            yield (*place, name), text
        elif name != key and name not in allowed:
            advice = nearest_or_all(name, allowed, "Allowed here")
            yield (*place, name), f"unknown key {name!r} of a group.{advice}"
    for number, member in enumerate(members):
        if _is_group(key, member):
            text = "a group in a group: write it beside this one, or its members into this one"
            yield (*place, key, number), text
    if _POINTS in group and _POINTS in allowed:
        yield from _points(group, members, place)


def _points(group: dict[str, Any], members: list[Any], place: Place) -> Iterator[tuple[Place, str]]:
    """What is wrong with the points of a group."""
    points, ids = group[_POINTS], {}
    if not isinstance(points, dict):
        text = "the points of a group stand by the ids of its checks: 'points: {id: 1}'"
        yield (*place, _POINTS), text
        return
    for number, member in enumerate(members):
        if isinstance(member, dict) and isinstance(member.get("id"), str):
            ids[member["id"]] = (*place, "checks", number), member
    for name in points:
        if name not in ids:
            advice = nearest_or_all(name, ids, "Its checks are")
            yield (*place, _POINTS, name), f"the group has no check {name!r}.{advice}"
        elif _POINTS in ids[name][1]:
            text = f"the points of {name!r} stand in the group already: leave one of them out"
            yield (*ids[name][0], _POINTS), text
