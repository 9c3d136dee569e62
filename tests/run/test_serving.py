"""What a real client gets of a service that the scenario serves."""

from __future__ import annotations

import pytest

from grader.findings.finding import Status
from grader.recording.model import NS, Ending
from tests.checks.builder import judge
from tests.run.conftest import RunNode

CLIENT = """\
import rclpy
from std_srvs.srv import SetBool

rclpy.init()
node = rclpy.create_node("bot")
client = node.create_client(SetBool, "enable")
client.wait_for_service()
for data, limit_s in ((False, None), (True, None), (True, 0.5), (False, None)):
    future = client.call_async(SetBool.Request(data=data))
    rclpy.spin_until_future_complete(node, future, timeout_sec=limit_s)
    print(getattr(future.result(), "message", None))
rclpy.spin(node)
"""


@pytest.mark.ros
def test_a_client_gets_every_scripted_answer_and_what_it_asked_is_recorded(
    run_node: RunNode,
) -> None:
    served = {
        "serve": "/enable",
        "type": "std_srvs/srv/SetBool",
        "after": "500 ms",
        "answers": [
            {"when": {"data": True}, "response": {"success": True, "message": "on"}},
            {"when": {"data": True}, "delay": "forever"},
            {"response": {"message": "off"}, "delay": "300 ms"},
        ],
    }
    recording = run_node(
        CLIENT, record=[], stimuli=[served], until={"stimuli": "done"}, timeout="20 s"
    )
    assert recording.ending is Ending.UNTIL
    printed = [line.text for line in recording.log if line.stream == "stdout"]
    assert printed == ["off", "on", "None", "off"]
    first, second, third, last = recording.asked
    assert (first.fields, first.answer) == ({"data": False}, {"success": False, "message": "off"})
    assert 0.3 <= ((first.ended_ns or 0) - first.asked_ns) / NS < 1.0
    assert [one.status for one in (second, third, last)] == ["answered", "unanswered", "answered"]
    assert [one.name for one in recording.clients if one.node == "/bot"] == ["/enable"]
    sequence = [{"data": value} for value in (False, True, True, False)]
    asked = {"server": "/enable", "sequence": sequence, "after_result": True}
    assert judge("client.asks", recording, **asked).status is Status.PASSED
