"""messages.follows: values that follow another topic, and what they are where they do not."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from grader.findings.finding import Status
from grader.recording.model import Recording
from grader.spec.expression import yaw
from tests.checks.builder import (
    endpoint,
    failing,
    judge,
    message,
    reader,
    recording,
    taken,
)

STATUS, ODOM = "/status", "/odom"
FIELDS = {
    "pose.x": "pose.pose.position.x",
    "pose.theta": "yaw(pose.pose.orientation)",
    "speed": "twist.twist.linear.x",
}
PARAMETERS = {"topic": STATUS, "source": ODOM, "fields": FIELDS, "tolerance": 0.01}
FIRST_S, STEP_S, COUNT = 1.0, 0.05, 60


def place(time_s: float) -> tuple[float, float, float]:
    """x, heading and speed of a robot that drives an arc across the wrap."""
    since_s = time_s - FIRST_S
    return 0.3 * since_s, math.remainder(2.0 + 0.9 * since_s, math.tau), 0.1 + 0.05 * since_s


def odometry(time_s: float) -> dict:
    x, heading, speed = place(time_s)
    return {
        "pose": {
            "pose": {
                "position": {"x": x, "y": -2.0 * x, "z": 0.0},
                "orientation": {
                    "x": 0.0,
                    "y": 0.0,
                    "z": math.sin(heading / 2),
                    "w": math.cos(heading / 2),
                },
            }
        },
        "twist": {"twist": {"linear": {"x": speed}, "angular": {"z": 0.9}}},
    }


TIMES = [FIRST_S + STEP_S * index for index in range(COUNT)]
SOURCES = tuple(
    message(t, odometry(t), sequence=n, topic=ODOM, type="nav_msgs/msg/Odometry")
    for n, t in enumerate(TIMES, start=1)
)


def status(x: float, theta: float, speed: float) -> dict:
    return {"pose": {"x": x, "theta": theta}, "speed": speed}


def run(values, delay_s: float = 0.002, times=None, **changes) -> Recording:
    """A run in which the node makes a message of each odometry message."""
    times = TIMES if times is None else times
    messages = tuple(
        message(t + delay_s, values(t), sequence=n, topic=STATUS, type="bot_msgs/msg/Status")
        for n, t in enumerate(times, start=1)
    )
    ends = (
        endpoint(STATUS, type="bot_msgs/msg/Status"),
        reader(STATUS, type="bot_msgs/msg/Status"),
    )
    return recording(
        **{"messages": {STATUS: messages, ODOM: SOURCES}, "endpoints": ends, **changes}
    )


def right(time_s: float) -> dict:
    return status(*place(time_s))


def from_sources(value, values) -> Recording:
    """A run in which the source has other values."""
    sources = tuple(
        message(t, value(t), sequence=n, topic=ODOM, type="nav_msgs/msg/Odometry")
        for n, t in enumerate(TIMES, start=1)
    )
    subject = run(values)
    return replace(subject, messages={**subject.messages, ODOM: sources})


def verdict(subject: Recording, **changes):
    return judge("messages.follows", subject, **{**PARAMETERS, **changes})


def failure(subject: Recording) -> str:
    return failing("messages.follows", subject, **PARAMETERS)


class TestExpressions:
    def test_both_sides_may_be_expressions_and_angles_are_compared_on_the_circle(self):
        fields = {
            "pose.theta - 7": "yaw(pose.pose.orientation) - 7",
            "speed / 2": "hypot(twist.twist.linear.x, 0) / 2",
        }
        assert verdict(run(right), fields=fields).status is Status.PASSED
        fields["speed / 2"] = "hypot(twist.twist.linear.x, 0) / 3"
        found = verdict(run(right), fields=fields)
        assert found.status is Status.FAILED
        assert "`speed / 2` = " in found.observed

    def test_each_field_may_have_its_own_tolerance(self):
        def rough(time_s):
            x, theta, speed = place(time_s)
            return status(x + 0.05, theta, speed)

        tolerance = {"pose.x": 0.06, "pose.theta": 0.01, "speed": 0.01}
        assert verdict(run(rough), tolerance=tolerance).status is Status.PASSED
        tolerance = {**tolerance, "pose.x": 0.01, "speed": 0.02}
        found = verdict(run(rough), tolerance=tolerance)
        assert found.status is Status.FAILED
        assert "`pose.x`" in found.observed and "speed" not in found.observed
        assert "(pose.x within 0.01, pose.theta within 0.01, speed within 0.02)" in found.expected


class TestPasses:
    def test_a_message_for_each_message(self):
        found = verdict(run(right))
        assert found.status is Status.PASSED
        assert "all of 60 messages" in found.observed

    def test_a_heading_from_zero_to_a_full_turn(self):
        subject = run(
            lambda t: {**right(t), "pose": {**right(t)["pose"], "theta": place(t)[1] % math.tau}}
        )
        assert verdict(subject).status is Status.PASSED

    def test_a_timer_that_publishes_the_newest(self):
        ticks = [FIRST_S + 0.31 + 0.1 * index for index in range(20)]

        def newest(time_s):
            return right(max(t for t in TIMES if t <= time_s))

        assert verdict(run(newest, times=ticks)).status is Status.PASSED

    def test_zeros_before_the_first_odometry_do_not_count(self):
        early = [0.2 + 0.1 * index for index in range(12)]
        start = run(lambda _: status(0.0, 0.0, 0.0), times=early).on(STATUS)
        good = run(right)
        both = {STATUS: (*start, *good.on(STATUS)[6:]), ODOM: SOURCES}
        assert verdict(recording(messages=both)).status is Status.PASSED

    def test_no_lag_is_reported_where_the_machine_kept_the_node_waiting(self):
        late = run(lambda t: right(t - 0.8), times=TIMES[20:])
        assert verdict(late).status is Status.FAILED
        busy = recording(messages=late.messages, disturbance=taken(0.1, 4.0, waited_s=1.0))
        assert (verdict(busy).status, verdict(busy).disturbed) == (Status.ERROR, True)

    def test_what_still_waits_in_queues_after_a_delay_is_not_reported_as_a_lag(self):
        """The delay is before the newest values that a quick node could have had."""
        late = run(lambda t: right(t - 1.2), times=TIMES[30:34])
        assert "s earlier" in verdict(late, at_least=4).observed
        for waited_s, is_undecided in ((0.3, False), (0.8, True)):
            busy = taken(TIMES[30] - 1.9, TIMES[30] - 1.2, waited_s=waited_s)
            found = verdict(recording(messages=late.messages, disturbance=busy), at_least=4)
            assert (found.disturbed, found.status is Status.FAILED) == (
                is_undecided,
                not is_undecided,
            )

    def test_a_node_that_does_not_lag_passes_on_a_busy_machine(self):
        busy = recording(messages=run(right).messages, disturbance=taken(0.1, 4.0, waited_s=1.0))
        assert verdict(busy).status is Status.PASSED

    def test_after_the_source_has_ended_its_last_values_stay_right(self):
        later = [TIMES[-1] + 0.1 * index for index in range(10)]
        assert verdict(run(lambda _: right(TIMES[-1]), times=later)).status is Status.PASSED

    def test_what_is_made_of_a_message_that_was_not_recorded_is_not_judged(self):
        found = run(right)
        for lost in (SOURCES[30], SOURCES[-1]):
            kept = tuple(item for item in SOURCES if item is not lost)
            subject = recording(messages={STATUS: found.on(STATUS), ODOM: kept})
            assert verdict(subject, tolerance=0.001).status is Status.PASSED
            wrong = run(lambda t: right(t) if t != TIMES[10] else status(9.0, 0.0, 0.0))
            subject = recording(messages={STATUS: wrong.on(STATUS), ODOM: kept})
            assert "message 11 is wrong" in verdict(subject).evidence.moments[0].label


class TestExplains:
    @pytest.mark.parametrize(
        ("theta", "words"),
        [
            (lambda heading: math.sin(heading / 2), "`z` of the quaternion, which is no angle"),
            (math.degrees, "the yaw in degrees"),
            (lambda heading: -heading, "the yaw with the wrong sign"),
            (lambda heading: heading / 2, "half of the yaw"),
            (lambda heading: 2 * math.acos(math.cos(heading / 2)), "lost the sign"),
            (lambda heading: math.atan(math.tan(heading)), "in a wrong quadrant"),
            (lambda _: 0.0, "no change from message to message"),
            (lambda _: 0.5, "no change from message to message"),
            (lambda _: math.nan, "not a finite number"),
        ],
    )
    def test_a_wrong_heading_is_explained(self, theta, words):
        found = failure(run(lambda t: status(place(t)[0], theta(place(t)[1]), place(t)[2])))
        assert "`pose.theta` = " in found
        assert words in found
        assert "yaw(pose.pose.orientation)" in found

    def test_twice_the_asin_where_w_is_negative(self):
        def turned(time_s):
            sent = odometry(time_s)
            if place(time_s)[1] < 0.0:
                quaternion = sent["pose"]["pose"]["orientation"]
                quaternion.update({key: -number for key, number in quaternion.items()})
            return sent

        def values(time_s):
            z = turned(time_s)["pose"]["pose"]["orientation"]["z"]
            return status(place(time_s)[0], 2.0 * math.asin(z), place(time_s)[2])

        found = failure(from_sources(turned, values))
        assert "it is 2 asin(z), which is wrong where w is negative" in found
        assert verdict(from_sources(turned, right)).status is Status.PASSED

    def test_what_is_right_in_most_messages_explains_no_others(self):
        def values(time_s):
            x, heading, speed = place(time_s)
            off = 1.0 if time_s in (TIMES[20], TIMES[40]) else 0.0
            return status(x + off, heading + off, speed + off)

        found = failure(run(values))
        assert "2 of 60 messages wrong" in found
        assert "it is" not in found

    def test_another_field_of_the_source(self):
        found = failure(run(lambda t: status(-2.0 * place(t)[0], *place(t)[1:])))
        assert "it is `pose.pose.position.y`" in found

    def test_a_speed_that_has_lost_its_sign(self):
        def speed(time_s):
            return 0.3 - 0.2 * (time_s - FIRST_S)

        def sent(time_s):
            return {**odometry(time_s), "twist": {"twist": {"linear": {"x": speed(time_s)}}}}

        subject = from_sources(sent, lambda t: status(*place(t)[:2], abs(speed(t))))
        assert "without its sign" in failure(subject)

    def test_fields_that_are_swapped(self):
        found = failure(run(lambda t: status(place(t)[2], place(t)[1], place(t)[0])))
        assert "`pose.x`" in found and "it is `twist.twist.linear.x`" in found
        assert "`speed`" in found and "it is `pose.pose.position.x`" in found

    def test_sources_with_arrays_of_other_lengths_are_explained_all_the_same(self):
        subject = from_sources(
            lambda t: {**odometry(t), "ranges": [1.0] * (60 - TIMES.index(t))},
            lambda t: status(-7.0 * place(t)[0], *place(t)[1:]),
        )
        assert "`pose.x` = " in failure(subject)

    @pytest.mark.parametrize("items", [[], [1.0]])
    def test_an_array_that_is_too_short(self, items):
        subject = run(lambda t: {**right(t), "speeds": items})
        fields = {"speeds[1]": "twist.twist.linear.x"}
        found = verdict(subject, fields=fields)
        assert found.status is Status.FAILED
        assert "the array is too short" in found.observed

    def test_values_that_never_change(self):
        found = failure(run(lambda _: right(FIRST_S)))
        assert "`pose.x` = 0 instead of" in found
        assert found.count("no change from message to message") == 1

    def test_fields_that_are_wrong_in_the_same_way_are_explained_together(self):
        found = failure(run(lambda t: status(9.0, math.degrees(place(t)[1]), 9.0)))
        assert found.count("no change from message to message") == 1
        assert "`speed` = 9" in found.partition(";")[0] and "the yaw in degrees" in found

    def test_values_that_lag_are_explained(self):
        found = failure(run(lambda t: right(t - 1.0), times=TIMES[20:]))
        assert "those of `/odom` 1.0" in found and "s earlier" in found

    def test_values_of_different_moments(self):
        mixed = run(lambda t: status(*place(t)[:2], place(t - 0.4)[2]), times=TIMES[10:])
        assert "different moments" in failure(mixed)

    def test_a_single_wrong_message_is_found(self):
        found = verdict(run(lambda t: right(t) if t != TIMES[30] else status(9.0, 0.0, 0.0)))
        assert found.status is Status.FAILED
        assert "1 of 60 messages wrong" in found.observed
        assert found.evidence.moments[0].label == "message 31 is wrong"


class TestWhatCannotBeJudged:
    def test_a_source_that_was_not_recorded(self):
        lost = recording(messages={STATUS: run(right).on(STATUS)})
        assert verdict(lost).status is Status.ERROR

    def test_a_source_that_does_not_change(self):
        still = from_sources(lambda _: odometry(FIRST_S), right)
        assert verdict(still).status is Status.ERROR

    def test_a_field_that_the_type_does_not_have(self):
        found = verdict(run(right), fields={"pose.z": "pose.pose.position.x"})
        assert found.status is Status.ERROR
        assert "has no field 'z'" in found.observed


@given(st.floats(-math.pi, math.pi), st.floats(-1.5, 1.5), st.floats(-math.pi, math.pi))
def test_the_yaw_agrees_with_scipy(roll, pitch, heading):
    turn = Rotation.from_euler("xyz", [roll, pitch, heading])
    assert abs(math.remainder(yaw(*turn.as_quat()) - heading, math.tau)) < 1e-6
