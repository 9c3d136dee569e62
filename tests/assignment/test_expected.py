"""Fields that checks name: those that a message cannot have are reported with their line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

LESSON = """\
rosgrade: 1
id: lesson
title: A lesson
packages:
  - {name: bot, executables: [echo], depends: [rclpy, lab_msgs]}
scenarios:
  - id: run
    launch: [{executable: echo}]
    record:
      - {topic: /twist, type: geometry_msgs/msg/Twist}
      - {topic: /path, type: geometry_msgs/msg/Path}
      - {topic: /lab, type: lab_msgs/msg/Any}
      - {topic: /flag, type: std_msgs/msg/Bool}
      - {topic: /words, type: std_msgs/msg/String}
      - {topic: /number, type: std_msgs/msg/Int8}
    stimuli:
      - {publish: /text, type: std_msgs/msg/String, message: {data: a}}
      - {call: /add, type: std_srvs/srv/Add, request: {a: 1}, within: 5 s}
      - {send_goal: /count, type: std_srvs/action/Count, goal: {to: 3}}
      - {set_parameters: {size: 2}, node: bot}
    timeout: 5 s
checks:
  - id: fields
    uses: USES
    with: {WITH}
    points: 1
"""
DEFINITIONS = {
    "std_msgs/msg/String": "string data\n",
    "std_msgs/msg/Bool": "bool data\n",
    "std_msgs/msg/Int8": "int8 data\n",
    "std_srvs/srv/Add": "int64 a\n---\nint64 sum\nstring words\n",
    "std_srvs/action/Count": "int32 to\n---\nint32[] numbers\n---\nint32 now\n",
    "geometry_msgs/msg/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/msg/Path": "Vector3[] points\nfloat32[3] sizes\nint8 KIND=1\n",
}
ADD, COUNT = "/add (std_srvs/srv/Add): ", "/count (std_srvs/action/Count): "
TWIST, PATH = "/twist (geometry_msgs/msg/Twist): ", "/path (geometry_msgs/msg/Path): "

Found = Callable[[str, str], list[str]]


@pytest.fixture
def found(mistakes: Callable[[str], list[str]], ros_with: Callable[..., None]) -> Found:
    """Load the lesson with a check."""
    ros_with(DEFINITIONS)
    return lambda uses, given: mistakes(LESSON.replace("USES", uses).replace("WITH", given))


@pytest.mark.parametrize(
    ("uses", "parameters", "said"),
    [
        (
            "messages.equal",
            "topic: /twist, value: {linaer: {x: 1.0}}",
            f"value: {TWIST}the message has no field 'linaer'; it has angular, linear. Did you "
            "mean 'linear'?",
        ),
        (
            "messages.equal",
            "topic: /twist, value: {linear.w: 1.0}",
            f"value: {TWIST}linear has no field 'w'; it has x, y, z.",
        ),
        (
            "messages.equal",
            "topic: /twist, value: {linear: {x: }}",
            f"value: {TWIST}linear.x is a number, but nothing is expected of it",
        ),
        (
            "messages.follows",
            "topic: /twist, source: /path, tolerance: 1, fields: {linear.a: 'sizes[0]'}",
            f"fields.linear.a: {TWIST}linear has no field 'a'; it has x, y, z.",
        ),
        (
            "log.follows",
            "topic: /text, fields: [data, dat]",
            "fields[1]: /text (std_msgs/msg/String): the message has no field 'dat'; it has data. "
            "Did you mean 'data'?",
        ),
        (
            "messages.equal",
            "topic: /twist, value: {linear.x: 1}, tolerance: {linear.z: 1, x: 1}",
            f"tolerance.x: {TWIST}the message has no field 'x'; it has angular, linear.",
        ),
        (
            "messages.sequence",
            "topic: /words, field: dota, step: 1",
            "field: /words (std_msgs/msg/String): the message has no field 'dota'; it has data. "
            "Did you mean 'data'?",
        ),
        (
            "messages.sequence",
            "topic: /flag, field: data, values: [true, no]",
            "values[1]: /flag (std_msgs/msg/Bool): data is true or false, but a text is expected "
            "of it: write true or false",
        ),
        (
            "service.responds",
            "service: /add, request: {c: 1}",
            f"request: {ADD}the message has no field 'c'; it has a.",
        ),
        (
            "service.responds",
            "service: /add, contains: {sum: three}",
            f"contains.sum: {ADD}sum is a number, but a text is expected of it",
        ),
        (
            "messages.equal",
            "topic: /twist, value: {linear.x: fast}",
            f"value: {TWIST}linear.x is a number, but 'fast' is expected of it: the message has no "
            "field 'fast'; it has angular, linear.",
        ),
        (
            "messages.equal",
            "topic: /twist, value: {hypot(linear.x, linear.z): 1}",
            f"value: {TWIST}the message has no field 'hypot(linear.x': 'hypot(linear.x' cannot be "
            "read: inside {...} an expression with a comma needs quotes",
        ),
        (
            "messages.equal",
            "topic: /twist, value: {'norm(linear)': '3 .. 1'}",
            f"value: {TWIST}norm(linear) is a number, but '3 .. 1' is expected of it: write a "
            "number, '> 0', '0.1 .. 0.5' or an expression of fields (the lowest value of '3 .. 1' "
            "is above the highest)",
        ),
        (
            "messages.follows",
            "topic: /twist, source: /twist, fields: {linear.x: yaw(linear)}, tolerance: 1",
            f"fields.linear.x: {TWIST}yaw(linear) cannot be computed: a quaternion has x, y, z and "
            "w",
        ),
        (
            "messages.follows",
            "topic: /twist, source: /twist, fields: {linear.x: linear.y}, tolerance: {linear.q: 1}",
            f"tolerance.linear.q: {TWIST}linear has no field 'q'; it has x, y, z.",
        ),
        (
            "action.result",
            "action: /count, within: 1 s, result: {numbers: [1, 2.5]}",
            f"result: {COUNT}numbers is a whole number, but 2.5 is expected of it",
        ),
        (
            "action.feedback",
            "action: /count, last: {later: 3}",
            f"last: {COUNT}the message has no field 'later'; it has now.",
        ),
    ],
)
def test_a_field_that_a_message_does_not_have_is_reported_with_its_line(
    found: Found, uses: str, parameters: str, said: str
) -> None:
    assert found(uses, parameters) == [f"25: checks[0].with.{said}"]


@pytest.mark.parametrize(
    ("uses", "parameters"),
    [
        ("messages.equal", "topic: /twist, value: {linear: {x: 1}, angular.z: 0.5}"),
        ("messages.equal", "topic: /path, value: {sizes: [1, 2, 3], points: [{x: 1}]}"),
        ("messages.equal", "topic: /lab, value: {whatever: 1}"),
        (
            "messages.equal",
            "topic: /twist, value: {norm(linear): '<= 0.22', angular.z: 0 .. 90 deg}",
        ),
        (
            "messages.equal",
            "topic: /path, value: {'sizes[2]': '> sizes[1]', 'points[7].x': '!= 0'}",
        ),
        ("messages.sequence", "topic: /twist, field: norm(linear), values: [0, '> 0']"),
        (
            "messages.follows",
            "topic: /path, source: /twist, tolerance: 1, fields: {'points[7].x': linear.x}",
        ),
        ("log.follows", "topic: /text, fields: [data]"),
        ("messages.sequence", "topic: /path, field: 'sizes[2]', values: [1, 2.5]"),
        ("messages.equal", "topic: /flag, value: {data: 1}"),
        ("service.responds", "service: /add, response: {sum: 3}, tolerance: {sum: 1}"),
        ("action.feedback", "action: /count, goal: {to: 3}, last: {now: 3}"),
    ],
)
def test_what_a_message_has_or_may_have_is_accepted(
    found: Found, uses: str, parameters: str
) -> None:
    assert found(uses, parameters) == []


def test_of_a_message_that_holds_itself_no_field_is_looked_for(
    found: Found, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    holder = tmp_path / "ros/share/geometry_msgs/msg/Vector3.msg"
    holder.write_text("Twist[] inner\n", encoding="utf-8")
    assert found("messages.equal", "topic: /twist, value: {a: 1}") == []


WORDS = "/words (std_msgs/msg/String): "


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ('{data: "!= bye"}', "data is a text, and '!= bye' would be compared with the whole of it"),
        ('{data: "> 3"}', "write {contains: ...}, {matches: ...} or {number: ...}"),
        ('{data: "0.1 .. 0.5"}', "data is a text"),
        ('{data: {matches: "("}}', "data: '(' is not a regular expression"),
        ('{data: {number: "fast"}}', "data: 'fast' asks nothing of a number"),
        ("{data: {contain: hello}}", "data has no field 'contain'"),
        ("{data: {contains: hello}}", ""),
        ('{data: {matches: "^H", number: "> 3"}}', ""),
        ('{"number(data)": "> 3"}', ""),
        ("{data: loading .. done}", ""),
        ("{data: bye!}", ""),
    ],
)
def test_what_is_asked_of_a_text_is_read_before_any_run(
    found: Found, value: str, words: str
) -> None:
    problems = found("messages.equal", f"topic: /words, value: {value}")
    assert [words in one for one in problems] == ([True] if words else [])
    assert not words or WORDS in problems[0]
