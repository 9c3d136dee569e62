"""Wrong names as older recordings and records hold them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from grader.spec.names import NO_NAMES, Names, Thing, WrongName

_STAND_INS = "stand_ins"
"""The key of a record with pairs: the name of a package that is asked for, and the student's."""


def names_of_run(environment: Mapping[str, str]) -> Names:
    """The names in the environment of a run, which holds them as texts such as ``/a:=/b``."""
    parameters = environment.get("parameters", "").split()
    pairs = [text.split(":=") for text in environment.get("remaps", "").split()]
    return Names.of(WrongName(_thing(asked, parameters), own, asked) for own, asked in pairs)


def _thing(asked: str, parameters: Iterable[str]) -> Thing:
    if asked.startswith("/"):
        return Thing.TOPIC
    if "/" in asked:
        return Thing.FILE
    return Thing.PARAMETER if asked in parameters else Thing.PACKAGE


def names_of_record(record: bytes) -> Names:
    """The names of packages in the JSON of a record that holds them as pairs; else none."""
    if f'"{_STAND_INS}":[['.encode() not in record:
        return NO_NAMES
    pairs = json.loads(record)[_STAND_INS]
    return Names.of(WrongName(Thing.PACKAGE, own, asked) for asked, own in pairs)
