"""Fields of messages that checks name, against the definitions of those messages.

What a message cannot have would end as an error, for every student, once they have published one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.interfaces import Interfaces
from grader.assignment.model import Assignment
from grader.assignment.stimuli.message import Find, part_of
from grader.checks.check import NamedFields
from grader.checks.value import NoSuchField, expected_leaves, tolerance_of, unreachable, value_at
from grader.errors import Problem
from grader.recording.interface import FLOATS, TEXTS, fields_of
from grader.spec.source import Source

_INDEX = re.compile(r"\[\d+\]")
_ZERO = {"bool": False, **dict.fromkeys(FLOATS, 0.0), **dict.fromkeys(TEXTS, "")}


def problems(
    source: Source, assignment: Assignment, checks: Sequence[BoundCheck], known: Interfaces
) -> Iterator[Problem]:
    """Find fields that the messages do not have; where a definition is not at hand, none."""
    for index, bound in enumerate(checks):
        for named in bound.parameters.named_fields():
            for interface in _types(assignment, bound, named.endpoint):
                try:
                    find = part_of(known.find, interface, named.part)
                    message = _sample(interface, find, ())
                except (KeyError, IndexError):
                    continue
                lack = _lack(named, message)
                if lack:
                    text = f"{named.endpoint} ({interface}): {lack}"
                    yield source.problem(("checks", index, "with", *named.place), text)


def _types(assignment: Assignment, bound: BoundCheck, endpoint: str) -> list[str]:
    """The types that a topic, a service or an action has in the scenarios of a check."""
    found = []
    for scenario in assignment.scenarios:
        if not bound.spec.scenarios or scenario.id in bound.spec.scenarios:
            used = dict(one.exchanged for one in scenario.stimuli if one.exchanged)
            found.append({**used, **scenario.recorded_types}.get(endpoint))
    return list(dict.fromkeys(interface for interface in found if interface is not None))


def _lack(named: NamedFields, message: dict[str, Any]) -> str:
    """Why a message cannot be as a check expects it, or nothing."""
    try:
        if isinstance(named.fields, str):
            value_at(message, _INDEX.sub("[0]", named.fields))
            return ""
        if _INDEX.search("".join(named.fields)):
            wanted = dict(named.fields)
        else:
            wanted = expected_leaves(named.fields, message)
        for path, expected in wanted.items():
            sample = value_at(message, _INDEX.sub("[0]", path))
            why = unreachable(expected, sample, tolerance_of(named.tolerance, path))
            if why:
                return f"{path} {why}"
    except NoSuchField as error:
        return str(error)
    return ""


def _sample(interface: str, find: Find, around: tuple[str, ...]) -> dict[str, Any]:
    """A message of a type, with one value in each of its arrays."""
    if interface in around:
        raise KeyError(interface)
    found: dict[str, Any] = {}
    for name, field in fields_of(interface, find(interface)).items():
        value = _ZERO.get(field.type, 0)
        if field.is_message:
            value = _sample(field.type, find, (*around, interface))
        found[name] = [value] if field.is_array else value
    return found
