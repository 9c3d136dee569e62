"""The ids of the standard checks of a contract."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from grader.assignment.contract.spot import Fact, Spot


class Said(NamedTuple):
    """A fact that a contract says of one of its parts, and the parameters of its check."""

    spot: Spot
    fact: Fact
    parameters: Mapping[str, Any]


class CheckIds:
    """Gives each check of a contract its id, such as ``type`` or ``cmd_vel_type``."""

    def __init__(self, said: Collection[Said]) -> None:
        self._authors = {id_ for spot, _, _ in said for id_ in ids_by_fact(spot).values()}
        without_own = (fact.name for spot, fact, _ in said if fact.name not in ids_by_fact(spot))
        self._times = Counter(without_own)

    def id_of(self, said: Said) -> str:
        """The author's id, such as ``mine`` for ``ids: {type: mine}``, or one that is made."""
        name, authors_ids = said.fact.name, ids_by_fact(said.spot)
        if name in authors_ids:
            return authors_ids[name]
        return self._unlike_authors(self._made(said), name)

    def _made(self, said: Said) -> str:
        """The fact, with a name before it where the author gives one or several have it."""
        name = said.fact.name
        prefix = _authors_prefix(said.spot)
        if not prefix and self._times[name] > 1:
            prefix = in_ids(said.spot.name)
        return f"{prefix}_{name}" if prefix else name

    def _unlike_authors(self, id_: str, fact_name: str) -> str:
        """Another id where the author gave this one elsewhere: ``type`` is ``type_type`` then."""
        return f"{id_}_{fact_name}" if id_ in self._authors else id_


def _authors_prefix(spot: Spot) -> str:
    """What the nearest part says with ``ids: publisher``; empty where none does."""
    ids = (near.part.ids for near in (spot, *spot.around))
    return next((prefix for prefix in ids if isinstance(prefix, str) and prefix), "")


def ids_by_fact(spot: Spot) -> Mapping[str, str]:
    """What the author says of a part with ``ids: {type: subscribed_type}``."""
    return spot.part.ids if isinstance(spot.part.ids, dict) else {}


def in_ids(name: str) -> str:
    """The name of a part as it stands in ids: ``cmd_vel`` for ``/robot/cmd_vel``."""
    return re.sub(r"\W+", "_", name.rpartition("/")[2]).lower()
