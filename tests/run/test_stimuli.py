"""Stimuli, played to real nodes: what is published, who joins, what is killed and restarted."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest
from mcap_ros2.writer import Writer

from grader.recording.model import Ending, Kind, Owner
from tests.run.conftest import RunNode

pytestmark = [pytest.mark.ros]

STRING = "std_msgs/msg/String"
INT = "std_msgs/msg/Int64"


def node_source(name: str, body: str) -> str:
    """A node of the student's, whose constructor has more lines."""
    return f"""\
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Int64, String

class Made(Node):
    def __init__(self):
        super().__init__("{name}")
{body}
rclpy.init()
rclpy.spin(Made())
"""


ECHO = node_source(
    "echo",
    """\
        self.publisher = self.create_publisher(String, "/echo", 10)
        self.create_subscription(String, "/chatter", self.answer, 10)

    def answer(self, message):
        if message.data != "silence":
            self.publisher.publish(String(data=message.data.upper()))
""",
)
LATCHED = node_source(
    "latched",
    """\
        profile = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.publisher = self.create_publisher(Int64, "/count", profile)
        self.create_subscription(Int64, "/history", self.publisher.publish, profile)
""",
)
TWO_EARS = node_source(
    "two_ears",
    """\
        self.echo = self.create_publisher(String, "/echo", 10)
        self.count = self.create_publisher(Int64, "/count", 10)
        self.create_subscription(String, "/chatter", self.echo.publish, 10)
        self.create_subscription(Int64, "/numbers", self.count.publish, 10)
""",
)
TICKING = node_source(
    "ticking",
    """\
        self.publisher = self.create_publisher(String, "/echo", 10)
        self.create_timer(0.3, lambda: self.publisher.publish(String()))
""",
)


def echoing(**scenario: object) -> dict[str, object]:
    return {
        "record": [{"topic": "/echo", "type": STRING}],
        "until": {"stimuli": "done"},
        "timeout": "10 s",
        **scenario,
    }


def test_each_message_goes_out_when_the_one_before_was_answered(run_node: RunNode) -> None:
    words = ["one", "silence", "three"]
    stimulus = {
        "publish": "/chatter",
        "type": STRING,
        "messages": [{"data": word} for word in words],
        "answer": "/echo",
        "within": "300 ms",
    }
    recording = run_node(ECHO, **echoing(stimuli=[stimulus]))
    assert recording.ending is Ending.UNTIL
    sent = recording.sent["/chatter"]
    assert [message.value["data"] for message in sent] == words
    assert [message.value["data"] for message in recording.on("/echo")] == ["ONE", "THREE"]
    assert recording.answers == {"/chatter": "/echo"}
    # Not before the student had matched, the second at once, the third when its time had passed.
    assert recording.matched_ns is not None and sent[0].stamp_ns > recording.matched_ns
    assert recording.on("/echo")[0].stamp_ns < sent[1].stamp_ns
    assert sent[2].stamp_ns - sent[1].stamp_ns >= 0.3e9
    # The probe's own publisher is none of the student's.
    (ours,) = [item for item in recording.endpoints if item.topic == "/chatter"
               and item.kind is Kind.PUBLISHER]  # fmt: skip
    assert ours.owner is Owner.PROBE


def test_messages_of_files_reach_the_node_in_their_order_and_at_their_times(
    run_node: RunNode, tmp_path: Path
) -> None:
    # Written by the writer of the MCAP project, as `ros2 bag record --storage mcap` would.
    times_s = [0.0, 0.5, 0.6, 1.5]
    with (tmp_path / "words.mcap").open("wb") as stream, Writer(stream) as writer:
        schema = writer.register_msgdef(STRING, "string data")
        for number, time_s in enumerate(times_s):
            stamp_ns = 1_700_000_000_000_000_000 + round(time_s * 1e9)
            for topic in ("/other", "/chatter"):
                message = {"data": f"{topic} {number}"}
                writer.write_message(topic, schema, message, stamp_ns, stamp_ns, number)
    (tmp_path / "numbers.csv").write_text("data\n7\n-1\n9223372036854775807\n", encoding="utf-8")
    recording = run_node(
        TWO_EARS,
        worlds=tmp_path,
        **echoing(
            record=[{"topic": "/echo", "type": STRING}, {"topic": "/count", "type": INT}],
            stimuli=[
                {"publish": "/chatter", "type": STRING, "from": "words.mcap"},
                {"publish": "/numbers", "type": INT, "from": "numbers.csv", "every": "200 ms"},
            ],
            until={"stimuli": "done", "quiet": "300 ms"},
        ),
    )
    assert recording.ending is Ending.UNTIL
    heard = {
        topic: [one.value["data"] for one in recording.on(topic)] for topic in ("/echo", "/count")
    }
    assert heard["/echo"] == [f"/chatter {number}" for number in range(4)]
    assert heard["/count"] == [7, -1, 2**63 - 1]
    for topic, due_s in (("/chatter", times_s), ("/numbers", [0.0, 0.2, 0.4])):
        stamps = [one.stamp_ns for one in recording.sent[topic]]
        # A late cell is not tested here; nothing comes before its time, but for how late the
        # first one was.
        gaps = [(stamp - stamps[0]) / 1e9 - due for stamp, due in zip(stamps, due_s, strict=True)]
        assert min(gaps) > -0.2


def test_what_was_published_before_the_launch_reaches_the_node_and_then_a_late_joiner(
    run_node: RunNode,
) -> None:
    stimuli = [
        {
            "publish": "/history",
            "type": INT,
            "messages": [{"data": n} for n in range(14)],
            "before_launch": 12,
            "every": "100 ms",
            "durability": "transient_local",
            "depth": 12,
        },
        {
            "join": "/count",
            "type": INT,
            "name": "late",
            "after": "1 s",
            "durability": "transient_local",
        },
    ]
    recording = run_node(
        LATCHED, **echoing(stimuli=stimuli, record=[{"topic": "/count", "type": INT}])
    )
    sent = recording.sent["/history"]
    assert [message.value["data"] for message in sent] == list(range(14))
    assert sum(message.stamp_ns < recording.launched_ns for message in sent) == 12
    # The reader's own queue of 10 may drop some of a burst of 12; the live ones come last.
    heard = [message.value["data"] for message in recording.on("/count")]
    assert heard[-2:] == [12, 13]
    assert set(range(2, 12)) <= set(heard)
    (join,) = recording.joins
    assert (join.name, join.topic, join.qos.durability) == ("late", "/count", "transient_local")
    assert join.matched_ns is not None and join.matched_ns > join.joined_ns
    # The publisher keeps the last 10 of all that it has published.
    assert [message.value["data"] for message in recording.joined["late"]] == heard[-10:]


def test_a_process_is_killed_and_started_again(run_node: RunNode) -> None:
    stimuli = [
        {"publish": "/chatter", "type": STRING, "message": {"data": "hello"}, "every": "50 ms"},
        {"kill": "bot_pub", "after": "500 ms", "signal": "SIGINT"},
        {"restart": "bot_pub", "after": "1500 ms"},
    ]
    recording = run_node(ECHO, **echoing(stimuli=stimuli, until={"elapsed": "4 s"}))
    assert recording.ending is Ending.UNTIL
    assert [(item.action, item.signal) for item in recording.interventions] == [
        ("kill", "SIGINT"),
        ("restart", ""),
    ]
    first, second = recording.processes
    assert first.name == second.name
    assert first.stopped_by == "SIGINT" and first.exited_ns is not None
    assert first.exited_ns < second.started_ns < recording.stop_ns
    # It answers in both of its lives.
    answers = [message.stamp_ns for message in recording.on("/echo")]
    assert any(stamp < first.exited_ns for stamp in answers)
    assert any(stamp > second.started_ns for stamp in answers)


def test_without_a_subscription_nothing_is_published_and_the_run_ends(run_node: RunNode) -> None:
    deaf = ECHO.replace('"/chatter"', '"/chatting"')
    stimulus = {"publish": "/chatter", "type": STRING, "message": {"data": "hello"}}
    recording = run_node(deaf, **echoing(stimuli=[stimulus], timeout="20 s"))
    assert recording.ending is Ending.UNTIL
    assert recording.sent == {"/chatter": ()}
    (wait,) = [wait for wait in recording.waits if wait.what == "a subscription on /chatter"]
    assert wait.met_ns is None


def test_calls_keep_their_own_rhythm_beside_that_of_the_messages(run_node: RunNode) -> None:
    stimulus = {"call": "list_parameters", "every": "230 ms"}
    recording = run_node(TICKING, **echoing(stimuli=[stimulus], until={"messages": 11}))
    asked = [call.requested_ns for call in recording.calls]
    gaps_s = [(other - one) / 1e9 for one, other in pairwise(asked)]
    # A caller that waits for the next message calls every 300 ms, unless the machine is busy.
    assert 0.22 < median(gaps_s) < 0.29 + recording.stolen_s(asked[0], asked[-1])
