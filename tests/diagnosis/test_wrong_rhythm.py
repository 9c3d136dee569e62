"""Why messages come at another period, irregularly, or with a pause."""

from __future__ import annotations

import pytest

from tests.checks.builder import (
    after,
    call,
    declarations,
    declared,
    endpoint,
    failing,
    messages,
    recording,
)

SLOW_CALLS = tuple(call(0.8 + 0.5 * n, 0.4) for n in range(6))
TIMER_OF_ZERO = (declared("timer", period_s=0.0),)
TWICE = (*declarations(), *declarations()[4:6])
CREATED_TEN_TIMES = (*declarations(), *(declarations()[4:5] * 9))
TWO_PUBLISHERS = (endpoint(), endpoint(appeared_s=0.5, node="/twin"))
UNEVEN = [0.3, 0.21, 0.39, 0.3, 0.25, 0.42, 0.3, 0.2, 0.37]


def declaring(timer_s: float | None) -> dict:
    return {"declarations": declarations(timer_s=timer_s)}


@pytest.mark.parametrize(
    ("intervals_s", "changes", "words"),
    [
        # The period is given in another unit, or is simply another one.
        (
            [0.003] * 500,
            declaring(0.003),
            ["median 3 ms", "0.01 times the expected period", "declared a timer of 3 ms"],
        ),
        ([0.003] * 500, {}, ["create_timer takes its period in seconds: 0.3 is 300 ms."]),
        ([0.03] * 50, {}, ["0.1 times the expected period"]),
        ([3.0, 3.0], declaring(3.0), ["median 3 s", "10 times the expected period"]),
        ([0.5] * 8, declaring(0.5), ["the process declared a timer of 500 ms", "in seconds"]),
        ([0.0001] * 50, {"declarations": TIMER_OF_ZERO}, ["a timer of 0 s", "in seconds"]),
        ([0.2] * 20, {"declarations": ()}, ["messages come too often"]),
        ([0.9] * 6, {"declarations": ()}, ["900 ms instead of 300 ms"]),
        # Several messages in each period.
        (
            [0.05, 0.25] * 10,
            {"declarations": TWICE},
            ["messages come 2 times as often as expected", "declared 2 timers"],
        ),
        (
            [0.15] * 20,
            {"endpoints": TWO_PUBLISHERS},
            ["2 times as often as expected, from 2 publishers on the topic"],
        ),
        ([0.0001, 0.0001, 0.2998] * 7, {}, ["3 times as often", "publish once in its"]),
        ([0.15] * 20, declaring(0.15), ["as expected: the process declared a timer of 150 ms"]),
        # A right timer, and callbacks that do not keep up with it.
        ([0.6] * 8, {"calls": SLOW_CALLS}, ["300 ms too long", "Keep callbacks short"]),
        (
            [0.42] * 10,
            {"calls": SLOW_CALLS},
            ["120 ms too long, although the process declared 1 timer of 300 ms"],
        ),
        ([0.32] * 10, {}, ["20 ms too long, although", "timer.reset()"]),
        ([0.6] * 8, {}, ["300 ms too long, although", "Publish in every call of its"]),
        (
            [0.35] * 10,
            {"declarations": CREATED_TEN_TIMES},
            ["although the process declared 10 timers of 300 ms", "Create the timer once"],
        ),
        # A loop that sleeps.
        (
            [0.405] * 10,
            declaring(None),
            ["no timer: it looks like 300 ms of sleeping plus 105 ms of work", "create_timer(0.3"],
        ),
        # The right period, but not regular.
        ([0.3, 0.3, 0.6] * 5, {}, ["5 intervals of 15 differ", "without a condition"]),
        (
            [0.3] * 5 + [1.2] + [0.3] * 5,
            {},
            ["1 interval of 11 differs", "work or sleep for long"],
        ),
        (UNEVEN, {}, ["differ from the median by more than 30 ms", "sleep for long"]),
        (UNEVEN, {"declarations": ()}, ["Let a timer call the callback"]),
    ],
)
def test_each_common_cause_of_a_wrong_rhythm_is_named(intervals_s, changes, words):
    times = after(intervals_s)
    run = recording(messages=messages(times), stop_s=max(times) + 0.5, **changes)
    found = failing("timing.period", run, topic="/cmd_vel", period="300 ms")
    assert all(one in found for one in words), found


def test_without_a_tracer_a_timer_is_not_missed():
    run = recording(messages=messages(after([0.405] * 10)), declarations=(), stop_s=5.5)
    found = failing("timing.period", run, topic="/cmd_vel", period="300 ms")
    assert "declared" not in found
    assert "300 ms of sleeping plus 105 ms of work" in found


@pytest.mark.parametrize("count", range(5, 24))
def test_a_callback_that_publishes_twice_is_named_however_many_messages_came(count):
    times = after(([0.0003, 0.2997] * 12)[:count])
    run = recording(messages=messages(times), stop_s=max(times) + 0.5)
    found = failing("timing.period", run, topic="/cmd_vel", period="300 ms")
    assert "messages come 2 times as often as expected" in found
