"""Checks are judged in an order in which every requirement is known."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.grade.order import dependency_order


def test_without_requirements_the_authors_order_stays():
    assert dependency_order({"c": (), "a": (), "b": ()}) == ("c", "a", "b")


def test_a_requirement_that_is_written_later_comes_first():
    assert dependency_order({"period": ("topic",), "values": (), "topic": ()}) == (
        "values",
        "topic",
        "period",
    )


def test_a_circle_is_named():
    with pytest.raises(ValueError, match=r"in a circle: b -> c -> b"):
        dependency_order({"a": (), "b": ("c",), "c": ("b",)})


def test_a_check_that_only_hangs_on_a_circle_is_not_blamed():
    with pytest.raises(ValueError, match=r"in a circle: b -> c -> b"):
        dependency_order({"a": ("b",), "b": ("c",), "c": ("b",)})


def test_a_requirement_that_does_not_exist_is_named():
    with pytest.raises(ValueError, match="the check 'a' requires 'ghost', which does not exist"):
        dependency_order({"a": ("ghost",)})


@given(st.data())
def test_requirements_always_come_first(data):
    names = data.draw(st.permutations([f"c{index}" for index in range(8)]))
    requires = {
        name: data.draw(st.lists(st.sampled_from(sorted(names)[: int(name[1])]), unique=True))
        if name != "c0"
        else []
        for name in names
    }
    ordered = dependency_order(requires)
    assert sorted(ordered) == sorted(names)
    for name in names:
        assert all(ordered.index(other) < ordered.index(name) for other in requires[name])
