"""What a program in C++ declares and publishes is explained as C++, not as Python."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from grader.diagnosis.explanation import explain
from grader.diagnosis.wrong_value import WrongValue
from grader.findings.value import Difference
from grader.measure.declarations import hides_calls, is_compiled
from grader.recording.model import Declaration, Kind, Recording
from tests.checks.builder import (
    BOT,
    after,
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


def in_cpp(found: tuple[Declaration, ...]) -> tuple[Declaration, ...]:
    """The same as a compiled program declares it."""
    return tuple(
        replace(item, data={**item.data, "language": "C++"}) if item.kind == "started" else item
        for item in found
    )


COMPILED = in_cpp(declarations())


def test_a_program_is_compiled_as_its_tracer_says_or_its_package() -> None:
    assert is_compiled(recording(declarations=COMPILED), BOT)
    assert not is_compiled(recording(), BOT)
    by_cmake = submission(package(build_type="ament_cmake"))
    assert is_compiled(recording(declarations=(), submission=by_cmake), BOT)
    # A Python program in a package of CMake has the tracer in it.
    assert not is_compiled(recording(submission=by_cmake), BOT)


@pytest.mark.parametrize("x", [6.9e-310, 5e-324, 4.6e252])
def test_a_variable_that_was_never_set_is_no_integer(x: float) -> None:
    def run(**changes: Any) -> Recording:
        return recording(messages=messages(every(0.3), twist((x, 0, 0), (0, 0, 0.5))), **changes)

    found = failing("messages.equal", run(declarations=COMPILED), **EQUAL)
    assert "a variable was never given a value" in found and "double speed = 0.0" in found
    assert "never given a value" not in failing("messages.equal", run(), **EQUAL)


def test_never_set_is_said_of_no_number_that_a_program_means() -> None:
    for number in (0.0, 1e-9, -57.3, 1e9):
        wrong = (Difference("linear.x", 1.0, number),)
        symptom = WrongValue(wrong, {"linear.x": number, "y": 1.0}, 0.0, compiled=True)
        assert "never" not in str(explain(symptom))


def test_a_period_of_300_seconds_is_written_300ms() -> None:
    late = silent(declarations=in_cpp(declarations(timer_s=300.0)))
    found = failing("messages.count", late, **COUNT)
    assert "a timer of 5 min" in found and "such as 300ms" in found
    slow = recording(messages=messages(after([3.0, 3.0])), stop_s=7.5, declarations=COMPILED)
    assert "such as 300ms" in failing("timing.period", slow, topic="/cmd_vel", period="300 ms")


def test_a_period_of_whole_seconds_becomes_0() -> None:
    run = recording(
        messages=messages(after([0.0001] * 50)),
        declarations=in_cpp(declarations(timer_s=0.0)),
    )
    found = failing("timing.period", run, topic="/cmd_vel", period="300 ms")
    assert "std::chrono::seconds(300 / 1000)" in found


@pytest.mark.parametrize("line", ["x = %.2f", "x = {}", "x = {msg.data}"])
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
    found = failing("log.follows", run, topic="/chatter", fields=["data"], at_least=4)
    assert "instead of a value" in found and "RCLCPP_INFO(this->get_logger()" in found


def test_only_the_events_executor_of_rclpy_hides_what_it_calls() -> None:
    spin = declared("spin", executor="EventsExecutor", threads=1)
    python = (*declarations(spin=False), spin)
    assert hides_calls(recording(declarations=python))
    assert not hides_calls(recording(declarations=in_cpp(python)))


@pytest.mark.parametrize(
    ("changes", "observed"),
    [
        ({"spin": False}, "was never called, so no callback runs"),
        ({"timer_s": None}, "the process declared no timer"),
    ],
)
def test_what_it_did_not_declare_it_did_not_do(changes: dict[str, Any], observed: str) -> None:
    run = silent(declarations=in_cpp(declarations(**changes)))
    assert observed in failing("messages.count", run, **COUNT)
