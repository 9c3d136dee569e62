"""parameter.*: declared, set or refused, and with an effect; lifecycle.state."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import NS
from grader.recording.simulated import Truth
from tests.checks.builder import (
    NODE,
    at,
    declared,
    died,
    every,
    failing,
    judge,
    message,
    output,
    recording,
    taken,
    text,
    traceback,
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

    @pytest.mark.parametrize(
        ("values", "wanted", "words"),
        [
            ({"speed": 1}, {"type": "double"}, "it is an integer"),
            ({"speed": 1}, {"type": "double"}, "1 is an integer, 1.0 is a double"),
            ({"speed": True}, {"default": 1}, "it is true at first"),
            ({"speed": 0.2}, {"default": 0.5}, "it is 0.2 at first"),
            ({"speed": 0.2}, {"default": 0.5}, "self.declare_parameter('speed', 0.5)"),
            ({"speed": 0.5}, {"range": [0, 1]}, "it has no range"),
            ({"speed": 0.5, "ranges": RANGE}, {"range": [0, 2]}, "its range is 0 to 1"),
            (
                {"fixed_name": "x"},
                {"name": "fixed_name", "read_only": False},
                "it is read-only",
            ),
            ({"sped": 1.0}, {}, "declared is `sped`"),
            ({}, {}, "declares no parameters"),
            ({"speed": 0.5}, {"node": "bot"}, "found the node `/bot_publisher`"),
        ],
    )
    def test_what_is_declared_otherwise_is_reported(self, values, wanted, words):
        assert words in failing("parameter.declared", read(**values), **{**SPEED, **wanted})

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


GIVEN = {"parameters": "goal_x goal_y use_sim_time"}


class TestGiven:
    def run(self, environment=GIVEN, **values):
        return recording(calls=parameters_read(**values), environment=environment)

    def test_every_parameter_of_the_launch_is_declared(self):
        found = judge("parameter.given", self.run(goal_x=0.1, goal_y=0.2, gain=1.0))
        assert found.status is Status.PASSED

    @pytest.mark.parametrize(
        ("values", "words"),
        [
            ({}, "the launch gives `goal_x` and `goal_y`, but no node declares them"),
            ({"goal_x": 1.0, "gain": 1.0}, "declares it; declared are `gain` and `goal_x`"),
        ],
    )
    def test_what_the_launch_gives_and_no_node_declares_is_named(self, values, words):
        assert words in failing("parameter.given", self.run(**values))

    def test_only_what_is_asked_for_counts(self):
        found = judge("parameter.given", self.run(goal_x=1.0), names=["goal_x"])
        assert found.status is Status.PASSED

    @pytest.mark.parametrize(
        ("names", "rules"),
        [
            ("x y", "x:=goal_x y:=goal_y"),
            ("target_x target_y gain", "target_x:=goal_x target_y:=goal_y"),
            ("goal_X goal_Y", "goal_X:=goal_x goal_Y:=goal_y"),
            ("goalx goaly", "goalx:=goal_x goaly:=goal_y"),
            ("goal gain", ""),
            ("speed gain", ""),
        ],
    )
    def test_a_parameter_with_a_wrong_name_gets_the_value_in_another_run(self, names, rules):
        run = self.run(**dict.fromkeys(names.split(), 1.0))
        names = judge("parameter.given", run, remap=True).names
        assert " ".join(map(str, names.wrong)) == rules
        assert not judge("parameter.given", run).names

    def test_a_node_that_did_not_answer_and_an_older_recording_accuse_nobody(self):
        for run in (recording(environment=GIVEN), self.run(environment={})):
            assert judge("parameter.given", run).status is Status.PASSED


def setting(value, after=None, start=0.5, **changes):
    return recording(
        calls=(*parameters_read(speed=start), *parameter_set(2.0, "speed", value, after, **changes))
    )


REFUSED = setting(7.0, 0.5, accepted=False, reason="too fast")


class TestSet:
    @pytest.mark.parametrize(
        ("run", "wanted", "observed"),
        [
            (setting(0.9), {"value": 0.9}, "accepted"),
            (REFUSED, {"value": 7.0, "accepted": False, "reason": "Fast"}, "refused: too fast"),
        ],
    )
    def test_what_is_answered_as_asked_for_passes(self, run, wanted, observed):
        finding = judge("parameter.set", run, **SPEED, **wanted)
        assert (finding.status, finding.observed) == (Status.PASSED, observed)

    @pytest.mark.parametrize(
        ("run", "wanted", "words"),
        [
            (REFUSED, {"value": 7.0}, "it was refused: too fast"),
            (setting(7.0), {"value": 7.0, "accepted": False}, "it was accepted"),
            (setting(7.0), {"value": 7.0, "accepted": False}, "add_on_set_parameters_callback"),
            (
                setting(7.0, 0.5, accepted=False),
                {"value": 7.0, "accepted": False, "reason": "positive"},
                "the reason is empty",
            ),
            (setting(0.9, 0.5), {"value": 0.9}, "it was accepted, but its value is 0.5 afterwards"),
        ],
    )
    def test_another_answer_is_reported(self, run, wanted, words):
        assert words in failing("parameter.set", run, **SPEED, **wanted)

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

    PERIOD = {"value": 0.9, "topic": "/speed", "period": "200 ms"}  # noqa: RUF012

    @pytest.mark.parametrize(
        ("run", "wanted"), [(moving(0.9), DATA), (moving(0.9, period_s=0.2), PERIOD)]
    )
    def test_messages_that_follow_pass(self, run, wanted):
        finding = judge("parameter.takes_effect", run, **SPEED, **wanted)
        assert finding.status is Status.PASSED

    @pytest.mark.parametrize(
        ("run", "wanted", "words"),
        [
            (moving(0.5), DATA, "after it was set a message has data = 0.5 instead of 0.9"),
            (moving(0.5), DATA, "The message is as it was before"),
            (moving(0.7), DATA, "Look at how the node uses `speed` where it publishes"),
            (moving(0.5, after=0.5, accepted=False, reason="no"), DATA, "was refused: no"),
            (moving(0.9), PERIOD, "messages come every 100 ms"),
            (moving(0.9, until_s=2.0), DATA, "0 messages in the"),
            (moving(0.9, until_s=2.0), DATA, "Publish in every call of the callback"),
        ],
    )
    def test_what_does_not_change_is_reported(self, run, wanted, words):
        assert words in failing("parameter.takes_effect", run, **SPEED, **wanted)

    def test_an_attempt_that_is_refused_later_changes_nothing(self):
        run = moving(0.9)
        later = parameter_set(2.2, "speed", 7.0, 0.9, accepted=False)
        run = recording(calls=(*run.calls, *later), messages=run.messages)
        finding = judge("parameter.takes_effect", run, **SPEED, **self.DATA)
        assert finding.status is Status.PASSED

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

    def test_a_node_in_the_expected_state_passes(self):
        finding = judge("lifecycle.state", states("unconfigured", "inactive"), **self.WANTED)
        assert finding.observed == "unconfigured then inactive"

    def test_a_transition_that_failed(self):
        run = states("unconfigured", "unconfigured", success=False)
        found = failing("lifecycle.state", run, **self.WANTED)
        assert "at call 2 of get_state it is unconfigured" in found
        assert "after the transition configure failed" in found
        assert "TransitionCallbackReturn.SUCCESS" in found

    def test_no_callback_is_blamed_where_no_transition_failed(self):
        run = states("inactive", "inactive")
        found = failing("lifecycle.state", run, **self.WANTED)
        assert "it is inactive" in found and "TransitionCallbackReturn" not in found

    def test_a_crash_in_a_transition_is_the_program_s_and_no_fault_of_the_scenario(self):
        run = states("unconfigured", processes=(died(1),), log=output(traceback("KeyError: 'x'")))
        assert "KeyError" in failing("lifecycle.state", run, **self.WANTED)

    def test_a_contact_that_ended_the_run_is_no_fault_of_the_scenario(self):
        driven = Truth(at(1.2), 0.9, 0.0, 0.0, 0.2, 0.0, 0.2, 0.0, "segments[0]")
        run = states("unconfigured", truth=(replace(driven, contact=None), driven))
        assert "drove into" in failing("lifecycle.state", run, **self.WANTED)

    def test_a_node_without_states_is_reported(self):
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
