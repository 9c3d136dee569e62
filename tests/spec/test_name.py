"""Names follow the rules of ROS (REP-144, the topic name design), so that YAML fails early."""

from __future__ import annotations

import pytest

from grader.spec.name import (
    check_id,
    interface_name,
    library_name,
    namespace,
    node_name,
    package_name,
    topic_name,
)


@pytest.mark.parametrize(
    ("rule", "good"),
    [
        (check_id, ["period", "depth_10", "a"]),
        (package_name, ["bot_publisher", "tf2"]),
        (topic_name, ["/cmd_vel", "/robot/cmd_vel", "/Robot1/scan_0", "/_hidden"]),
        (node_name, ["bot_publisher", "Bot", "_probe"]),
        (namespace, ["/", "/robot", "/fleet/robot_1"]),
        (interface_name, ["geometry_msgs/msg/Twist", "std_srvs/srv/SetBool", "a/action/Go2"]),
        (library_name, ["scipy", "opencv-python", "ruamel.yaml", "PyYAML", "a"]),
    ],
)
def test_good_names_are_kept(rule, good) -> None:  # type: ignore[no-untyped-def]
    assert [rule(name) for name in good] == good


@pytest.mark.parametrize(
    ("rule", "name", "said"),
    [
        (check_id, "Period", "'Period' is not an id"),
        (check_id, "1st", "'1st' is not an id"),
        (check_id, "a\n", "is not an id"),
        (library_name, "scipy>=1", "'scipy>=1' is not the name of a Python library"),
        (library_name, "-e.", "without a version"),
        (package_name, "bot-publisher", "'bot-publisher' is not a package name"),
        (topic_name, "cmd_vel", "'cmd_vel' is relative: write the full name, '/cmd_vel'"),
        (topic_name, "/", "'/' is not a ROS topic name"),
        (topic_name, "/cmd vel", "is not a ROS topic name"),
        (topic_name, "/cmd__vel", "is not a ROS topic name"),
        (node_name, "/bot", "'/bot' is not a node name"),
        (node_name, "1bot", "not beginning with a digit"),
        (namespace, "robot", "'robot' is relative"),
        (interface_name, "geometry_msgs/Twist", "Did you mean 'geometry_msgs/msg/Twist'?"),
        (interface_name, "geometry_msgs.msg.Twist", r"\(package/msg/Type\)"),
        (interface_name, "geometry_msgs/msg/twist", "is not an interface name"),
    ],
)
def test_wrong_names_say_what_is_wrong(rule, name, said) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=said):
        rule(name)
