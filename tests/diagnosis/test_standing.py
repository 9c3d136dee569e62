"""Where a program stands that does not go on: its line, and what to do about it."""

from __future__ import annotations

from typing import Any

import pytest

from grader.findings.finding import Status
from grader.recording.model import Declaration, Kind, Recording
from grader.recording.submission import BuildRecord, SourceFile, SourceFunction
from tests.checks.builder import (
    INSTALLED,
    SOURCE,
    after,
    at,
    call,
    calls,
    declarations,
    declared,
    died,
    endpoint,
    failing,
    judge,
    messages,
    output,
    package,
    recording,
    sent,
    silent,
    stimulus,
    submission,
    text,
    traceback,
)

STRING = "std_msgs/msg/String"
WITHIN = {"topic": "/cmd_vel", "at_least": 1}
MORE = {"topic": "/cmd_vel", "at_least": 3}
HANGS = tuple(call(0.5 * n, None) for n in range(2, 8))


def stands(
    code: str = "time.sleep(1.0)",
    loop: str = "",
    *,
    began_s: float = 1.2,
    seen_s: float = 4.4,
    in_callback: bool = True,
    function: str = "scan_callback",
    **changes: Any,
) -> Declaration:
    """What the tracer tells of a call that has not returned."""
    data: dict[str, Any] = {
        "function": function,
        "in_callback": in_callback,
        "file": INSTALLED,
        "line": 19,
        "text": code,
        "loop_file": INSTALLED,
        "loop": 18 if loop else 0,
        "loop_text": loop,
        "began_ns": at(began_s),
        "seen_ns": at(seen_s),
    }
    return declared("stands", seen_s, **{**data, **changes})


def blocked(*found: Declaration, **changes: Any) -> Recording:
    told = {"calls": HANGS, "declarations": (*declarations(), *found)}
    return silent(**{**told, **changes})


def test_a_callback_that_never_returns_is_named_with_its_line() -> None:
    run = blocked(stands("self.drive(0.1)", "while d > 0.2:"))
    finding = judge("messages.count", run, **WITHIN)
    assert "`scan_callback` does not return: it is in line 18, `while d > 0.2:`" in text(finding)
    assert "from 1.20 s after launch on" in finding.observed
    assert "Write `if` in place of the loop" in finding.hint
    assert [(one.file, one.line) for one in finding.evidence.places] == [(SOURCE, 18)]


UNKEPT = (
    f"{SOURCE}:25:75: warning: ignoring return value of ‘std::future<...> std::async(launch, ...) "
    "[with _Fn = Bot::tick()::<lambda()>]’, declared with attribute ‘nodiscard’ [-Wunused-result]\n"
)


@pytest.mark.parametrize("came", [{}, messages([0.9])])
def test_a_future_of_async_that_is_not_kept_is_told_where_a_callback_blocks(came: Any) -> None:
    build = BuildRecord(succeeded=True, duration_s=9.0, log=UNKEPT)
    built = submission(package(build_type="ament_cmake"), build=build)
    found = judge("messages.count", blocked(submission=built, messages=came), **MORE)
    assert "`std::async` returns waits in its destructor" in found.observed
    assert "Keep the future in a member" in found.hint
    assert [(one.file, one.line) for one in found.evidence.places] == [(SOURCE, 25)]
    # A node that answers at once is not blocked by it.
    quick = blocked(submission=built, messages=came, calls=calls())
    assert "async" not in failing("messages.count", quick, **MORE)


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("self.rate.sleep()", "A rate waits for a timer"),
        ("response = self.client.call(request)", "use call_async()"),
        ("rclpy.spin_until_future_complete(self, future)", "Do not spin or wait for a future"),
        ("with self.lock:", "holds this lock already"),
        ("self.mutex.acquire()", "holds this lock already"),
        ("name = input('name?')", "no keyboard"),
        ("self.client.wait_for_service()", "No server of this name and type"),
        ("time.sleep(60)", "While a callback sleeps"),
    ],
)
def test_what_a_callback_waits_for_is_told_by_its_line(line: str, hint: str) -> None:
    found = judge("messages.count", blocked(stands(line)), **WITHIN)
    assert hint in found.hint
    assert f"it is in line 19, `{line}`" in found.observed
    assert 20 <= len(text(found).split()) <= 100


def test_a_line_that_waits_for_ever_counts_more_than_the_loop_around_it() -> None:
    found = failing(
        "messages.count", blocked(stands("rate.sleep()", "for i in range(3):")), **WITHIN
    )
    assert "in line 19, `rate.sleep()`" in found


def test_a_loop_before_spin_is_named_and_not_a_missing_spin() -> None:
    loop = stands("time.sleep(0.3)", "while rclpy.ok():", in_callback=False, function="__init__")
    run = blocked(declarations=(*declarations(spin=False, timer_s=None), loop))
    found = failing("messages.count", run, **WITHIN)
    assert (
        "rclpy.spin() is not reached, because `__init__` does not return: it is in line 18" in found
    )
    assert "was never called" not in found


def test_a_server_that_never_comes_is_told_before_spin_too() -> None:
    loop = "while not self.client.wait_for_service(timeout_sec=1.0):"
    stand = stands("self.get_logger().info('waiting')", loop, in_callback=False)
    run = blocked(declarations=(*declarations(spin=False, timer_s=None), stand))
    assert "No server of this name" in failing("messages.count", run, **WITHIN)


def test_a_program_that_spins_does_not_stand_in_main() -> None:
    own_loop = stands("work()", "while rclpy.ok():", in_callback=False, function="main")
    assert "`main` does not return" not in failing("messages.count", blocked(own_loop), **WITHIN)


def test_the_slow_call_of_a_callback_is_named_where_it_makes_messages_late() -> None:
    times_s = after([1.0] * 3)
    calls = [stands(began_s=t, seen_s=t + 0.9, function="timer_callback") for t in times_s]
    run = recording(messages=messages(times_s), declarations=(*declarations(), *calls))
    finding = judge("timing.period", run, topic="/cmd_vel", period="300 ms")
    assert "`timer_callback` takes 900 ms or more: it is in line 19, `time.sleep(1.0)`" in text(
        finding
    )
    assert finding.evidence.places[0].line == 19


@pytest.mark.parametrize(
    "changes",
    [
        {"line": "19"},
        {"line": -1},
        {"began_ns": 2**70},
        {"file": ["x"]},
        {"file": "/etc/passwd", "loop_file": "/etc/passwd"},
    ],
)
def test_a_process_may_declare_anything_of_where_it_stands(changes: dict[str, Any]) -> None:
    found = judge("messages.count", blocked(stands(**changes)), **WITHIN)
    assert found.status is Status.FAILED
    assert "something blocks the executor" in found.observed


def written(*uses: str) -> Any:
    functions = (SourceFunction("Bot.tick", 22), SourceFunction("Bot.heard", 30))
    source = SourceFile(SOURCE, "bot_publisher.node", functions=functions, uses=uses)
    return submission(package(sources=(source,)))


def test_publish_never_called_is_told_so() -> None:
    timer = declared("timer", period_s=0.3, callback="Bot.tick", node="/bot_publisher", group={})
    told = (*declarations(timer_s=None), timer)
    finding = judge(
        "messages.count",
        silent(submission=written("get_logger", "info"), declarations=told),
        **WITHIN,
    )
    assert "no line of the program calls publish()" in finding.observed
    assert [one.line for one in finding.evidence.places] == [22]
    run = silent(submission=written("publish"), declarations=told)
    assert "no line of the program" not in failing("messages.count", run, **WITHIN)


def crash(raised: str) -> Recording:
    timer = declared("timer", callback="NoneType", file=INSTALLED, line=20, node="/x", period_s=0.3)
    return silent(
        processes=(died(1),),
        log=output(traceback(raised, source="rclpy.spin(node)", line=35)),
        submission=written("publish"),
        declarations=(*declarations(), timer),
    )


@pytest.mark.parametrize(
    ("raised", "line"),
    [
        ("TypeError: 'NoneType' object is not callable", 20),
        ("TypeError: Bot.tick() takes 0 positional arguments but 1 was given", 22),
        ("RuntimeError: something else", 35),
    ],
)
def test_of_what_rclpy_raises_in_spin_the_line_is_that_of_the_callback(
    raised: str, line: int
) -> None:
    finding = judge("node.alive", crash(raised))
    assert [one.line for one in finding.evidence.places] == [line]
    # Of the traceback only the student's frames, and what was raised.
    assert not any("/rclpy/" in one for one in finding.evidence.log)
    assert finding.evidence.log[-1] == raised


def test_condition_in_a_faster_timer_is_told_from_a_wrong_period() -> None:
    times_s = after([0.3, 0.4] * 5)
    run = recording(messages=messages(times_s), declarations=declarations(timer_s=0.1))
    found = failing("timing.period", run, topic="/cmd_vel", period="300 ms")
    assert "a timer of 100 ms, and publishes in one of 3 or 4 calls" in found
    assert "publish in every call" in found


@pytest.mark.parametrize(
    ("factor", "words"), [(100.0, "100 times too large"), (-1.0, "wrong sign")]
)
def test_of_a_logged_value_the_wrong_sign_or_unit_is_told(factor: float, words: str) -> None:
    times_s = [1.0, 1.3, 1.6, 1.9]
    values = [{"data": 0.5 + t} for t in times_s]
    lines = [f"x = {(0.5 + t) * factor:.2f}" for t in times_s]
    run = recording(
        messages={},
        sent=sent(times_s, values=values),
        endpoints=(endpoint("/chatter", kind=Kind.SUBSCRIPTION, type=STRING), stimulus()),
        log=tuple(
            one for t, line in zip(times_s, lines, strict=True) for one in output(line, time_s=t)
        ),
        submission=written("info"),
        declarations=(
            *declarations(),
            declared("subscription", topic="/chatter", callback="Bot.heard", node="/bot_publisher"),
        ),
    )
    finding = judge("log.follows", run, topic="/chatter", fields=["data"])
    assert words in finding.observed
    assert [one.line for one in finding.evidence.places] == [30]
