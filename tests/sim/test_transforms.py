"""/tf and /tf_static, with the tf2_msgs that rosgrade carries: the package index has none."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from grader.machine import resources, ros
from grader.run.cell.domain import lock_domain
from grader.submission.underlay.store import UnderlayStore

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.compiles]

ROOT = Path(__file__).parents[2]
LIMIT_S = 60.0
WORLD = "bounds: [-1, -2, 3, 4]\nstart: [1, 2, 90 deg]\n"
OPTIONS = "lidar: {pose: [-0.032, 0, 180 deg]}\n"
LISTENER = """\
import json, sys
import rclpy
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

heard = {'/tf': {}, '/odom': {}}

def stamp(header):
    return header.stamp.sec, header.stamp.nanosec

def plain(one):
    move, turn = one.transform.translation, one.transform.rotation
    frames = [one.header.frame_id, one.child_frame_id]
    return {'frames': frames, 'place': [move.x, move.y, move.z], 'turn': [turn.z, turn.w]}

def on_odometry(message):
    pose = message.pose.pose
    heard['/odom'][stamp(message.header)] = {
        'frames': [message.header.frame_id, message.child_frame_id],
        'place': [pose.position.x, pose.position.y, pose.position.z],
        'turn': [pose.orientation.z, pose.orientation.w],
    }

def on_transform(message):
    [one] = message.transforms
    heard['/tf'][stamp(one.header)] = plain(one)

def on_static(message):
    heard['/tf_static'] = [plain(one) for one in message.transforms]

rclpy.init(domain_id=int(sys.argv[1]))
node = rclpy.create_node('listener')
late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(Odometry, '/odom', on_odometry, 10)
node.create_subscription(TFMessage, '/tf', on_transform, 10)
node.create_subscription(TFMessage, '/tf_static', on_static, late)
both = set()
while not both or '/tf_static' not in heard:
    rclpy.spin_once(node)
    both = heard['/tf'].keys() & heard['/odom'].keys()
at = both.pop()
print(json.dumps([heard['/tf'][at], heard['/odom'][at], heard['/tf_static']]))
"""


@pytest.fixture(scope="module")
def environment() -> dict[str, str]:
    """Variables of a shell with tf2_msgs in it, built once for all tests that need it."""
    found = ros.find()
    store = UnderlayStore(resources.cache_folder(), found)
    return {
        **store.completed(found, ["tf2_msgs"]).environment(os.environ),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


@pytest.fixture(scope="module")
def heard(environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """What `rosgrade sim` says on /tf and /odom at one time, and late on /tf_static."""
    folder = tmp_path_factory.mktemp("worlds")
    world, options = folder / "room.yaml", folder / "options.yaml"
    world.write_text(WORLD)
    options.write_text(OPTIONS)
    with lock_domain() as domain:
        number = str(domain.domain_id)
        command = [sys.executable, "-m", "grader", "sim", str(world), "--options", str(options)]
        simulator = subprocess.Popen(
            [*command, "--domain-id", number],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert simulator.stdout is not None
            # It has published where the LiDAR sits by now.
            simulator.stdout.readline()
            told = subprocess.run(
                [sys.executable, "-c", LISTENER, number],
                env=environment,
                stdout=subprocess.PIPE,
                timeout=LIMIT_S,
                check=True,
            )
        finally:
            simulator.kill()
            simulator.communicate()
    found: list[Any] = json.loads(told.stdout)
    return found


def test_transforms_say_what_odometry_says_and_late_joiners_get_what_is_fixed_to_the_robot(
    heard: list[Any],
) -> None:
    moving, odometry, [base, scan] = heard
    assert moving == odometry
    assert moving["frames"] == ["odom", "base_footprint"]
    assert base["frames"] == ["base_footprint", "base_link"]
    assert base["place"] == [0.0, 0.0, 0.010]
    assert scan["frames"] == ["base_link", "base_scan"]
    assert scan["place"] == [-0.032, 0.0, 0.172]
    assert abs(2.0 * math.acos(scan["turn"][1])) == pytest.approx(math.pi)
