"""Two definitions of one interface, compared entry by entry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from grader.findings.words import code, listing
from grader.recording.interface import Constant, Field, Section
from grader.spec.nearest_name import nearest


@dataclass(frozen=True)
class Difference:
    """One difference, by the name of the entry in the student's definition or the expected one."""

    name: str
    text: str
    hint: str


def field_differences(
    wanted: Section, own: Section, package: str, *, in_order: bool
) -> Iterator[Difference]:
    """How the fields of a section differ."""
    expected = {field.name: field for field in wanted.fields}
    observed = {field.name: field for field in own.fields}
    renamed = _renamed(expected, observed)
    yield from _entry_differences("field", expected, observed, package)
    for name, field in observed.items():
        if name not in expected and name not in renamed.values():
            hint = "Remove it. A constant has an equals sign, such as `uint8 ON=1`."
            yield Difference(name, f"a field {code(str(field))} that is not asked for", hint)
    order = [name for name in observed if name in expected]
    if in_order and len(order) == len(expected) == len(observed) and order != list(expected):
        text = f"the fields are in the order {listing(map(code, order))}"
        hint = "ROS sends the fields in this order. Use the order that is asked for."
        yield Difference(order[0], text, hint)


def constant_differences(wanted: Section, own: Section, package: str) -> Iterator[Difference]:
    """How the constants of a section differ; further ones do not count."""
    expected = {constant.name: constant for constant in wanted.constants}
    observed = {constant.name: constant for constant in own.constants}
    yield from _entry_differences("constant", expected, observed, package)


def _entry_differences(
    noun: str,
    expected: Mapping[str, Field | Constant],
    observed: Mapping[str, Field | Constant],
    package: str,
) -> Iterator[Difference]:
    renamed = _renamed(expected, observed)
    for name, entry in expected.items():
        found = observed.get(renamed.get(name, name))
        if found is None:
            yield Difference(name, f"no {noun} {code(str(entry))}", f"Add the line `{entry}`.")
        elif _canonical(found) != _canonical(entry):
            text = f"{code(str(found))} instead of {code(str(entry))}"
            yield Difference(found.name, text, _hint(entry, found, package))


def _canonical(entry: Field | Constant) -> Field | Constant:
    """The entry as rosidl_adapter reads it, which makes uint8 of char (MSG_TYPE_TO_IDL)."""
    return replace(entry, type="uint8") if entry.type == "char" else entry


def _renamed(expected: Mapping[str, object], observed: Mapping[str, object]) -> dict[str, str]:
    """Names that are missing -> those that probably stand for them."""
    free = {name.lower(): name for name in observed if name not in expected}
    found: dict[str, str] = {}
    for name in expected:
        match = None if name in observed else nearest(name.lower(), list(free))
        if match is not None:
            found[name] = free.pop(match)
    return found


def _hint(wanted: Field | Constant, found: Field | Constant, package: str) -> str:
    if "/" in wanted.type and found.type.startswith(f"{package}/"):
        return f"A type without a package is sought in {package} itself: write `{wanted}`."
    if isinstance(wanted, Field) and wanted.is_array and wanted.type == found.type:
        kind = wanted.type.rpartition("/")[2]
        return (
            f"`{kind}[2]` holds exactly two values, `{kind}[]` any number of them, `{kind}[<=2]` "
            f"at most two: write `{wanted}`."
        )
    return f"Write `{wanted}`."
