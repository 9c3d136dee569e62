"""Why nothing came in answer to a stimulus: one cause, the deepest."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import Kind
from tests.checks.builder import (
    NODE,
    RELIABLE,
    call,
    declarations,
    declared,
    died,
    endpoint,
    every,
    failing,
    judge,
    output,
    reader,
    recording,
    sent,
    stimulus,
    taken,
    traceback,
)

STRING = "std_msgs/msg/String"
LATCHED = replace(RELIABLE, durability="transient_local")


def listener(**changes):
    return endpoint("/chatter", **{"kind": Kind.SUBSCRIPTION, "type": STRING, **changes})


def spinning(**data):
    return declared("spin", 0.41, executor="MultiThreadedExecutor", threads=4, **data)


def asked(*listeners, times_s=(), **changes):
    """A node that should answer on /cmd_vel what it is sent on /chatter, and does not."""
    return recording(
        **{
            "messages": {},
            "sent": sent(times_s),
            "answers": {"/chatter": "/cmd_vel"},
            "endpoints": (endpoint(), *listeners, reader(), stimulus()),
            "declarations": declarations(timer_s=None),
            **changes,
        }
    )


def why(run):
    found = failing("messages.count", run, topic="/cmd_vel", at_least=1)
    assert "no message on `/cmd_vel`" in found
    return found


NEVER = "because the messages that the node should answer, on `/chatter`, never reached it: "


class TestNeverReached:
    @pytest.mark.parametrize(
        ("topic", "words"),
        [
            ("/chater", "subscribes to `/chater` instead of `/chatter`"),
            ("/bot_publisher/chatter", "`/bot_publisher` stands in front of the name"),
            ("/bot/chatter", "`/bot` stands in front of the name"),
            ("/Chatter", "upper and lower case differ"),
        ],
    )
    def test_a_subscription_to_another_topic(self, topic, words):
        found = why(asked(replace(listener(), topic=topic)))
        assert NEVER in found
        assert words in found

    def test_an_answer_to_another_stimulus_is_not_concerned(self):
        run = asked(listener(), times_s=every(0.3, 5), answers={"/chatter": "/other"})
        found = failing("messages.count", run, topic="/cmd_vel", at_least=1)
        assert "is there but silent" in found
        assert "/chatter" not in found


class TestNotAnswered:
    def test_the_callback_does_not_publish(self):
        found = why(asked(listener(), times_s=every(0.3, 5)))
        assert "although 5 messages on `/chatter` reached the node" in found
        assert "Is publish(msg) reached in the subscription's callback?" in found

    def test_an_exception_that_was_survived(self):
        log = output(traceback("ValueError: no", source="self.publisher.publish(1)"), time_s=1.5)
        found = why(asked(listener(), times_s=every(0.3, 5), log=log))
        assert "an exception was raised meanwhile, ValueError: no" in found

    def test_it_died_of_the_first(self):
        log = output(traceback("ValueError: no", source="int(message.data)"), time_s=1.1)
        run = asked(listener(), times_s=every(0.3, 5), processes=(died(1),), log=log)
        found = why(run)
        assert "ValueError: no" in found
        assert "src/bot_publisher/bot_publisher/node.py:14" in found

    def test_a_callback_that_burns_a_cpu_is_the_student_s_on_a_busy_machine_too(self):
        busy = taken(0.4, 4.4, waited_s=2.5)
        calls = (call(0.2), *(call(0.5 * n, None) for n in range(2, 9)))
        run = asked(listener(), times_s=every(0.3, 5), calls=calls, disturbance=busy)
        assert "something blocks the executor" in why(run)
        # It is run again all the same, and counts if it happens twice.
        assert judge("messages.count", run, topic="/cmd_vel", at_least=1).disturbed

    def test_a_node_that_had_time_of_its_own_to_answer_is_judged_without_calls_too(self):
        long = {"calls": (), "stop_s": 10.0, "end_s": 10.1}
        busy = taken(0.4, 9.9, waited_s=6.0)
        run = asked(listener(), times_s=every(0.3, 5), disturbance=busy, **long)
        assert "although 5 messages on `/chatter` reached the node" in why(run)
        assert judge("messages.count", run, topic="/cmd_vel", at_least=1).disturbed

    def test_a_node_that_got_no_cpu_is_not_blocked(self):
        calls = tuple(call(0.5 * n, None) for n in range(2, 9))
        starved = taken(0.4, 4.4, waited_s=3.2)
        run = asked(listener(), times_s=every(0.3, 5), calls=calls, disturbance=starved)
        finding = judge("messages.count", run, topic="/cmd_vel", at_least=1)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_a_node_that_no_executor_has(self):
        told = (*declarations(timer_s=None, spin=False), spinning(tells_added=True))
        run = asked(listener(), times_s=every(0.3, 5), declarations=told)
        found = why(run)
        assert f"an executor spins, but `{NODE}` was not added to it" in found
        assert "executor.add_node(node)" in found

    def test_a_node_that_an_executor_has(self):
        told = (
            *declarations(timer_s=None, spin=False),
            declared("added", 0.4, node=NODE),
            spinning(tells_added=True),
        )
        run = asked(listener(), times_s=every(0.3, 5), declarations=told)
        assert "not given to it" not in why(run)

    def test_an_executor_that_does_not_tell_which_nodes_it_has(self):
        told = (*declarations(timer_s=None, spin=False), spinning(), spinning(tells_added=True))
        run = asked(listener(), times_s=every(0.3, 5), declarations=told)
        assert "not given to it" not in why(run)

    def test_a_slow_timer_is_not_blamed_for_an_answer(self):
        run = asked(listener(), times_s=every(0.3, 5), declarations=declarations(timer_s=300.0))
        assert "timer" not in why(run)


def test_a_publisher_that_was_not_activated_is_not_called_destroyed():
    said = "Trying to publish message on the topic '/cmd_vel', but the publisher is not activated"
    gone = replace(endpoint(), vanished_ns=recording().launched_ns + 900_000_000)
    found = why(recording(messages={}, endpoints=(gone, reader()), log=output(said)))
    assert "the log says that its publisher is not activated" in found
    assert "LifecycleNode::on_activate(state)" in found
