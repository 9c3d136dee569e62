"""What a handout asks of a definition by type, and the fields that a student has for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

from grader.findings.words import code, listing
from grader.recording.interface import FLOATS, INTEGERS, TEXTS, Field

FAMILIES: Mapping[str, tuple[str, ...]] = {
    "number": (*INTEGERS, *FLOATS),
    "integer": tuple(INTEGERS),
    "float": FLOATS,
    "text": TEXTS,
}
"""Words for several primitive types."""

_WORDS = {
    "number": "any number",
    "integer": "any integer",
    "float": "`float32` or `float64`",
    "text": "`string`",
}

Types = tuple[str, ...]
"""Types of fields that a definition has together, such as two ``float64``."""
Alternatives = tuple[Types, ...]
"""One of them is enough."""
_Taken = dict[int, tuple[str, str]]
"""Index of a field -> what it stands for, and the type that is asked for."""


def fits(field: Field, type: str) -> bool:
    """Whether a field is of a type that is asked for; ``float64[]`` is an array of any length."""
    single = type.removesuffix("[]")
    return field.is_array == (single != type) and field.type in FAMILIES.get(single, (single,))


def assigned(
    asked: Mapping[str, Alternatives], fields: Sequence[Field]
) -> Mapping[str, tuple[Field, ...]]:
    """The fields that stand for what is asked for, each for one thing; without what has none.

    Of all choices among the alternatives, the first with the fewest that have none.
    """
    best: dict[str, tuple[Field, ...]] = {}
    for chosen in product(*asked.values()):
        found = _fields_for(dict(zip(asked, chosen, strict=True)), fields)
        if len(found) > len(best):
            best = found
        if len(best) == len(asked):
            break
    return best


def _fields_for(
    asked: Mapping[str, Types], fields: Sequence[Field]
) -> dict[str, tuple[Field, ...]]:
    """The same where each thing is asked for with one choice of types."""
    taken: _Taken = {}
    for role, types in asked.items():
        taken = _taken_with(taken, role, types, fields) or taken
    return {
        role: tuple(fields[index] for index, (one, _) in sorted(taken.items()) if one == role)
        for role in dict.fromkeys(role for role, _ in taken.values())
    }


def _taken_with(taken: _Taken, role: str, types: Types, fields: Sequence[Field]) -> _Taken | None:
    """What is taken, with fields for one role more; None where there are not enough.

    An augmenting path moves what is taken already (Kuhn 1955, bipartite matching).
    """
    moved = dict(taken)

    def place(what: tuple[str, str], tried: set[int]) -> bool:
        for index, field in enumerate(fields):
            if index in tried or not fits(field, what[1]):
                continue
            tried.add(index)
            if index not in moved or place(moved[index], tried):
                moved[index] = what
                return True
        return False

    return moved if all(place((role, type), set()) for type in types) else None


def words_of(alternatives: Alternatives) -> str:
    """What is asked for: ``geometry_msgs/msg/Pose`` or two fields of ``float64``."""
    return listing(map(_together, alternatives), last="or")


def _together(types: Types) -> str:
    counts = {type: types.count(type) for type in types}
    return listing(
        f"{number} fields of {_one(type)}" if number > 1 else _one(type)
        for type, number in counts.items()
    )


def _one(type: str) -> str:
    single = type.removesuffix("[]")
    word = _WORDS.get(single) or code(single)
    return f"array of {word}" if single != type else word


def all_fields(
    fields: Sequence[Field], own: Mapping[str, Sequence[Field]], around: tuple[str, ...] = ()
) -> Iterator[Field]:
    """The fields of a section, and those of the student's own messages in it, by their paths.

    Args:
        own: The fields of each message that the student defined, by its full name.
        around: The messages that this one lies in, so that one in itself has an end.
    """
    for field in fields:
        yield field
        if field.type in own and not field.is_array and field.type not in around:
            for inner in all_fields(own[field.type], own, (*around, field.type)):
                yield Field(f"{field.name}.{inner.name}", inner.type, inner.is_array)
