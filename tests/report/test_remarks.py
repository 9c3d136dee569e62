"""Remarks on a run, which cost no points."""

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
from grader.report.model.result import remarks
from grader.spec.names import Names, Thing, WrongName
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


PROBE = Node("/rosgrade_probe", Owner.PROBE, 1)


def test_an_ordinary_run_is_not_worth_a_word() -> None:
    assert remarks(run(messages={"/cmd_vel": messages(5000, 900.0)})) == ()
    assert remarks(run(environment={"unlisted": ""}, nodes=(PROBE,))) == ()


@pytest.mark.parametrize(
    ("values", "begins", "ends"),
    [
        (
            {"names": Names.of([WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel")])},
            "this run corrected wrong names",
            "`/cmdvel:=/cmd_vel`",
        ),
        (
            {"environment": {"unlisted": "scipy", "sandbox": "bwrap (userns)"}},
            "the code imports `scipy`, found in the system's Python, as ROS is sourced",
            "what the assignment allows",
        ),
        (
            {"environment": {"unlisted": "pandas cv2"}},
            "the code imports `pandas` and `cv2`",
            "what the assignment allows",
        ),
        (
            {"nodes": (Node("/ns/rosgrade_probe", Owner.STUDENT, 1), PROBE)},
            "a node of the submission is called `/ns/rosgrade_probe`",
            "like the node that watches the run",
        ),
        (
            {"messages": {"/cmd_vel": messages(4000, 3000.0)}},
            "3000 messages were sent on `/cmd_vel`",
            "within 1 s",
        ),
    ],
)
def test_what_is_conspicuous_is_reported_in_one_sentence(values, begins, ends) -> None:
    (said,) = remarks(run(**values))
    assert said.startswith(begins) and said.endswith(ends)


def test_who_writes_to_the_tracer_s_pipe_is_named_once() -> None:
    foreign = Declaration(0, "bot/bot", "foreign", {})
    (said,) = remarks(run(declarations=(foreign, foreign)))
    ended = Breach(0, "forged report", "wrote into the channel", "")
    assert remarks(run(declarations=(foreign,), breaches=(ended,))) == ()
    assert said.startswith("`bot/bot` wrote into the channel")


def test_who_speaks_for_the_robot_is_named_once_with_all_topics() -> None:
    both = tuple(endpoint(topic, Owner.STUDENT, Kind.PUBLISHER) for topic in ("/odom", "/clock"))
    (said,) = remarks(run(endpoints=both))
    assert said == "the node `/bot` publishes on `/clock` and `/odom`, which robots do"


def test_a_topic_that_the_assignment_asks_for_is_no_robot_s() -> None:
    asked = endpoint("/odom", Owner.PROBE, Kind.SUBSCRIPTION, "/rosgrade_probe")
    assert remarks(run(endpoints=(endpoint("/odom", Owner.STUDENT, Kind.PUBLISHER), asked))) == ()
    assert remarks(run(endpoints=(endpoint("/odom", Owner.STUDENT, Kind.SUBSCRIPTION),))) == ()


def test_a_robot_is_not_the_only_one_to_publish_transforms() -> None:
    own = endpoint("/tf", Owner.STUDENT, Kind.PUBLISHER)
    assert remarks(run(endpoints=(replace(own, type="tf2_msgs/msg/TFMessage"),))) == ()


def test_output_beyond_what_is_kept_and_another_domain_are_reported() -> None:
    process = Process("bot/bot", 7, 1, 2, 0, "SIGINT", 0.1, dropped_bytes=1)
    assert remarks(run(processes=(process,), environment={"other_domains": "5"})) == (
        "the submission joined another ROS domain: 5",
        "`bot/bot` printed 1 byte more than rosgrade keeps",
    )
