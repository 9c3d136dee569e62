"""Fields that an assignment expects of a request, a response, a goal or a result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field

from grader.findings.condition import is_comparison
from grader.findings.expected import Difference, differences, expected_leaves
from grader.findings.finding import Table
from grader.findings.text import is_asked_of_text, text_words
from grader.findings.value import FieldPath, Tolerance
from grader.findings.words import codes, value_text, worded
from grader.recording.interaction import Goal

_MOST_FIELDS = 6
_MOST_IN_WORDS = 4
_MOST_ROWS = 50

_Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]
FieldTolerance = Annotated[
    _Amount | dict[FieldPath, _Amount],
    Field(
        description="Largest difference of two numbers; or by field, such as `{sum: 0.1}`. Then "
        "the numbers of other fields must be exact."
    ),
]


def each_field(value: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """What is asked of each field, by its path, such as ``linear.x``."""
    for key, item in value.items():
        name = f"{path}.{key}" if path else str(key)
        if isinstance(item, Mapping) and not is_asked_of_text(item):
            yield from each_field(item, name)
        else:
            yield name, item


def unlike(
    value: Mapping[str, Any], wanted: Mapping[str, Any], tolerance: Tolerance
) -> tuple[Difference, ...]:
    """The wanted fields that a value does not have.

    Raises:
        NoSuchField: It cannot have such a field.
    """
    leaves = expected_leaves(wanted, value)
    return differences(leaves, value, rest_zero=False, tolerance=tolerance)


def words(value: Mapping[str, Any]) -> str:
    """Write fields as ``a = 2, b = 3``; ``nothing`` for none."""
    fields = [f"{path} {wanted_words(item)}" for path, item in each_field(value)]
    return ", ".join(fields) or "nothing"


def within_words(tolerance: Tolerance) -> str:
    """Write a tolerance that is worth a word as `` (within 0.1)``."""
    if not isinstance(tolerance, Mapping):
        return "" if tolerance <= 1e-6 else f" (within {tolerance:g})"
    parts = (f"{path} within {amount:g}" for path, amount in tolerance.items())
    return f" ({', '.join(parts)})" if tolerance else ""


def wanted_text(value: Any) -> str:
    """Write what is asked for: a comparison or a range as it is, without quotes."""
    return value if isinstance(value, str) and is_comparison(value) else value_text(value)


def wanted_words(value: Any) -> str:
    """Write what is asked of a field: ``= 2``, ``> 0``, ``contains 'ready'``."""
    if is_asked_of_text(value):
        return text_words(value)
    text = wanted_text(value)
    return text if text[0] in "<>!" else f"= {text}"


def instead(item: Difference) -> str:
    """Write a difference as ``sum = 4 instead of 5``."""
    return f"{item.field} = {value_text(item.observed)} instead of {_expected_text(item)}"


def _expected_text(item: Difference) -> str:
    if is_asked_of_text(item.expected):
        return f"a text that {text_words(item.expected)}"
    # A text that is expected of a number is a condition, such as `> 0`, and has no quotes.
    if isinstance(item.expected, str) and isinstance(item.observed, int | float | None):
        return item.expected
    return value_text(item.expected)


def the_goal(goal: Goal) -> str:
    """A goal in words."""
    return f"the goal ({words(goal.goal)})"


def brief(value: Mapping[str, Any]) -> str:
    """Write a whole request or goal; of a long one only the fields that are not zero or empty."""
    fields = list(each_field(value))
    if len(fields) <= _MOST_FIELDS:
        return words(value)
    shown = [f"{path} = {value_text(item)}" for path, item in fields if not _is_default(item)]
    return ", ".join(shown) or "every field zero or empty"


def _is_default(value: Any) -> bool:
    if isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray):
        return all(_is_default(item) for item in value)
    return not value


def fields_hint(what: str, value: Mapping[str, Any], wrong: Sequence[str]) -> str:
    """What to try where fields are wrong."""
    if all(_is_default(item) for _, item in each_field(value)):
        returned = worded(python=", and return it", cpp="")
        return (
            f"Set the fields of the {what} in the callback{returned}. Now every field has the "
            "value of a new one: 0, false or ''."
        )
    given = "that it is given" if what == "response" else "that it makes"
    which = worded(python="that it returns", cpp=given)
    return f"Look where the callback sets {codes(wrong)} of the {what} {which}."


def difference_words(found: Sequence[Difference]) -> str:
    """Write the first differences as ``sum = 4 instead of 5, count = 1 instead of 2``."""
    return ", ".join(map(instead, found[:_MOST_IN_WORDS]))


def difference_table(title: str, found: Sequence[Difference]) -> Table:
    """The same as a table."""
    rows = ((item.field, _expected_text(item), value_text(item.observed)) for item in found)
    return Table(title, ("field", "expected", "observed"), tuple(rows)[:_MOST_ROWS])
