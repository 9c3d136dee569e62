"""Selftest imposes a mistake on a right program, and nothing else ever does."""

from __future__ import annotations

import inspect
import re

import pytest

from grader.machine import resources
from grader.run.imposing.mistake import Mistake
from grader.run.request import RunRequest
from grader.spec.names import Names, Thing, WrongName
from tests.run.conftest import EXECUTABLE, RunNode

pytestmark = [pytest.mark.ros]

RIGHT = """
import os
import rclpy
from geometry_msgs.msg import Twist

rclpy.init()
node = rclpy.create_node('bot_publisher')
publisher = node.create_publisher(Twist, 'cmd_vel', 10)


def tick():
    message = Twist()
    message.linear.x = 1.0
    publisher.publish(message)
    print(message.linear.x, message.linear.y, flush=True)


timer = node.create_timer(0.1, tick)
print(sorted(os.environ.items()), flush=True)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""


def mistakes(*imposed: tuple[str, str, str]) -> tuple[Mistake, ...]:
    return tuple(Mistake(EXECUTABLE, *one) for one in imposed)


def test_a_run_records_the_wrong_program_and_not_the_right_one(run_node: RunNode) -> None:
    recording = run_node(
        RIGHT,
        mistakes=mistakes(
            ("node", "bot_publisher", "publisher"),
            ("reliability", "/cmd_vel", "best_effort"),
            ("depth", "/cmd_vel", "1"),
            ("field", "/cmd_vel", "linear.x linear.y"),
            ("period", "timers", "2"),
        ),
        record=[
            {"topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist", "reliability": "best_effort"}
        ],
    )
    (publisher,) = [
        one for one in recording.endpoints if one.topic == "/cmd_vel" and one.node == "/publisher"
    ]
    assert publisher.qos.reliability == "best_effort"
    told = {one.kind: one.data for one in recording.declarations}
    assert (told["publisher"]["node"], told["publisher"]["depth"]) == ("/publisher", 1)
    assert told["timer"]["period_s"] == pytest.approx(0.2)
    value = recording.on("/cmd_vel")[0].value
    assert (value["linear"]["x"], value["linear"]["y"]) == (0.0, 1.0)
    # The program itself did what is right.
    assert "1.0 0.0" in [line.text for line in recording.log]


def test_a_name_that_is_imposed_can_be_put_right_like_one_of_a_student(run_node: RunNode) -> None:
    wrong = mistakes(("rename", "/cmd_vel", "/cmd_ve"))
    named = run_node(RIGHT, mistakes=wrong, until={"elapsed": "500 ms"}, timeout="1 s")
    assert "/cmd_ve" in {one.topic for one in named.endpoints}
    assert not named.on("/cmd_vel")
    names = Names.of([WrongName(Thing.TOPIC, "/cmd_ve", "/cmd_vel")])
    right = run_node(RIGHT, mistakes=wrong, names=names)
    assert right.on("/cmd_vel")


def test_a_program_can_publish_on_a_topic_that_it_has_nothing_to_do_with(run_node: RunNode) -> None:
    recording = run_node(RIGHT, mistakes=mistakes(("publishes", "node", "/odom")))
    assert "/odom" in {one.topic for one in recording.endpoints if one.node == "/bot_publisher"}
    assert recording.on("/cmd_vel")


def test_a_mistake_of_another_program_is_not_made(run_node: RunNode) -> None:
    other = (Mistake("other", "node", "bot_publisher", "publisher"),)
    assert "/bot_publisher" in {one.name for one in run_node(RIGHT, mistakes=other).nodes}


def test_a_real_run_has_nothing_in_it_that_imposes_mistakes(run_node: RunNode) -> None:
    recording = run_node(RIGHT)
    said = " ".join(line.text for line in recording.log)
    assert "PYTHONPATH" in said
    assert not re.search("mutation|imposing", said)


def test_only_selftest_orders_mistakes() -> None:
    assert inspect.signature(RunRequest).parameters["mistakes"].default == ()
    callers = {
        file.relative_to(resources.root()).as_posix()
        for file in (resources.root() / "grader").rglob("*.py")
        if re.search(r"\.imposing\(|\bMistake\(", file.read_text(encoding="utf-8"))
    }
    authoring = "grader/authoring/mutants"
    assert callers == {f"{authoring}/selftest.py", f"{authoring}/standard.py"}
