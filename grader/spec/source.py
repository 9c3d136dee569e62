"""A YAML file read with the line of every value, so that each error can name its place."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from grader.errors import AssignmentError, Problem, UsageError
from grader.spec.document import Place, parse_yaml, path
from grader.spec.mistake import mistakes

M = TypeVar("M", bound=BaseModel)


class Model(BaseModel):
    """Base of everything read from YAML: frozen, and unknown keys are errors."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        populate_by_name=True,
        protected_namespaces=(),
        # One command uses only a few of the many models; the others are never built.
        defer_build=True,
        allow_inf_nan=False,
    )


@dataclass(frozen=True)
class Source:
    """A YAML document with its positions.

    Attributes:
        data: Plain dicts, lists and scalars; a dict at the top.
        lines: Line (from 1) of each value and, for a mapping entry, of its key.
        origins: Where a part that was made or moved is written, by its place.
    """

    file: Path
    data: dict[str, Any]
    lines: dict[Place, int]
    origins: Mapping[Place, Place] = field(default_factory=dict)

    def line(self, place: Place) -> int | None:
        """Line of a place, or of the nearest enclosing place that was written down."""
        for end in range(len(place), -1, -1):
            if place[:end] in self.lines:
                return self.lines[place[:end]]
        return None

    def problem(self, place: Place, message: str) -> Problem:
        """A problem at a place of this document."""
        return Problem(message=message, line=self.line(place), where=path(self.written(place)))

    def written(self, place: Place) -> Place:
        """Where the author wrote a part: of one that was made, what it was made from."""
        for end in range(len(place), 0, -1):
            origin = self.origins.get(place[:end])
            if origin is not None:
                return origin + place[end:] if origin[0] == place[0] else origin
        return place

    def duplicates(self, name: str, *keys: str) -> Iterator[Problem]:
        """Entries of the lists under some keys that have the name of an earlier one."""
        seen: dict[str, Place] = {}
        for key in keys:
            for index, entry in enumerate(self.data.get(key, ())):
                place: Place = (key, index, name)
                value = entry.get(name)
                if seen.setdefault(value, place) != place:
                    first = self.line(seen[value])
                    yield self.problem(place, f"{value!r} stands twice (first in line {first})")

    def read(self, model: type[M]) -> M:
        """Validate the document as a model."""
        result, problems = self.examine(model)
        if result is None:
            raise AssignmentError(self.file, problems)
        return result

    def examine(
        self, model: type[M], place: Place = (), base: Place | None = None
    ) -> tuple[M | None, list[Problem]]:
        """Validate a part; one that was not written down reads as empty.

        Args:
            base: A part whose keys hold where the other part has none of that name.

        Returns:
            The model and no problem, or None and at least one.
        """
        # Strict in the way of JSON: a list is a tuple and a word is an enum's member, but true
        # is no number and '3' neither. By alias only: the name in Python is no key of the YAML.
        part = self._part(place)
        text = json.dumps(part if base is None else {**self._part(base), **part})
        try:
            return model.model_validate_json(text, strict=True, by_alias=True, by_name=False), []
        except ValidationError as error:
            found = mistakes(error, model, lambda step: (*place, *step) in self.lines)
        problems = [self.problem((*place, *inside), message) for inside, message in found]
        return None, in_order(problems)

    def _part(self, place: Place) -> Any:
        data: Any = self.data
        for end, step in enumerate(place, start=1):
            data = data[step] if place[:end] in self.lines else {}
        return data


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """Problems in the order of their lines, each once."""
    return sorted(dict.fromkeys(problems), key=lambda problem: problem.line or 0)


def read_source(file: Path) -> Source:
    """Read a YAML file.

    Raises:
        UsageError: The file does not exist or cannot be read.
        AssignmentError: It is not YAML, has a key twice, or uses types of its own.
    """
    try:
        raw = file.read_bytes()
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        text = f"not UTF-8 text ({error.reason}): save the file as UTF-8"
        raise AssignmentError(file, [Problem(text, line)]) from error
    return parse_source(text, file)


def parse_source(text: str, file: Path) -> Source:
    """Read YAML text; ``file`` is only named in errors."""
    data, lines = parse_yaml(text, file)
    if not isinstance(data, dict):
        raise AssignmentError(file, [Problem("expected keys and values at the top", 1)])
    return Source(file, data, lines)
