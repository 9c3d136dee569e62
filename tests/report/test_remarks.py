"""What is told of a run although it costs nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.recording.event import Breach
from grader.recording.model import (
    Declaration,
    Endpoint,
    Kind,
    Message,
    Node,
    Owner,
    Process,
    Qos,
    Recording,
)
from grader.report.model.remarks import remarks
from tests.grade.sample import make_recording

TWIST = "geometry_msgs/msg/Twist"
SECOND = 1_000_000_000


def endpoint(topic: str, owner: Owner, kind: Kind, node: str = "/bot") -> Endpoint:
    return Endpoint(kind, topic, TWIST, node, owner, Qos("reliable", "volatile"), "01", 1)


def run(**values: object) -> Recording:
    return replace(make_recording(), **values)  # type: ignore[arg-type]


def messages(count: int, per_s: float) -> tuple[Message, ...]:
    stamps = [int(number * SECOND / per_s) for number in range(count)]
    return tuple(
        Message("/cmd_vel", TWIST, {}, stamp, stamp, number)
        for number, stamp in enumerate(stamps, start=1)
    )


def test_an_ordinary_run_is_not_worth_a_word() -> None:
    assert remarks(run(messages={"/cmd_vel": messages(5000, 500.0)})) == ()


def test_a_name_that_was_put_right_is_told() -> None:
    (said,) = remarks(run(environment={"remaps": "/cmdvel:=/cmd_vel"}))
    assert said.startswith("wrong names were put right in this run")
    assert said.endswith("`/cmdvel:=/cmd_vel`")


def test_who_writes_to_the_tracer_s_pipe_is_named_once() -> None:
    foreign = Declaration(0, "bot/bot", "foreign", {})
    (said,) = remarks(run(declarations=(foreign, foreign)))
    ended = Breach(0, "forged report", "wrote into the channel", "")
    assert remarks(run(declarations=(foreign,), breaches=(ended,))) == ()
    assert said.startswith("`bot/bot` wrote into the channel")


def test_who_is_called_as_the_probe_is_named() -> None:
    nodes = (Node("/ns/rosgrade_probe", Owner.STUDENT, 1), Node("/rosgrade_probe", Owner.PROBE, 1))
    (said,) = remarks(run(nodes=nodes))
    assert "is called `/ns/rosgrade_probe`, as the node that watches" in said


def test_who_speaks_for_the_robot_is_named_once_with_all_topics() -> None:
    both = tuple(endpoint(topic, Owner.STUDENT, Kind.PUBLISHER) for topic in ("/odom", "/clock"))
    (said,) = remarks(run(endpoints=both))
    assert said == "the node `/bot` publishes on `/clock` and `/odom`, as a robot does"


def test_a_topic_that_the_assignment_asks_for_is_no_robot_s() -> None:
    asked = endpoint("/odom", Owner.PROBE, Kind.SUBSCRIPTION, "/rosgrade_probe")
    assert remarks(run(endpoints=(endpoint("/odom", Owner.STUDENT, Kind.PUBLISHER), asked))) == ()
    listening = endpoint("/odom", Owner.STUDENT, Kind.SUBSCRIPTION)
    assert remarks(run(endpoints=(listening,))) == ()


@pytest.mark.parametrize(("per_s", "told"), [(900.0, 0), (3000.0, 1)])
def test_a_flood_is_told_with_its_size(per_s: float, told: int) -> None:
    said = remarks(run(messages={"/cmd_vel": messages(4000, per_s)}))
    assert len(said) == told
    assert all(line == "3000 messages were sent on `/cmd_vel` within 1 s" for line in said)


def test_messages_that_the_probe_could_not_take_count_by_the_writer_s_numbers() -> None:
    every_tenth = messages(4000, 3000.0)[::10]
    (said,) = remarks(
        run(
            messages={"/cmd_vel": every_tenth},
            endpoints=(endpoint("/cmd_vel", Owner.STUDENT, Kind.PUBLISHER),),
        )
    )
    assert said == "2991 messages were sent on `/cmd_vel` within 1 s"
    two = tuple(endpoint("/cmd_vel", Owner.STUDENT, Kind.PUBLISHER) for _ in range(2))
    assert remarks(run(messages={"/cmd_vel": every_tenth}, endpoints=two)) == ()


def test_output_beyond_what_is_kept_and_another_domain_are_told() -> None:
    process = Process("bot/bot", 7, 1, 2, 0, "SIGINT", 0.1, dropped_bytes=1)
    said = remarks(run(processes=(process,), environment={"other_domains": "5"}))
    assert said == (
        "the submission joined another ROS domain: 5",
        "`bot/bot` printed more than is kept, by 1 byte",
    )


def test_a_library_that_a_sandbox_does_not_hold_is_told_where_there_is_none() -> None:
    [remark] = remarks(run(environment={"unlisted": "pandas cv2"}))
    assert remark.startswith("the code imports `pandas` and `cv2`")
    assert not remarks(run(environment={"unlisted": ""}))
