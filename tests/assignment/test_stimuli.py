"""Stimuli: every mistake is found before anything runs, with its line."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap_ros2.writer import Writer

from grader.assignment.stimuli.kinds.publish import Publish
from grader.assignment.stimuli.kinds.request import CallService, SetParameters
from grader.assignment.stimuli.kinds.serve import ServeAction
from grader.assignment.stimuli.stimulus_model import Preparation

HEAD = """\
rosgrade: 1
id: lesson
title: A lesson
packages:
  - name: bot
    executables: [echo]
scenarios:
  - id: run
    launch: [{executable: echo}]
    record: [{topic: /echo, type: std_msgs/msg/String}]
    random: {goal: [1 m, 2 m], speed: [1 m/s, 2 m/s]}
    timeout: 5 s
    stimuli:
"""
TAIL = "checks: [{id: alive, uses: node.alive, points: 1}]\n"
SET_BOOL = "std_srvs/srv/SetBool"
DEFINITIONS = {
    "std_msgs/msg/String": "string data\n",
    "std_msgs/msg/UInt8": "uint8 data\n",
    "std_msgs/msg/Bool": "bool data\n",
    "std_msgs/msg/Float64MultiArray": "MultiArrayLayout layout\nfloat64[] data\n",
    "std_msgs/msg/MultiArrayLayout": "uint32 data_offset\n",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/msg/Twist": "Vector3 linear\nVector3 angular\n",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
    "std_srvs/srv/SetBool": "bool data # switch\n---\nbool success\nstring message\n",
    "x/action/Fibonacci": "int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n",
    "x/srv/Go": "geometry_msgs/Vector3 to\n---\n",
    "x/msg/Empty": "",
    "x/action/Drive": "geometry_msgs/Vector3 to\nx/Empty head\n---\n---\nfloat32 distance\n",
    "bot_msgs/msg/Three": "uint8 ONE=1\nfloat64[3] values\nint8[<=2] few\nstring<=4 name\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    found = tmp_path / "lesson"
    found.mkdir()
    return found


MAKING = Preparation(Path(), DEFINITIONS.__getitem__, 0, {"speed": 1.5}, [])
Found = Callable[[str], list[str]]


@pytest.fixture
def found(mistakes: Found, ros_with: Callable[..., None]) -> Found:
    """Load an assignment with these stimuli."""
    ros_with(DEFINITIONS)
    return lambda stimuli: mistakes(HEAD + stimuli + TAIL)


def publish(rest: str, type: str = "std_msgs/msg/String") -> str:
    return f"      - publish: /chatter\n        type: {type}\n" + "".join(
        f"        {line}\n" for line in rest.splitlines()
    )


GOOD = [
    publish("message: {data: hello}"),
    publish("message: {}"),
    publish("message: {data: hello}\nevery: 100 ms"),
    publish("message: {data: hello}\nevery: 100 ms\ncount: 20"),
    publish("messages: [{data: a}, {data: b}]\nanswer: /echo"),
    publish("messages: [{data: a}]\nbefore_launch: 1\ndurability: transient_local"),
    publish("message: {linear: {x: $goal, y: 30 cm}, angular.z: 0}", "geometry_msgs/msg/Twist"),
    publish("message: {data: [1, 2.5, 90 deg]}", "std_msgs/msg/Float64MultiArray"),
    publish("message: {stamp: now, frame_id: now}", "std_msgs/msg/Header"),
    publish("message: {anything: goes}", "nav2_msgs/msg/Unknown"),
    "      - {join: /echo, type: std_msgs/msg/String, name: late, after: 1 s}\n",
    "      - {kill: echo, after: 1 s}\n      - {restart: echo, after: 2 s}\n",
    "      - {kill: echo, package: bot, after: 1 s, signal: SIGKILL}\n",
]


@pytest.mark.parametrize("stimuli", GOOD)
def test_good_ones_are_read(found: Found, stimuli: str) -> None:
    assert found(stimuli) == []


ONE_WAY = "give the messages by one of message, messages, from, python"
FORM = [
    ("      - {after: 1 s}\n", "14: .*its first key must be one of call, join, kill, lifecycle"),
    ("      - {pubish: /a, type: a/msg/B, message: {}}\n", "unknown key 'pubish'. Did you mean"),
    (publish("after: 1 s"), f"14: .*{ONE_WAY}, but none is given"),
    (publish("message: {}\nmessages: [{}]"), f"{ONE_WAY}, not message and messages"),
    (publish("messages: [{}, {}]"), "several messages need a pace: give 'every' or 'answer'"),
    (publish("message: {}\ncount: 3"), "several messages need a pace"),
    (publish("message: {}\nwithin: 5"), "17: .*within: '5' has no unit|17: .*within: 5 has no"),
    ("      - {join: /echo, type: std_msgs/msg/String, after: 1 s}\n", "'name' is missing"),
]
FIT = [
    ("      - {publish: /echo, type: std_msgs/msg/String, message: {}}\n", "'/echo' is recorded"),
    (publish("message: {}\nanswer: /ecko"), "17: .*does not record '/ecko'. Did you mean '/echo'"),
    (publish("message: {}\nafter: 5 s"), "17: .*is too late: the timeout of 5 s"),
    (
        "      - {join: /echo, type: std_msgs/msg/String, name: late, after: 1 s}\n" * 2,
        "15: .*the name 'late' is used twice",
    ),
    (
        publish("message: {}")
        + "      - {join: /chatter, type: std_msgs/msg/String, name: late, after: 1 s}\n",
        "17: .*a late joiner would receive that",
    ),
    (
        "      - {kill: ecko, after: 1 s}\n",
        "14: .*launches 'ecko' 0 times.* Did you mean 'echo'?",
    ),
    (
        publish("messages: [{}]\nbefore_launch: 3\ndurability: transient_local"),
        "17: .*there are only 1 messages",
    ),
]
VALUES = [
    ("message: {date: a}", "std_msgs/msg/String", r"has no field 'date'\. Did you mean 'data'"),
    ("message: {data: 1}", "std_msgs/msg/String", "data: expected text, not 1"),
    (
        "message: {data: 256}",
        "std_msgs/msg/UInt8",
        r"expected a whole number from 0 to 255 \(uint8\), not 256",
    ),
    ("message: {data: 1}", "std_msgs/msg/Bool", "expected true or false, not 1"),
    (
        "message: {data: $gaol}",
        "std_msgs/msg/UInt8",
        r"no value 'gaol'. Did you mean 'goal'",
    ),
    ("message: {linear: {w: 1}}", "geometry_msgs/msg/Twist", r"no field 'w'. It has: x, y, z"),
    ("message: {data: 1}", "std_msgs/msg/Float64MultiArray", "data: expected a list, not 1"),
    ("message: {data: [1, a]}", "std_msgs/msg/Float64MultiArray", r"data\[1\]: expected a number"),
    ("message: {few: [1, 2, 3]}", "bot_msgs/msg/Three", "few: expected at most 2 values, not 3"),
    ("message: {'da ta': 1}", "std_msgs/msg/UInt8", "'da ta' is not a field"),
]


@pytest.mark.parametrize(("stimuli", "words"), FORM + FIT)
def test_a_mistake_is_named_with_its_line(found: Found, stimuli: str, words: str) -> None:
    (told,) = found(stimuli)
    assert re.search(words, told), told


@pytest.mark.parametrize(("message", "type", "words"), VALUES)
def test_a_value_that_does_not_fit_is_named_with_its_line(
    found: Found, message: str, type: str, words: str
) -> None:
    (told,) = found(publish(message, type))
    assert told.startswith("16: scenarios[0].stimuli[0].message")
    assert re.search(words, told), told


def read(folder: Path, **keys: object) -> list[tuple[dict[str, object], float]]:
    model = Publish.model_validate(
        {"publish": "/goal", "type": "geometry_msgs/msg/Vector3", **keys}
    )
    preparation = Preparation(folder, DEFINITIONS.__getitem__, 7, {"goal": 1.5}, [])
    return list(model.prepared(preparation).due)


def test_a_csv_file_has_a_message_in_each_row(folder: Path) -> None:
    (folder / "cases.csv").write_text("x, y\n1, 30 deg\n$goal,\n", encoding="utf-8")
    first, second = read(folder, **{"from": "cases.csv", "every": "500 ms"})
    assert first == ({"x": 1.0, "y": pytest.approx(0.5235987755982988)}, 0.0)
    assert second == ({"x": 1.5}, 0.5)


def test_rows_may_have_arrays_of_different_lengths(folder: Path) -> None:
    (folder / "cases.csv").write_text("data[0],data[1]\n1,2\n3,\n", encoding="utf-8")
    keys = {"from": "cases.csv", "every": "1 s", "type": "std_msgs/msg/Float64MultiArray"}
    assert [value for value, _ in read(folder, **keys)] == [{"data": [1.0, 2.0]}, {"data": [3.0]}]


def test_a_function_makes_messages_from_the_seed(folder: Path) -> None:
    (folder / "cases.py").write_text(
        "import numpy\ndef cases(seed):\n    return [{'x': numpy.float64(seed)}, {'y': 2}]\n",
        encoding="utf-8",
    )
    found = read(folder, python="cases.py:cases", answer="/rpy")
    assert found == [({"x": 7.0}, 0.0), ({"y": 2.0}, 0.0)]


def test_messages_are_repeated_one_round_after_another(folder: Path) -> None:
    (folder / "cases.py").write_text("def cases(seed):\n    return [{'x': 1}, {'x': 2}]\n")
    found = read(folder, python="cases.py:cases", every="500 ms", count=2)
    assert [(value["x"], time_s) for value, time_s in found] == [
        (1.0, 0.0),
        (2.0, 0.5),
        (1.0, 1.0),
        (2.0, 1.5),
    ]
    several = read(folder, messages=({"x": 3}, {"x": 4}), answer="/rpy", count=3)
    assert [value["x"] for value, _ in several] == [3.0, 4.0] * 3


FILES = [
    ("from: none.csv\nevery: 1 s", "cannot read none.csv: No such file"),
    ("from: ../other.csv\nevery: 1 s", r"\.\./other.csv is not in the assignment's folder"),
    ("from: empty.csv\nevery: 1 s", "empty.csv has no message"),
    ("from: wrong.csv\nevery: 1 s", r"wrong.csv:2: the message .* has no field 'q'. It has: data"),
    ("from: long.csv\nevery: 1 s", "long.csv:2: more values than fields in the first row"),
    ("from: latin.csv\nevery: 1 s", "latin.csv is not a CSV file: 'utf-8' codec can't decode"),
    ("from: bag.mcap", "bag.mcap: no MCAP file that can be read"),
    ("from: half.mcap", "half.mcap: no MCAP file that can be read"),
    ("from: other.mcap", "other.mcap has no messages on /chatter. Its topics: /talk"),
    ("from: type.mcap", "type.mcap has /chatter as std_msgs/msg/UInt8, not std_msgs/msg/String"),
    ("python: cases.py:many\nevery: 1 s\ncount: 5000", "15000 messages: at most 10000 are"),
    ("from: bag.mcap\ncount: 2", "with times of their own are published once"),
    ("python: cases.py:none\nevery: 1 s", "has no function 'none'. Its functions: .*raises"),
    ("python: cases.py:raises\nevery: 1 s", "cases.py:2: ZeroDivisionError: division by zero"),
    ("python: cases.py:text\nevery: 1 s", "must return a list of messages"),
]


def bag(file: Path, topic: str, type: str, definition: str, data: object) -> bytes:
    """Write an MCAP file with two messages, by the writer of the MCAP project."""
    with file.open("wb") as stream, Writer(stream) as writer:
        schema = writer.register_msgdef(type, definition)
        for number in range(2):
            writer.write_message(topic, schema, {"data": data}, number, number, number)
    return file.read_bytes()


@pytest.mark.parametrize(("rest", "words"), FILES)
def test_a_file_that_is_wrong_is_named(found: Found, folder: Path, rest: str, words: str) -> None:
    (folder / "empty.csv").write_text("data\n", encoding="utf-8")
    (folder / "wrong.csv").write_text("data,q\na,1\n", encoding="utf-8")
    (folder / "long.csv").write_text("data\na,1\n", encoding="utf-8")
    (folder / "latin.csv").write_bytes("data\nGrüße\n".encode("latin-1"))
    (folder / "bag.mcap").write_bytes(b"no")
    whole = bag(folder / "other.mcap", "/talk", "std_msgs/msg/String", "string data", "hello")
    (folder / "cut.mcap").write_bytes(whole[:-10])
    (folder / "half.mcap").write_bytes(whole[: len(whole) // 2])
    bag(folder / "type.mcap", "/chatter", "std_msgs/msg/UInt8", "uint8 data", 1)
    (folder / "cases.py").write_text(
        "def raises(seed):\n    return 1 / 0\ndef text(seed):\n    return 'a'\n"
        "def many(seed):\n    return [{}] * 3\n",
        encoding="utf-8",
    )
    (told,) = found(publish(rest))
    assert re.search(words, told), told


@pytest.mark.parametrize(
    ("type", "rows", "words"),
    [
        ("std_msgs/msg/UInt8", "data\n1\n256\n", r"n.csv:3: data: expected a whole number .*256"),
        ("std_msgs/msg/UInt8", "data\n\n1\nfive\n", r"n.csv:4: data: expected a number.*five"),
        ("std_msgs/msg/Float64MultiArray", "data[1]\n1\n", r"data\[0\] is missing: give the items"),
    ],
)  # fmt: skip
def test_a_cell_of_a_csv_file_that_does_not_fit_is_named_with_its_line(
    found: Found, folder: Path, type: str, rows: str, words: str
) -> None:
    (folder / "n.csv").write_text(rows, encoding="utf-8")
    (told,) = found(publish("from: n.csv\nevery: 1 s", type))
    assert told.startswith("16: scenarios[0].stimuli[0].from: n.csv:")
    assert re.search(words, told), told


def test_until_done_needs_a_stimulus_with_an_end(found: Found) -> None:
    until = "    until: {stimuli: done}\n"
    assert found(publish("message: {}") + until) == []
    (told,) = found(publish("message: {}\nevery: 1 s") + until)
    assert "until.stimuli: no stimulus of the scenario has an end" in told


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (
            "uses: timing.latency, with: {stimulus: /chater, topic: /echo, most: 1 s}",
            "publishes on '/chater'. Did you mean '/chatter'?",
        ),
        (
            "uses: qos.late_joiner, with: {joiner: latte, topic: /echo, last: 1}",
            "is a join with the name 'latte'. Did you mean 'late'?",
        ),
    ],
)
def test_a_check_of_a_stimulus_needs_it(found: Found, check: str, words: str) -> None:
    stimuli = publish("message: {}") + GOOD[10]
    checks = f"checks:\n  - {{id: one, points: 1, {check}}}\n#"
    (told,) = found(stimuli + checks)
    assert words in told


@pytest.mark.parametrize(
    "stimulus",
    [
        "- {call: /enable, type: std_srvs/srv/SetBool, request: {data: true}, at_once: 2}",
        "- {call: /enable, type: std_srvs/srv/SetBool, requests: [{}, {data: false}], every: 1 s}",
        "- {call: list_parameters, every: 500 ms}",
        "- {call: /go, type: x/srv/Go, request: {to.x: $speed, to.y: 30 deg}}",
        "- {call: /other, type: nav2_msgs/srv/Other, request: {any: thing}}",
        "- {read_parameters: bot, after: 1 s}",
        "- {set_parameters: {speed: $speed, names: [a, b]}, node: /robot/bot}",
        "- {send_goal: /fib, type: x/action/Fibonacci, goal: {order: 5}, cancel_after: 1 s}",
        "- {send_goal: /fib, type: x/action/Fibonacci, goal: {order: 5}, preempt: true}",
    ],
)
def test_requests_that_fit_are_read(found: Found, stimulus: str) -> None:
    assert found(f"      {stimulus}\n") == []


@pytest.mark.parametrize(
    ("stimulus", "expected"),
    [
        (
            "- call: /enable\n        type: std_srvs/srv/SetBool\n        request: {dat: true}",
            r"16: .*has no field 'dat'. Did you mean 'data'\?",
        ),
        ("- {call: /enable, type: std_srvs/srv/SetBool, request: {data: 3}}", "expected true or"),
        ("- {call: /enable, type: std_msgs/msg/Bool}", "expected an interface in srv"),
        (
            "- {call: /e, type: std_srvs/srv/SetBool, request: {}, requests: [{}]}",
            "either 'request' or 'requests'",
        ),
        ("- {call: enable, every: 1 s}", "expected 'list_parameters'"),
        ("- {call: /e, type: std_srvs/srv/SetBool, after: 9 s}", "is too late: the timeout of 5"),
        ("- {set_parameters: {}, node: bot}", "at least 1"),
        ("- {set_parameters: {a: []}, node: bot}", "a list of one of these"),
        ("- {set_parameters: {a: [1, x]}, node: bot}", "a list of one of these"),
        ("- {set_parameters: {a: {b: 1}}, node: bot}", "expected true or false, a number, a text"),
        ("- {set_parameters: {a: $sped}, node: bot}", "Did you mean 'speed'"),
        ("- {set_parameters: {a: 1}, node: b-t}", "is not a node name"),
        (
            "- {send_goal: /fib, type: x/action/Fibonacci, goal: {ordre: 5}}",
            "Did you mean 'order'",
        ),
        ("- {send_goal: /fib, type: x/srv/Go}", "expected an interface in action"),
    ],
)
def test_a_request_that_does_not_fit_is_named(found: Found, stimulus: str, expected: str) -> None:
    told = found(f"      {stimulus}\n")
    assert any(re.search(expected, one) for one in told), told


def test_requests_have_values_in_si_units_and_drawn_ones() -> None:
    call = CallService.model_validate(
        {
            "call": "/go",
            "type": "x/srv/Go",
            "request": {"to.x": "$speed", "to.y": "180 deg"},
            "count": 2,
        }
    )
    first, second = call.prepared(MAKING).requests
    assert first == second == {"to": {"x": 1.5, "y": pytest.approx(3.14159265)}}


def test_the_type_of_a_parameter_is_that_of_the_yaml() -> None:
    given = {"a": 1, "b": 1.0, "c": "2 m", "d": True, "e": "text", "f": [1, 2.5], "g": "$speed"}
    item = SetParameters.model_validate({"set_parameters": given, "node": "bot"})
    found = item.prepared(MAKING).set_parameters
    assert found == {"a": 1, "b": 1.0, "c": 2.0, "d": True, "e": "text", "f": [1, 2.5], "g": 1.5}
    assert [type(found[name]) for name in "abcd"] == [int, float, float, bool]


def serve(rest: str, name: str = "/go", type: str = "x/action/Drive") -> str:
    head = f"      - serve: {name}\n        type: {type}\n"
    return head + "".join(f"        {line}\n" for line in rest.splitlines())


@pytest.mark.parametrize(
    "stimulus",
    [
        serve(""),
        serve("answers: [{when: {to.x: 1}, status: rejected}, {takes: forever, cancel: reject}]"),
        serve("answers: [{feedback: [{distance: 30 cm}], every: 100 ms, status: aborted}]"),
        serve("answers: [{delay: forever}, {response: {success: true}}]", "/e", SET_BOOL),
        serve("after: 1 s", "/e", SET_BOOL),
    ],
)
def test_servers_that_fit_are_read(found: Found, stimulus: str) -> None:
    assert found(stimulus) == []


@pytest.mark.parametrize(
    ("stimulus", "expected"),
    [
        (serve("answers: [{when: {by: 1}}]"), r"16: .*has no field 'by'. It has: to"),
        (serve("answers: [{feedback: [{to: 1}]}]"), r"16: .*has no field 'to'. It has: distance"),
        (serve("answers: [{response: {}}]"), r"16: .*unknown key 'response'"),
        (serve("answers: [{takes: ever}]"), r"16: .*takes: .*forever"),
        (serve("answers: [{drive: {to: to, distance: to}}]"), r"16: .*no field 'to'. It has: dist"),
        (serve("answers: [{drive: {to: head}}]"), r"16: .*'head' of the goal has no position"),
        (serve("answers: [{drive: {to: to}}]"), r"16: .*only in a 'world', which is missing"),
        (serve("") + serve(""), r"'/go' stands twice: give one server several 'answers'"),
        (serve("", type="std_msgs/msg/String"), r"an interface in srv or action"),
    ],
)
def test_a_server_that_does_not_fit_is_named(found: Found, stimulus: str, expected: str) -> None:
    mistakes = found(stimulus)
    assert re.search(expected, mistakes[-1]), mistakes


def test_a_goal_takes_as_long_as_its_feedback() -> None:
    values = {"serve": "/go", "type": "x/action/Drive"}
    answers = ({"feedback": [{}, {}], "every": "250 ms"}, {"takes": "forever"})
    played = ServeAction.model_validate({**values, "answers": answers}).prepared(MAKING)
    assert [one.takes_s for one in played.answers] == [0.5, math.inf]
