"""messages.count and messages.equal, and why a topic is silent."""

import math
import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.findings.finding import Status
from tests.checks.builder import (
    RELIABLE,
    STOP_S,
    declarations,
    declared,
    endpoint,
    every,
    failing,
    judge,
    message,
    messages,
    output,
    reader,
    recording,
    sent,
    silent,
    taken,
    traceback,
    twist,
)

UNREADABLE = (
    "1 message on `/cmd_vel` cannot be read: the bytes that were published are not a message"
)
(NAN_OF_MINUS_ONE,) = struct.unpack("<d", b"\xff" * 8)
VALUE = {"linear": {"x": 1.0}, "angular": {"z": 0.5}}


def count(run, **limits):
    return judge("messages.count", run, topic="/cmd_vel", **limits)


def equal(run, value=None, **parameters):
    return judge("messages.equal", run, topic="/cmd_vel", value=value or VALUE, **parameters)


def stream(*values):
    """A run with these values, one every 300 ms."""
    received = (message(0.4 + 0.3 * n, v, sequence=n) for n, v in enumerate(values, 1))
    return recording(messages={"/cmd_vel": tuple(received)})


def unequal(value):
    """The finding's text of a run in which every message has this value."""
    finding = equal(stream(*[value] * 12))
    assert finding.status is Status.FAILED, finding
    return finding.observed


class TestCount:
    def test_messages_of_other_bytes_are_named(self):
        run = replace(recording(messages=messages(every(0.3, 2))), unreadable={"/cmd_vel": 1})
        assert UNREADABLE in failing("messages.count", run, topic="/cmd_vel", at_least=3)
        assert UNREADABLE in failing("messages.equal", run, topic="/cmd_vel", value=VALUE)
        silent_run = replace(run, messages={})
        assert UNREADABLE in failing("messages.count", silent_run, topic="/cmd_vel", at_least=1)

    @pytest.mark.parametrize(
        ("number", "limits", "status"),
        [
            (1, {"exactly": 1}, Status.PASSED),
            (2, {"exactly": 1}, Status.FAILED),
            (3, {"at_least": 3}, Status.PASSED),
            (2, {"at_least": 3}, Status.FAILED),
            (3, {"at_most": 3}, Status.PASSED),
            (4, {"at_most": 3}, Status.FAILED),
            (0, {"at_most": 3}, Status.PASSED),
            (3, {"at_least": 2, "at_most": 3}, Status.PASSED),
            (0, {"exactly": 0}, Status.PASSED),
        ],
    )
    def test_both_limits_of_a_count_hold(self, number, limits, status):
        run = recording(messages=messages(every(0.3, number)) if number else {})
        assert count(run, **limits).status is status

    def test_a_message_lost_on_its_way_was_published_all_the_same(self):
        run = recording(messages={"/cmd_vel": (message(1.0, sequence=2),)})
        finding = count(run, exactly=1)
        assert finding.status is Status.FAILED
        assert "2 messages (1 of them lost on the way)" in finding.observed
        assert count(run, at_least=2).status is Status.PASSED

    def test_too_many_where_one_was_expected(self):
        finding = count(recording(), exactly=1)
        assert finding.observed == "12 messages"
        assert finding.expected == "exactly 1 message on `/cmd_vel`"
        assert "Publish once" in finding.hint

    def test_too_many_from_two_publishers(self):
        run = recording(endpoints=(endpoint(), endpoint(appeared_s=0.5, node="/twin")))
        found = failing("messages.count", run, topic="/cmd_vel", exactly=6)
        assert "from 2 publishers (in `/bot_publisher` and `/twin`)" in found

    @pytest.mark.parametrize(
        ("answers_s", "status"),
        [
            ((1.1, 1.6, 2.1), Status.PASSED),
            # A greeting is no answer, and one that is missing is not counted here.
            ((0.5, 1.1, 2.1), Status.PASSED),
            ((1.1, 1.6, 1.61, 2.1), Status.FAILED),
        ],
    )
    def test_one_message_for_each_of_a_stimulus(self, answers_s, status):
        asked = sent((1.0, 1.5, 2.0))
        finding = count(
            recording(messages=messages(answers_s), sent=asked), stimulus="/chatter", at_most=1
        )
        assert finding.status is status
        assert finding.expected.endswith("on `/cmd_vel` for each message on `/chatter`")
        assert "for 3 messages on `/chatter`" in finding.observed

    def test_a_stimulus_that_nothing_was_sent_of(self):
        run = recording(sent={"/chatter": ()})
        found = failing("messages.count", run, topic="/cmd_vel", stimulus="/chatter", at_most=1)
        assert "created no subscription" in found

    def test_too_few_because_the_machine_was_busy(self):
        run = recording(messages=messages(every(0.3, 6)), disturbance=taken(1.0, 4.0, waited_s=2.5))
        finding = count(run, at_least=12)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)


class TestSilence:
    def found(self, **changes):
        return failing("messages.count", silent(**changes), topic="/cmd_vel", at_least=1)

    def test_qos_is_not_blamed_when_one_reader_matches(self):
        offered = replace(RELIABLE, reliability="best_effort")
        found = self.found(endpoints=(endpoint(qos=offered), reader(), reader(qos=offered)))
        assert "QoS" not in found

    def test_a_long_timer_is_not_blamed_when_another_one_fires(self):
        both = (*declarations(timer_s=300.0), *declarations(timer_s=0.3))
        assert "5 min" not in self.found(declarations=both)

    def test_without_a_tracer_spin_is_not_missed(self):
        assert "spin" not in self.found(declarations=())

    def test_what_it_printed_is_shown_but_not_how_it_ended(self):
        complained = output("no front beam", time_s=STOP_S - 1.0)
        ended = output(traceback("rcl_shutdown already called"), time_s=STOP_S + 0.1)
        finding = count(silent(log=(*complained, *ended)), at_least=1)
        assert finding.evidence.log == ("no front beam",)

    def test_a_publisher_that_our_tracer_could_not_match_is_our_fault(self):
        held = declared("held", topic="/cmd_vel", waited_s=2.0, matched=False)
        run = silent(declarations=(*declarations(), held))
        finding = count(replace(run, disturbance=taken(0.5, 1.5, waited_s=0.6)), exactly=1)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        # On a machine that nothing disturbed it is no excuse, since a process could declare it.
        assert count(run, exactly=1).status is Status.FAILED

    def test_a_run_with_too_little_cpu_time_is_no_failure(self):
        finding = count(silent(disturbance=taken(0.5, 4.4, waited_s=2.5)), at_least=1)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        assert "the machine took up to 2.5 s" in finding.observed

    @pytest.mark.parametrize(
        ("check", "parameters"),
        [
            ("messages.equal", {"value": VALUE}),
            ("messages.sequence", {"field": "data", "step": 1}),
            ("timing.period", {"period": "300 ms"}),
            ("timing.rate", {"at_least": "9 Hz"}),
            ("timing.latency", {"stimulus": "/chatter", "median": "20 ms"}),
            ("executor.timer", {}),
        ],
    )
    def test_the_same_words_in_every_check_that_needs_messages(self, check, parameters):
        run = silent(declarations=declarations(timer_s=300.0))
        found = failing(check, run, topic="/cmd_vel", **parameters)
        assert "the process declared a timer of 5 min" in found


class TestEqual:
    def test_no_tolerance_makes_true_of_false(self):
        run = recording(messages=messages(every(0.3), {"success": True, "sum": 2.5}))
        wanted = {"success": False, "sum": 2.0}
        assert "success = true instead of false" in equal(run, wanted, tolerance=1).observed
        assert equal(run, {**wanted, "success": True}, tolerance=1).status is Status.PASSED

    def test_a_tolerance_may_be_of_one_field_and_others_are_exact(self):
        run = recording(messages=messages(every(0.3), {"a": 1.2, "b": 1.2}))
        finding = equal(run, {"a": 1.0, "b": 1.0}, tolerance={"a": 0.5})
        assert "has b = 1.2 instead of 1" in finding.observed
        assert "(a within 0.5)" in finding.expected
        passed = equal(run, {"a": 1.0, "b": 1.0}, tolerance={"a": 0.5, "b": 0.5})
        assert passed.status is Status.PASSED

    def test_passes_for_nested_values_and_for_paths(self):
        paths = {"linear.x": 1.0, "angular.z": 0.5}
        for value in (VALUE, paths, {"linear": {"x": 1}, "angular.z": 0.5}):
            finding = equal(recording(), value)
            assert finding.status is Status.PASSED
            assert finding.observed == "all of 12 messages"

    @pytest.mark.parametrize(
        ("values", "hint"),
        [
            ([twist()] * 4 + [twist((2, 0, 0))], "4 messages of 5 are right. Look for what makes"),
            ([twist((1.5, 0, 0))] * 3, "Look where the program sets `linear.x` before publish"),
        ],
    )
    def test_the_hint_depends_on_whether_other_messages_are_right(self, values, hint):
        assert hint in equal(stream(*values)).hint

    def test_expected_is_stated_with_the_rest(self):
        assert equal(recording()).expected == (
            "linear.x = 1.0, angular.z = 0.5, all else 0 in every message on `/cmd_vel`"
        )

    def test_the_first_wrong_message_is_named(self):
        bad = twist(linear=(2.0, 0, 0))
        finding = equal(stream(*[twist()] * 4, bad, bad, *[twist()] * 6))
        assert "message 5 of 12 has linear.x = 2.0 instead of 1.0" in finding.observed
        assert "(2 of 12 messages wrong)" in finding.observed
        assert finding.evidence.moments[0].time_s == pytest.approx(0.7 + 4 * 0.3)
        assert finding.evidence.tables[0].rows == (("linear.x", "1.0", "2.0"),)

    @pytest.mark.parametrize(
        ("value", "words"),
        [
            (twist((0.5, 0, 0), (0, 0, 1.0)), "linear.x and angular.z are swapped"),
            (twist((1, 0, 0), (0.5, 0, 0)), "the 0.5 stands in angular.x instead of angular.z"),
            (twist((0, 0, 1), (0, 0, 0.5)), "the 1.0 stands in linear.z instead of linear.x"),
            (twist((-1, 0, 0)), "linear.x has the wrong sign"),
            (twist((1000, 0, 0)), "linear.x is 1000 times too large"),
            (twist((0.01, 0, 0)), "linear.x is 100 times too small"),
            (twist(angular=(0, 0, 28.6478897565)), "angular.z is in degrees"),
            (twist(angular=(0, 0, 0.008726646)), "in radians already"),
            (twist(angular=(0, 0, math.nan)), "angular.z is not a number"),
            # What rclpy makes of `msg.linear.x = 1`, in Python 3.11 and in 3.12.
            (
                twist((5e-324, 0, 0)),
                "linear.x is a float field, but an integer, a text or a numpy.float32 was",
            ),
            # Of -1 in Python 3.11 and in 3.12, and of '1.0' in both.
            (twist((-math.nan, 0, 0)), "linear.x is not a number"),
            (twist((NAN_OF_MINUS_ONE, 0, 0)), "but an integer, a text or a numpy.float32 was"),
            (twist((math.inf, 0, 0)), "linear.x is infinite"),
            (twist((0, 0, 0), (0, 0, 0)), "every number in it is zero, as in a new message"),
        ],
    )
    def test_common_mistakes_are_named(self, value, words):
        assert words in unequal(value)

    def test_one_that_was_not_filled_among_others_that_are_right(self):
        finding = equal(stream(twist(), twist((0, 0, 0), (0, 0, 0)), *[twist()] * 10))
        assert "as in a new message, although others are right" in finding.observed
        assert "a second publish()" in finding.hint
        assert "(1 of 12 messages wrong)" in finding.observed

    def test_a_value_that_adds_up(self):
        finding = equal(stream(*(twist((float(n), 0, 0)) for n in range(1, 12))))
        assert "linear.x grows from message to message" in finding.observed

    def test_the_rest_must_be_zero_unless_it_may_be_anything(self):
        value = twist((1.0, 0.1, 0))
        assert "linear.y = 0.1 instead of 0.0" in unequal(value)
        assert equal(stream(value), rest="any").status is Status.PASSED

    @pytest.mark.parametrize(
        ("value", "words"),
        [
            ({"linear": {"w": 1.0}}, "linear has no field 'w'; it has x, y, z."),
            ({"liner": {"x": 1.0}}, "Did you mean 'linear'?"),
            ({"linear": 1.0}, "linear is a message: name its fields (x, y, z)"),
            ({"linear": {"x": {"y": 1.0}}}, "linear.x has no field 'y': it is a plain value"),
            ({"linear.x": "fast"}, "linear.x is a number, but 'fast' is expected of it"),
        ],
    )
    def test_a_wrong_field_in_the_assignment_costs_no_student_a_point(self, value, words):
        finding = equal(recording(), value)
        assert finding.status is Status.ERROR
        assert "the assignment expects what cannot be" in finding.observed
        assert words in finding.observed

    def test_arrays_are_compared_with_their_length(self):
        def run(data):
            value = {"data": data}
            return recording(messages={"/d": (message(1.0, value, topic="/d"),)})

        parameters = {"topic": "/d", "value": {"data": [1.0, 2.0]}}
        assert judge("messages.equal", run([1.0, 2.0]), **parameters).status is Status.PASSED
        for other in ([1.0], [1.0, 2.0, 3.0], [2.0, 1.0], []):
            found = failing("messages.equal", run(other), **parameters)
            assert "instead of [1.0, 2.0]" in found

    def test_a_float32_field_holds_the_nearest_float32(self):
        # 0.1 as IEEE 754 single precision, from the standard's own arithmetic.
        single = 0.100000001490116119384765625
        run = recording(messages={"/f": (message(1.0, {"data": single}, topic="/f"),)})
        finding = judge("messages.equal", run, topic="/f", value={"data": 0.1})
        assert finding.status is Status.PASSED

    @given(
        x=st.floats(-1e6, 1e6), z=st.floats(-1e6, 1e6), tolerance=st.floats(1e-9, 10),
        off=st.floats(-20, 20),
    )  # fmt: skip
    def test_exactly_what_lies_within_the_tolerance_passes(self, x, z, tolerance, off):
        run = recording(messages=messages([1.0, 1.3], twist((x + off, 0, 0), (0, 0, z))))
        finding = equal(run, {"linear": {"x": x}, "angular": {"z": z}}, tolerance=tolerance)
        distance = abs((x + off) - x)
        if distance < 0.99 * tolerance:
            assert finding.status is Status.PASSED
        elif distance > 1.01 * tolerance and distance > 1e-6 * max(abs(x), 1.0):
            assert finding.status is Status.FAILED
            assert "linear.x = " in finding.observed

    @given(st.integers(0, 11), st.floats(-10, 10).filter(lambda v: abs(v - 1.0) > 1e-6))
    def test_one_wrong_message_anywhere_is_found(self, index, wrong):
        finding = equal(stream(*(twist((wrong if n == index else 1.0, 0, 0)) for n in range(12))))
        assert finding.status is Status.FAILED
        assert f"message {index + 1} of 12" in finding.observed


@pytest.mark.parametrize(
    ("value", "status"),
    [
        ({"data": {"contains": "hello"}}, "passed"),
        ({"data": {"contains": "bye"}}, "failed"),
        ({"data": {"matches": "^Hello .*: [0-9]+$"}}, "passed"),
        ({"data": {"matches": "^World"}}, "failed"),
        ({"data": {"number": "> 41"}}, "passed"),
        ({"data": {"number": "> 42"}}, "failed"),
        ({"data": {"number": 42}}, "passed"),
        ({"data": {"contains": "hello", "number": 41}}, "failed"),
        ({"number(data)": "40 .. 44"}, "passed"),
        ({"number(data)": 43}, "failed"),
    ],
)
def test_a_text_is_judged_by_what_it_contains_or_matches_or_by_a_number_in_it(value, status):
    said = message(1.0, {"data": "Hello World: 42"}, type="std_msgs/msg/String")
    found = judge(
        "messages.equal", recording(messages={"/cmd_vel": (said,)}), value=value, topic="/cmd_vel"
    )
    assert found.status.value == status


def test_a_wrong_text_is_told_with_what_was_asked_of_it():
    said = message(1.0, {"data": "bye"}, type="std_msgs/msg/String")
    run = recording(messages={"/cmd_vel": (said,)})
    found = judge("messages.equal", run, topic="/cmd_vel", value={"data": {"contains": "hello"}})
    assert found.expected.startswith("data contains “hello”")
    assert "data = 'bye' instead of a text that contains “hello”" in found.observed
