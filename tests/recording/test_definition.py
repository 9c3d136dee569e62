"""Message definitions are put together as MCAP's ros2msg schemas want them."""

from __future__ import annotations

import pytest

from grader.recording.interface import concatenated_definition

FILES = {
    "nav_msgs/msg/Odometry": "std_msgs/Header header\nstring child # name\nPose[2] poses\n",
    "nav_msgs/msg/Pose": "float64 x 1.0\nfloat64[<=3] rest\nuint8 A=1\n",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring<=8 frame_id\n",
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
}


def test_every_contained_definition_follows_once() -> None:
    text = concatenated_definition("nav_msgs/msg/Odometry", FILES.__getitem__)
    parts = text.split("=" * 80 + "\n")
    assert parts[0].startswith("std_msgs/Header header")
    assert [part.partition("\n")[0] for part in parts[1:]] == [
        "MSG: std_msgs/Header",
        "MSG: nav_msgs/Pose",
        "MSG: builtin_interfaces/Time",
    ]


def test_a_missing_definition_is_named() -> None:
    with pytest.raises(KeyError, match="builtin_interfaces/msg/Time"):
        concatenated_definition(
            "std_msgs/msg/Header", {k: v for k, v in FILES.items() if "Header" in k}.__getitem__
        )
