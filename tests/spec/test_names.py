"""Wrong names, and what ROS itself puts right."""

from __future__ import annotations

import pytest

from grader.spec.names import Names, Thing, WrongName


@pytest.mark.parametrize(
    ("thing", "own", "asked", "rules"),
    [
        (Thing.TOPIC, "/cmdvel", "/cmd_vel", ["/cmdvel:=/cmd_vel"]),
        (Thing.SERVICE, "/bot/go", "/go", ["/bot/go:=/go"]),
        (Thing.NODE, "/bot", "/robot", ["bot:__node:=robot"]),
        (Thing.NODE, "/lab/bot", "/bot", ["bot:__ns:=/"]),
        (Thing.NODE, "/b", "/lab/bot", ["b:__node:=bot", "bot:__ns:=/lab"]),
        (Thing.PACKAGE, "bot", "robot", []),
        (Thing.FILE, "lib/bot/go", "lib/bot/run", []),
        (Thing.PARAMETER, "velocity", "speed", []),
    ],
)
def test_what_ros_can_put_right_has_rules(thing, own, asked, rules):
    assert list(WrongName(thing, own, asked).rules) == rules


def test_an_action_is_put_right_by_all_that_it_consists_of():
    rules = WrongName(Thing.ACTION, "/fibb", "/fib").rules
    assert "/fibb/_action/send_goal:=/fib/_action/send_goal" in rules and len(rules) == 5


@pytest.mark.parametrize(
    ("node", "other", "follows"),
    [
        (("/lab/bot", "/bot"), "/lab/cmd_vel", True),
        (("/lab/bot", "/lab/robot"), "/lab/cmd_vel", False),
        (("/bot", "/robot"), "/bot/reset", True),
        (("/bot", "/robot"), "/bottom", False),
        (("/bot", "/lab/bot"), "/cmd_vel", False),
    ],
)
def test_what_stands_in_the_namespace_of_a_node_follows_it(node, other, follows):
    moved = WrongName(Thing.NODE, *node)
    assert moved.explains(WrongName(Thing.TOPIC, other, "/asked")) is follows


def test_a_file_is_called_otherwise_wherever_it_is_below_its_folder():
    wrong = WrongName(Thing.FILE, "share/week3/launch/go.launch.py", "share/bot/launch/b.launch.py")
    names = Names.of([wrong])
    assert names.own_file("share/bot", "b.launch.py") == "go.launch.py"
    assert names.own_file("share/bot", "c.launch.py") == "c.launch.py"
    assert names.own_file("share/bots", "b.launch.py") == "b.launch.py"
