"""parameter.*: declared, set or refused, and with an effect; lifecycle.state."""

from dataclasses import replace

import pytest

from grader.checks.finding import Status
from grader.recording.model import NS
from tests.checks.builder import (
    NODE,
    at,
    declared,
    every,
    failing,
    judge,
    message,
    recording,
    taken,
    text,
)
from tests.checks.requests import asked, parameter_set, parameters_read, service

SPEED = {"node": "bot_publisher", "name": "speed"}
RANGE = {"speed": {"from_value": 0.0, "to_value": 1.0, "step": 0.0}}


def read(**values):
    return recording(calls=parameters_read(**values))


class TestDeclared:
    def test_type_default_range_and_description(self):
        run = recording(calls=parameters_read(speed=0.5, ranges=RANGE))
        finding = judge(
            "parameter.declared", run, **SPEED, type="double", default=0.5, range=[0, 1],
            read_only=False, described=True,
        )  # fmt: skip
        assert finding.status is Status.PASSED
        assert finding.observed == "a double, 0.5"

    def test_the_first_value_counts_not_one_that_was_set(self):
        run = recording(calls=(*parameters_read(speed=0.5), *parameter_set(2.0, "speed", 0.9)))
        finding = judge("parameter.declared", run, **SPEED, default=0.5)
        assert finding.status is Status.PASSED

    def test_an_integer_default_is_not_the_double(self):
        found = failing("parameter.declared", read(speed=1), **SPEED, type="double")
        assert "it is an integer" in found and "1 is an integer, 1.0 is a double" in found

    def test_a_truth_is_no_number(self):
        found = failing("parameter.declared", read(speed=True), **SPEED, default=1)
        assert "it is true at first" in found

    def test_another_default(self):
        found = failing("parameter.declared", read(speed=0.2), **SPEED, default=0.5)
        assert "it is 0.2 at first" in found
        assert "self.declare_parameter('speed', 0.5)" in found

    def test_no_range_and_another_range(self):
        assert "it has no range" in failing(
            "parameter.declared", read(speed=0.5), **SPEED, range=[0, 1]
        )
        run = recording(calls=parameters_read(speed=0.5, ranges=RANGE))
        found = failing("parameter.declared", run, **SPEED, range=[0, 2])
        assert "its range is 0 to 1" in found

    def test_read_only(self):
        run = read(fixed_name="x")
        wanted = {"node": NODE, "name": "fixed_name", "read_only": False}
        assert "it is read-only" in failing("parameter.declared", run, **wanted)

    def test_a_near_miss_and_nothing_at_all(self):
        assert "declared is `sped`" in failing("parameter.declared", read(sped=1.0), **SPEED)
        assert "declares no parameters" in failing("parameter.declared", read(), **SPEED)

    def test_another_node_name(self):
        found = failing("parameter.declared", read(speed=0.5), node="bot", name="speed")
        assert "found the node `/bot_publisher`" in found

    def test_a_node_that_does_not_answer(self):
        silent = asked(
            1.0, None, name=f"{NODE}/list_parameters", request={"depth": 0},
            type="rcl_interfaces/srv/ListParameters",
        )  # fmt: skip
        run = recording(calls=(silent,), declarations=(declared("started"),))
        assert "rclpy.spin() was never called" in failing("parameter.declared", run, **SPEED)

    def test_an_answer_that_came_too_late_to_ask_on_is_no_missing_value(self):
        listed = parameters_read(speed=0.5)[0]
        late = replace(listed, answered_ns=listed.requested_ns + round(2.6 * NS))
        for check, more in (
            ("parameter.declared", {}),
            ("parameter.set", {"value": 0.5}),
            ("parameter.takes_effect", {"value": 0.5, "topic": "/cmd_vel", "period": "1 s"}),
        ):
            found = failing(check, recording(calls=(late,)), **SPEED, **more)
            assert "service `list_parameters` did not answer for 2.6 s" in found
            slow = recording(calls=(late,), disturbance=taken(1.0, 3.0, waited_s=1.7))
            assert judge(check, slow, **SPEED, **more).status is Status.ERROR

    def test_a_node_without_parameter_services(self):
        lost = asked(
            1.0, None, name=f"{NODE}/list_parameters", request={"depth": 0}, error="no server",
            type="rcl_interfaces/srv/ListParameters",
        )  # fmt: skip
        found = failing("parameter.declared", recording(calls=(lost,)), **SPEED)
        assert "the node has no service `list_parameters`" in found

    def test_a_scenario_that_never_asks_is_no_students_fault(self):
        assert judge("parameter.declared", recording(), **SPEED).status is Status.ERROR

    def test_a_step_needs_a_range(self):
        with pytest.raises(ValueError, match="'step' needs a 'range'"):
            judge("parameter.declared", recording(), **SPEED, step=0.1)


def setting(value, after=None, start=0.5, **changes):
    return recording(
        calls=(*parameters_read(speed=start), *parameter_set(2.0, "speed", value, after, **changes))
    )


class TestSet:
    def test_accepted(self):
        assert judge("parameter.set", setting(0.9), **SPEED, value=0.9).observed == "accepted"

    def test_refused_with_its_reason(self):
        run = setting(7.0, 0.5, accepted=False, reason="too fast")
        finding = judge("parameter.set", run, **SPEED, value=7.0, accepted=False, reason="Fast")
        assert finding.status is Status.PASSED
        assert finding.observed == "refused: too fast"

    def test_refused_although_right(self):
        run = setting(0.9, 0.5, accepted=False, reason="never")
        assert "it was refused: never" in failing("parameter.set", run, **SPEED, value=0.9)

    def test_accepted_although_wrong(self):
        found = failing("parameter.set", setting(7.0), **SPEED, value=7.0, accepted=False)
        assert "it was accepted" in found and "add_on_set_parameters_callback" in found

    def test_refused_without_the_reason(self):
        run = setting(7.0, 0.5, accepted=False)
        found = failing("parameter.set", run, **SPEED, value=7.0, accepted=False, reason="positive")
        assert "the reason says nothing" in found

    def test_accepted_but_kept_as_it_was(self):
        found = failing("parameter.set", setting(0.9, 0.5), **SPEED, value=0.9)
        assert "it was accepted, but is 0.5 then" in found

    def test_a_value_that_was_never_tried(self):
        finding = judge("parameter.set", setting(0.9), **SPEED, value=0.1)
        assert finding.status is Status.ERROR


def moving(then, *, set_s=2.0, until_s=4.4, period_s=0.1, **changes):
    """A node that publishes 0.5, and from 2 s on something else."""
    times = [0.7 + 0.1 * n for n in range(13)]
    later = every(period_s, round((until_s - set_s) / period_s), set_s + period_s)
    value = [message(t, {"data": 0.5}, topic="/speed") for t in times]
    value += [message(t, {"data": then}, topic="/speed") for t in later]
    run = setting(0.9, **changes)
    return recording(calls=run.calls, messages={"/speed": tuple(value)})


class TestTakesEffect:
    DATA = {"value": 0.9, "topic": "/speed", "fields": {"data": 0.9}}  # noqa: RUF012

    def test_messages_follow(self):
        finding = judge("parameter.takes_effect", moving(0.9), **SPEED, **self.DATA)
        assert finding.status is Status.PASSED

    def test_read_once(self):
        found = failing("parameter.takes_effect", moving(0.5), **SPEED, **self.DATA)
        assert "after it was set a message has data = 0.5 instead of 0.9" in found
        assert "The message is as it was before" in found

    def test_another_value_than_before_was_not_read_once(self):
        found = failing("parameter.takes_effect", moving(0.7), **SPEED, **self.DATA)
        assert "has data = 0.7 instead of 0.9" in found
        assert "as it was before" not in found

    def test_an_attempt_that_is_refused_later_changes_nothing(self):
        run = moving(0.9)
        later = parameter_set(2.2, "speed", 7.0, 0.9, accepted=False)
        run = recording(calls=(*run.calls, *later), messages=run.messages)
        finding = judge("parameter.takes_effect", run, **SPEED, **self.DATA)
        assert finding.status is Status.PASSED

    def test_refused(self):
        run = moving(0.5, after=0.5, accepted=False, reason="no")
        assert "the value was refused: no" in failing(
            "parameter.takes_effect", run, **SPEED, **self.DATA
        )

    def test_the_period(self):
        wanted = {"value": 0.9, "topic": "/speed", "period": "200 ms"}
        run = moving(0.9, period_s=0.2)
        assert judge("parameter.takes_effect", run, **SPEED, **wanted).status is Status.PASSED
        found = failing("parameter.takes_effect", moving(0.9), **SPEED, **wanted)
        assert "messages come every 100 ms" in found

    def test_silence_after_it(self):
        run = moving(0.9, until_s=2.0)
        found = failing("parameter.takes_effect", run, **SPEED, **self.DATA)
        assert "0 messages in the" in found and "made anew" not in found

    def test_late_because_of_the_machine(self):
        run = recording(
            calls=moving(0.9).calls,
            messages={"/speed": (message(2.9, {"data": 0.5}, topic="/speed"),)},
            disturbance=taken(2.0, 2.9, waited_s=0.6),
        )
        assert judge("parameter.takes_effect", run, **SPEED, **self.DATA).disturbed


def states(*labels, success=True, **changes):
    """A lifecycle node that is asked for its state, and configured between."""
    get = [
        asked(
            1.0 + index, name=f"{NODE}/get_state", type="lifecycle_msgs/srv/GetState",
            request={}, response={"current_state": {"id": 1, "label": label}},
        )
        for index, label in enumerate(labels)
    ]  # fmt: skip
    change = asked(
        1.5, name=f"{NODE}/change_state", type="lifecycle_msgs/srv/ChangeState",
        request={"transition": {"id": 1, "label": "configure"}}, response={"success": success},
    )  # fmt: skip
    there = service(f"{NODE}/get_state", "lifecycle_msgs/srv/GetState")
    return recording(**{"calls": (*get, change), "services": (there,), **changes})


class TestLifecycle:
    WANTED = {"node": "bot_publisher", "states": ["unconfigured", "inactive"]}  # noqa: RUF012

    def test_good(self):
        finding = judge("lifecycle.state", states("unconfigured", "inactive"), **self.WANTED)
        assert finding.observed == "unconfigured then inactive"

    def test_a_transition_that_failed(self):
        run = states("unconfigured", "unconfigured", success=False)
        found = failing("lifecycle.state", run, **self.WANTED)
        assert "at the call 2 of get_state it is unconfigured" in found
        assert "after the transition configure failed" in found
        assert "TransitionCallbackReturn.SUCCESS" in found

    def test_no_callback_is_blamed_where_no_transition_failed(self):
        run = states("inactive", "inactive")
        found = failing("lifecycle.state", run, **self.WANTED)
        assert "it is inactive" in found and "TransitionCallbackReturn" not in found

    def test_a_plain_node(self):
        run = states("unconfigured", services=())
        assert "is no lifecycle node" in failing("lifecycle.state", run, **self.WANTED)

    def test_without_lifecycle_msgs_it_is_our_error(self):
        lost = asked(
            1.0, None, name=f"{NODE}/get_state", type="lifecycle_msgs/srv/GetState", request={},
            error="the interface lifecycle_msgs/srv/GetState is not installed",
        )  # fmt: skip
        finding = judge("lifecycle.state", states(calls=(lost,)), **self.WANTED)
        assert finding.status is Status.ERROR
        assert "lifecycle_msgs/srv/GetState is not installed" in text(finding)


def test_times_of_settings_are_those_of_the_answer():
    (tried,) = parameter_set(2.0, "speed", 0.9)[:1]
    assert tried.answered_ns == at(2.005)
