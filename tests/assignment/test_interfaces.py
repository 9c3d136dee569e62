"""Interfaces that an assignment names: those that do not exist are reported with their line."""

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
  - {name: bot_msgs, build_type: ament_cmake}
scenarios:
  - id: run
    launch: [{package: bot, executable: echo}]
    record: [{topic: /echo, type: RECORDED}]
    timeout: 5 s
    stimuli:
      - publish: /chatter
        type: SENT
        message: {}
checks:
  - id: type
    uses: topic.type
    with: {topic: /chatter, kind: subscription, type: JUDGED}
    points: 1
"""
DEFINITIONS = {
    "std_msgs/msg/String": "string data\n",
    "std_msgs/msg/Int64": "int64 data\n",
    "geometry_msgs/msg/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
}
STRING = "std_msgs/msg/String"

Found = Callable[..., list[str]]


@pytest.fixture
def found(tmp_path: Path, mistakes: Found) -> Found:
    """Load the lesson with some interfaces and files."""

    def load(
        recorded: str = STRING, sent: str = STRING, judged: str = STRING, **files: str
    ) -> list[str]:
        for name, content in files.items():
            file = tmp_path / "lesson/interfaces" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(content, encoding="utf-8")
        text = LESSON.replace("RECORDED", recorded).replace("SENT", sent)
        return mistakes(text.replace("JUDGED", judged))

    return load


OWN = {"bot_msgs/package.xml": "<package/>", "bot_msgs/msg/BotStatus.msg": "uint8 model\n"}
MISTAKES = [
    (
        {"recorded": "std_msgs/msg/Strin"},
        ["10: scenarios[0].record[0].type: std_msgs has no msg 'Strin'. Did you mean 'String'?"],
    ),
    (
        {"sent": "std_msgs/msg/Zzz"},
        ["14: scenarios[0].stimuli[0].type: std_msgs has no msg 'Zzz'. It has: Int64, String."],
    ),
    (
        {"judged": "geometry_msg/msg/Twist"},
        ["19: checks[0].with.type: there is no package 'geometry_msg': not in ROS, not in "
         "interfaces/ beside the assignment, not in 'underlays', and not in 'packages' or their "
         "'depends'. "
         "Did you mean 'geometry_msgs'?"],
    ),
    (
        {"recorded": "bot_msgs/msg/BotStatus"},
        ["10: scenarios[0].record[0].type: students hand in 'bot_msgs', and rosgrade never "
         "imports their code: put your own copy of it in interfaces/bot_msgs beside the "
         "assignment"],
    ),
    (
        {"recorded": "bot_msgs/msg/BotState", **OWN},
        ["10: scenarios[0].record[0].type: interfaces/bot_msgs has no msg "
         "'BotState'. Did you mean 'BotStatus'?"],
    ),
]  # fmt: skip


@pytest.mark.parametrize(("named", "expected"), MISTAKES)
def test_an_interface_that_does_not_exist_is_reported_with_its_line(
    found: Found, ros_with: Callable[..., None], named: dict[str, str], expected: list[str]
) -> None:
    ros_with(DEFINITIONS)
    assert found(**named) == expected


@pytest.mark.parametrize(
    "named",
    [
        {},
        {"recorded": "bot_msgs/msg/BotStatus", "sent": "bot_msgs/msg/BotStatus", **OWN},
        {"judged": "bot_msgs/msg/BotStatus"},
        {"recorded": "example_interfaces/msg/Int64", "sent": "example_interfaces/msg/String"},
        {"recorded": "lab_msgs/msg/Any", "sent": "lab_msgs/msg/Any"},
        {"recorded": "nav2_msgs/msg/Costmap"},
    ],
    ids=["ROS", "our copy", "handed in, only judged", "carried", "named in depends", "of Jazzy"],
)
def test_what_exists_or_may_exist_elsewhere_is_accepted(
    found: Found, ros_with: Callable[..., None], named: dict[str, str]
) -> None:
    ros_with(DEFINITIONS)
    assert found(**named) == []


def test_without_ros_only_what_is_beside_the_assignment_is_known(
    found: Found, ros_with: Callable[..., None]
) -> None:
    ros_with(None)
    assert found(recorded="std_msgs/msg/Strin", sent="geometry_msg/msg/Twist") == []
    assert found(recorded="bot_msgs/msg/BotState", **OWN) == MISTAKES[4][1]


def test_fields_of_our_copy_are_checked(
    found: Found, ros_with: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    ros_with(DEFINITIONS)
    monkeypatch.setitem(globals(), "LESSON", LESSON.replace("message: {}", "message: {modle: 1}"))
    (mistake,) = found(sent="bot_msgs/msg/BotStatus", **OWN)
    assert mistake.startswith("15: ")
    assert "has no field 'modle'. Did you mean 'model'?" in mistake
