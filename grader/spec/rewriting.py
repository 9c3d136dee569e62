"""A document that is written anew: where its parts stand now, and where the author wrote them.

What is wrong in a part is told with the line and the place that the author knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from grader.spec.document import Place, places
from grader.spec.source import Source


class Rewriting:
    """The lines and origins of a document that is made from another."""

    def __init__(self, source: Source) -> None:
        """Begin with the document as it is."""
        self._source = source
        self._lines = dict(source.lines)
        self._origins = dict(source.origins)

    def empty(self, key: str) -> None:
        """Forget where the entries of a list stand: each is moved or made then."""
        self._lines = {
            at: line for at, line in self._lines.items() if at[:1] != (key,) or not at[1:]
        }
        self._origins = {at: origin for at, origin in self._origins.items() if at[0] != key}

    def begins(self, key: str, origin: Place) -> None:
        """Note where a list comes from that the author may not have written."""
        self._lines.setdefault((key,), self._source.line(origin) or 1)

    def moved(self, value: Any, origin: Place, place: Place) -> None:
        """Note that a part which the author wrote at one place stands at another."""
        for inside in places(value):
            written = (*origin, *inside)
            self._lines[(*place, *inside)] = self._source.lines[written]
            self._origins[(*place, *inside)] = self._source.written(written)

    def moved_all(self, key: str, entries: Sequence[Any], by: int) -> None:
        """Note that the entries of a list have come to stand further down."""
        self.empty(key)
        for index, entry in enumerate(entries):
            self.moved(entry, (key, index), (key, index + by))

    def made(self, value: Any, origin: Place, place: Place) -> None:
        """Note what a part is made from that the author did not write."""
        self._origins[place] = origin
        line = self._source.line(origin) or 1
        self._lines.update(dict.fromkeys(places(value, place), line))

    def document(self, data: dict[str, Any]) -> Source:
        """The new document."""
        return replace(self._source, data=data, lines=self._lines, origins=self._origins)
