"""What a program in C++ declares and publishes is explained as C++, not as Python."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from grader.findings.words import speaking
from grader.measure.declarations import hides_calls, is_compiled
from grader.recording.model import Declaration, Kind
from grader.recording.submission import CPP
from tests.checks.builder import (
    BOT,
    declarations,
    declared,
    endpoint,
    every,
    failing,
    messages,
    output,
    package,
    recording,
    sent,
    silent,
    stimulus,
    submission,
    twist,
)

EQUAL = {"topic": "/cmd_vel", "value": {"linear": {"x": 1.0}, "angular": {"z": 0.5}}}
COUNT = {"topic": "/cmd_vel", "at_least": 5}


def of_cpp(found: tuple[Declaration, ...]) -> tuple[Declaration, ...]:
    """The same as a compiled program declares it."""
    return tuple(
        replace(item, data={**item.data, "language": "C++"}) if item.kind == "started" else item
        for item in found
    )


COMPILED = of_cpp(declarations())


def test_a_program_is_compiled_as_its_tracer_says_or_its_package() -> None:
    assert is_compiled(recording(declarations=COMPILED), BOT)
    assert not is_compiled(recording(), BOT)
    by_cmake = submission(package(build_type="ament_cmake"))
    assert is_compiled(recording(declarations=(), submission=by_cmake), BOT)
    # A Python program in a package of CMake has the tracer in it.
    assert not is_compiled(recording(submission=by_cmake), BOT)


def test_a_variable_that_was_never_set_is_no_integer() -> None:
    run = recording(messages=messages(every(0.3), twist((6.9e-310, 0, 0), (0, 0, 0.5))))
    with speaking(CPP):
        found = failing("messages.equal", run, **EQUAL)
    assert "a variable was never given a value" in found and "double speed = 0.0" in found


def test_a_period_of_300_seconds_is_written_300ms() -> None:
    late = silent(declarations=of_cpp(declarations(timer_s=300.0)))
    with speaking(CPP):
        found = failing("messages.count", late, **COUNT)
    assert "a timer of 5 min" in found and "such as 300ms" in found


@pytest.mark.parametrize("line", ["x = %.2f", "x = {msg.data}"])
def test_a_placeholder_that_nothing_filled_in(line: str) -> None:
    times_s = every(0.3, 5, 1.0)
    run = recording(
        messages={},
        sent=sent(times_s, values=[{"data": 12.34}] * 5),
        endpoints=(
            endpoint("/chatter", kind=Kind.SUBSCRIPTION, type="std_msgs/msg/String"),
            stimulus(),
        ),
        log=tuple(one for t in times_s for one in output(line, time_s=t + 0.01)),
        declarations=COMPILED,
    )
    with speaking(CPP):
        found = failing("log.follows", run, topic="/chatter", fields=["data"], at_least=4)
    assert "instead of a value" in found and "RCLCPP_INFO(this->get_logger()" in found


def test_only_the_events_executor_of_rclpy_hides_what_it_calls() -> None:
    spin = declared("spin", executor="EventsExecutor", threads=1)
    python = (*declarations(spin=False), spin)
    assert hides_calls(recording(declarations=python))
    assert not hides_calls(recording(declarations=of_cpp(python)))


@pytest.mark.parametrize(
    ("changes", "observed"),
    [
        ({"spin": False}, "was never called, so no callback runs"),
        ({"timer_s": None}, "the process declared no timer"),
    ],
)
def test_what_it_did_not_declare_it_did_not_do(changes: dict[str, Any], observed: str) -> None:
    run = silent(declarations=of_cpp(declarations(**changes)))
    assert observed in failing("messages.count", run, **COUNT)
