"""messages.sequence."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.findings.finding import Status
from tests.checks.builder import failing, judge, message, recording

INT = "std_msgs/msg/Int64"


def counting(*values, numbers=None):
    """A node that published these on /cmd_vel."""
    numbers = numbers or range(1, len(values) + 1)
    return recording(
        messages={
            "/cmd_vel": tuple(
                message(0.7 + 0.3 * n, {"data": value}, sequence=number, type=INT)
                for n, (value, number) in enumerate(zip(values, numbers, strict=True))
            )
        }
    )


def sequence(**parameters):
    return {"topic": "/cmd_vel", "field": "data", **parameters}


@given(st.integers(-(10**6), 10**6), st.integers(-50, 50), st.integers(3, 30))
def test_counting_may_begin_anywhere(start, step, length):
    run = counting(*(start + step * n for n in range(length)))
    assert judge("messages.sequence", run, **sequence(step=step)).status is Status.PASSED
    exact = sequence(step=step, start=start)
    assert judge("messages.sequence", run, **exact).status is Status.PASSED


def test_a_message_that_was_lost_on_its_way_leaves_its_place_out():
    run = counting(0, 1, 3, 4, numbers=(1, 2, 4, 5))
    assert judge("messages.sequence", run, **sequence(step=1)).status is Status.PASSED
    assert "data" in failing("messages.sequence", counting(0, 1, 3, 4), **sequence(step=1))


def test_a_value_may_be_a_comparison_and_the_field_an_expression():
    run = counting(-1, 4, 9)
    wanted = sequence(field="data / 2", values=["< 0", 2, "4 .. 5"])
    assert judge("messages.sequence", run, **wanted).status is Status.PASSED
    wanted["values"][1] = "!= 2"
    assert "2 instead of != 2 in message 2 of 3" in failing("messages.sequence", run, **wanted)


@pytest.mark.parametrize(
    ("values", "parameters", "words"),
    [
        ((0, 0, 0, 0), {"step": 1}, "the value never changes"),
        ((0, 2, 4, 6), {"step": 1}, "it begins with 0 and grows by 2 from message to message"),
        ((1, 2, 3, 4), {"step": 1, "start": 0}, "it begins with 1"),
        ((0, 1, 2, 0, 1), {"step": 1}, "it goes back to the first value in message 4"),
        ((0, 1, 1, 2, 3), {"step": 1}, "1 instead of 2 in message 3 of 5"),
        ((1, 2, 4), {"values": [1, 2, 3]}, "4 instead of 3 in message 3 of 3"),
        (("a", "c"), {"values": ["a", "b"]}, "'c' instead of 'b' in message 2 of 2"),
    ],
)
def test_mistakes_in_counting_are_named(values, parameters, words):
    assert words in failing("messages.sequence", counting(*values), **sequence(**parameters))


def test_a_list_of_values():
    run = counting("red", "green", "red")
    wanted = sequence(values=["red", "green", "red"])
    assert judge("messages.sequence", run, **wanted).status is Status.PASSED
    assert "3 messages" in failing(
        "messages.sequence", run, **sequence(values=["red", "green", "red", "blue"])
    )


def test_a_field_that_does_not_exist_is_the_author_s_mistake():
    finding = judge("messages.sequence", counting(1, 2, 3), **sequence(step=1) | {"field": "date"})
    assert finding.status is Status.ERROR
    assert "has no field 'date'; it has data. Did you mean 'data'?" in finding.observed
