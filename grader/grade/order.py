"""The order in which checks are judged: what is required comes first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from heapq import heapify, heappop, heappush


def dependency_order(requires: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Sort checks so that each comes after all that it requires.

    Raises:
        ValueError: A requirement does not exist, or checks require each other in a circle.
    """
    position = {check: index for index, check in enumerate(requires)}
    waiting = {check: set(required) for check, required in requires.items()}
    dependants: dict[str, list[str]] = {check: [] for check in requires}
    for check, required in waiting.items():
        for other in required:
            if other not in position:
                raise ValueError(f"the check {check!r} requires {other!r}, which does not exist")
            dependants[other].append(check)
    ready = [position[check] for check, required in waiting.items() if not required]
    heapify(ready)
    names = tuple(requires)
    ordered: list[str] = []
    while ready:
        check = names[heappop(ready)]
        ordered.append(check)
        for dependant in dependants[check]:
            waiting[dependant].discard(check)
            if not waiting[dependant]:
                heappush(ready, position[dependant])
    if len(ordered) < len(names):
        raise ValueError(f"checks require each other in a circle: {_circle(waiting, ordered)}")
    return tuple(ordered)


def _circle(waiting: Mapping[str, set[str]], ordered: Sequence[str]) -> str:
    path = [next(check for check in waiting if check not in ordered)]
    while path.count(path[-1]) == 1:
        path.append(min(waiting[path[-1]]))
    return " -> ".join(path[path.index(path[-1]) :])
