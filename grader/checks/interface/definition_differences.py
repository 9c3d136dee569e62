"""Two definitions of one interface, compared entry by entry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from grader.checks.wording import code, listing
from grader.recording.interface import Field, Section
from grader.spec.nearest_name import nearest

# rosidl_adapter makes uint8 of char (MSG_TYPE_TO_IDL).
_SYNONYMS = {"char": "uint8"}


@dataclass(frozen=True)
class Difference:
    """One thing that differs.

    Attributes:
        name: Of the entry in the student's definition, or in ours where theirs has none.
    """

    name: str
    text: str
    hint: str


def field_differences(wanted: Section, own: Section, package: str) -> Iterator[Difference]:
    """How the fields of a section differ."""
    expected = {field.name: field for field in wanted.fields}
    observed = {field.name: field for field in own.fields}
    renamed = _renamed(expected, observed)
    for name, field in expected.items():
        found = observed.get(renamed.get(name, name))
        if found is None:
            yield Difference(name, f"no field {code(str(field))}", f"Add the line `{field}`.")
        elif name in renamed or _type_of(found) != _type_of(field):
            text = f"{code(str(found))} instead of {code(str(field))}"
            yield Difference(found.name, text, _field_hint(field, found, package))
    for name, field in observed.items():
        if name not in expected and name not in renamed.values():
            text = f"a field {code(str(field))} too many"
            hint = "Remove it: a further field makes another interface of it."
            constant = next((item for item in wanted.constants if item.name == name), None)
            if constant is not None:
                hint = f"A constant has an equals sign: `{constant}`."
            yield Difference(name, text, hint)
    order = [name for name in observed if name in expected]
    if len(order) == len(expected) == len(observed) and order != list(expected):
        yield Difference(
            order[0],
            f"the fields are in the order {listing(map(code, order))}",
            "The order of the lines is the order of the bytes in a message: keep it.",
        )


def constant_differences(wanted: Section, own: Section, package: str) -> Iterator[Difference]:
    """How the constants of a section differ; further ones do not count."""
    expected = {constant.name: constant for constant in wanted.constants}
    observed = {constant.name: constant for constant in own.constants}
    renamed = _renamed(expected, observed)
    for name, constant in expected.items():
        found = observed.get(renamed.get(name, name))
        hint = f"Write `{constant}`."
        if found is None:
            yield Difference(name, f"no constant {code(str(constant))}", hint)
        elif (_plain(found.type), found.value) != (_plain(constant.type), constant.value) or (
            name in renamed
        ):
            text = f"{code(str(found))} instead of {code(str(constant))}"
            yield Difference(found.name, text, hint)


def _renamed(expected: Mapping[str, object], observed: Mapping[str, object]) -> dict[str, str]:
    """Names that are missing -> those that probably stand for them."""
    free = [name for name in observed if name not in expected]
    found: dict[str, str] = {}
    for name in expected:
        if name in observed:
            continue
        match = nearest(name.lower(), [item.lower() for item in free])
        match = next((item for item in free if item.lower() == match), None)
        if match is not None:
            found[name] = match
            free.remove(match)
    return found


def _type_of(field: Field) -> str:
    return Field(
        "", _plain(field.type), field.is_array, field.count, field.most, field.longest
    ).full_type


def _plain(kind: str) -> str:
    return _SYNONYMS.get(kind, kind)


def _field_hint(wanted: Field, found: Field, package: str) -> str:
    if wanted.is_message and found.type.startswith(f"{package}/"):
        name = found.type.rpartition("/")[2]
        return (
            f"A type without a package is sought in {package} itself: write "
            f"`{wanted.full_type}`, not `{name}`."
        )
    if wanted.type == found.type and wanted.name == found.name and wanted.is_array:
        kind = wanted.type.rpartition("/")[2]
        return (
            f"`{kind}[2]` holds exactly two values, `{kind}[]` any number of them, `{kind}[<=2]` "
            f"at most two: write `{wanted}`."
        )
    return f"Write `{wanted}`."
