"""The cv_bridge that rosgrade carries, as a student's node imports it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from grader.machine import resources, ros
from grader.submission.underlay.store import UnderlayStore

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.compiles]

ROOT = Path(__file__).parents[2]
PROGRAM = """\
import numpy as np
import pytest
from cv_bridge import CvBridge, CvBridgeError
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header
from sim.png import png

bridge = CvBridge()
rgb = np.random.default_rng(1).integers(0, 256, (5, 7, 3), np.uint8)
message = bridge.cv2_to_imgmsg(rgb, "rgb8", header=Header(frame_id="eye"))
assert (message.height, message.width, message.step) == (5, 7, 21)
assert (message.encoding, message.header.frame_id) == ("rgb8", "eye")
assert (bridge.imgmsg_to_cv2(message) == rgb).all()
assert (bridge.imgmsg_to_cv2(message, "bgr8") == rgb[..., ::-1]).all()
assert (bridge.imgmsg_to_cv2(message, "bgra8")[..., :3] == rgb[..., ::-1]).all()
grey = bridge.imgmsg_to_cv2(message, desired_encoding="mono8")
assert grey.shape == (5, 7)
assert np.abs(grey - rgb @ (0.299, 0.587, 0.114)).max() <= 0.51
assert (bridge.imgmsg_to_cv2(bridge.cv2_to_imgmsg(grey, "mono8"), "rgb8") == grey[..., None]).all()

depth = np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4)
message = bridge.cv2_to_imgmsg(depth)
assert message.encoding == "32FC1"
assert (bridge.imgmsg_to_cv2(message) == depth).all()
padded = Image(height=2, width=2, step=8, encoding="bgr8", data=list(range(16)))
assert bridge.imgmsg_to_cv2(padded).tolist() == [[[0, 1, 2], [3, 4, 5]], [[8, 9, 10], [11, 12, 13]]]
big = Image(height=1, width=1, step=2, encoding="mono16", is_bigendian=1, data=[1, 2])
assert bridge.imgmsg_to_cv2(big).tolist() == [[258]]

seen = CompressedImage(format="rgb8; png compressed bgr8", data=png(rgb))
assert (bridge.compressed_imgmsg_to_cv2(seen) == rgb[..., ::-1]).all()
again = bridge.cv2_to_compressed_imgmsg(rgb[..., ::-1], dst_format="png")
assert (bridge.compressed_imgmsg_to_cv2(again, "rgb8") == rgb).all()

wrongs = [lambda: bridge.cv2_to_imgmsg(rgb, "mono8"), lambda: bridge.imgmsg_to_cv2(big, "rgb8")]
for wrong in wrongs:
    with pytest.raises(CvBridgeError):
        wrong()
"""


def test_it_converts_as_the_one_of_ros_does() -> None:
    found = ros.find()
    if "cv_bridge" in found.packages:
        pytest.skip("this ROS has a cv_bridge of its own")
    store = UnderlayStore(resources.cache_folder(), found)
    environment = store.completed(found, ["cv_bridge"]).environment(os.environ)
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, cwd=ROOT, check=False)
    assert done.returncode == 0
