"""What the simulator publishes of a camera."""

from __future__ import annotations

import importlib
import math
from array import array
from typing import Any

from geometry_msgs.msg import Pose as PoseMessage
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import ColorRGBA

from sim.camera import Camera, Picture, VisibleObject
from sim.motion import NS, Pose
from sim.png import png
from sim.publishers import make_publisher, set_time


class CameraPublisher:
    """Publishes pictures, raw and compressed, what is known of the camera, and what it sees.

    What the logical camera sees is a visualization_msgs/msg/MarkerArray: of the messages in
    common_interfaces it is the one with type, pose, size and colour for each thing, and RViz and
    Foxglove show it; vision_msgs is not among them. ``ns`` is the type of the thing, ``id`` tells
    two of one type apart.
    """

    def __init__(self, node: Node, camera: Camera) -> None:
        """Create the publishers."""
        options = camera.options
        self._camera = camera
        self._image = Image(
            height=options.height,
            width=options.width,
            encoding=options.encoding,
            step=3 * options.width,
        )
        # As compressed_image_transport names it; a PNG holds red, green and blue, which OpenCV
        # reads as bgr8.
        self._compressed = CompressedImage(format=f"{options.encoding}; png compressed bgr8")
        self._info = _camera_info(camera)
        for message in (self._image, self._compressed, self._info):
            message.header.frame_id = options.frame
        self.image = make_publisher(node, Image, options.topic, options)
        self.compressed = make_publisher(node, CompressedImage, options.compressed_topic, options)
        self.info = make_publisher(node, CameraInfo, options.info_topic, options)
        self.objects = None
        if options.objects is not None:
            self._markers = importlib.import_module("visualization_msgs.msg")
            kind = self._markers.MarkerArray
            self.objects = make_publisher(node, kind, options.objects.topic, options.objects)

    @property
    def is_heard(self) -> bool:
        """Whether anybody subscribes to anything of it."""
        publishers = (self.image, self.compressed, self.info, self.objects)
        return any(one is not None and one.get_subscription_count() for one in publishers)

    def publish(self, pose: Pose, time_ns: int, stamp_ns: int) -> None:
        """Publish what the camera sees, as far as somebody wants it."""
        set_time(self._info.header.stamp, stamp_ns)
        wants_raw = self.image.get_subscription_count() > 0
        wants_compressed = self.compressed.get_subscription_count() > 0
        if wants_raw or wants_compressed:
            picture = self._camera.picture(pose, time_ns)
            if wants_raw:
                self._publish_raw(picture, stamp_ns)
            if wants_compressed:
                set_time(self._compressed.header.stamp, stamp_ns)
                self._compressed.data = array("B", png(picture))
                self.compressed.publish(self._compressed)
        if self.info.get_subscription_count():
            self.info.publish(self._info)
        if self.objects is not None and self.objects.get_subscription_count():
            visible = self._camera.objects(pose, time_ns)
            markers = [self._marker(one, stamp_ns) for one in visible]
            self.objects.publish(self._markers.MarkerArray(markers=markers))

    def _publish_raw(self, picture: Picture, stamp_ns: int) -> None:
        set_time(self._image.header.stamp, stamp_ns)
        is_rgb = self._camera.options.encoding == "rgb8"
        ordered = picture if is_rgb else picture[..., ::-1]
        # An array('B') is taken over as it is, as with the ranges of a scan.
        self._image.data = array("B", ordered.tobytes())
        self.image.publish(self._image)

    def _marker(self, visible: VisibleObject, stamp_ns: int) -> Any:
        marker = self._markers.Marker(ns=visible.kind, id=visible.number)
        marker.header.frame_id = self._camera.options.link
        set_time(marker.header.stamp, stamp_ns)
        marker.type = marker.CYLINDER if visible.kind == "pillar" else marker.CUBE
        _set_place(marker.pose, visible, self._camera.options.pitch)
        marker.scale.x, marker.scale.y, marker.scale.z = visible.size_m
        red, green, blue = (share / 255.0 for share in visible.colour)
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        # Until the next message, and a little longer if it is late.
        lasts_ns = round(2.0 * NS / self._camera.options.rate)
        marker.lifetime.sec, marker.lifetime.nanosec = divmod(lasts_ns, NS)
        return marker


def _camera_info(camera: Camera) -> CameraInfo:
    """A camera without distortion: a point (x, y, z) is at K (x, y, z), divided by z."""
    options, focal, (u, v) = camera.options, camera.focal_px, camera.centre_px
    return CameraInfo(
        height=options.height,
        width=options.width,
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=[focal, 0.0, u, 0.0, focal, v, 0.0, 0.0, 1.0],
        r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[focal, 0.0, u, 0.0, 0.0, focal, v, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def _set_place(pose: PoseMessage, visible: VisibleObject, pitch_rad: float) -> None:
    """Place and turn in the frame of a camera that looks down by an angle."""
    pose.position.x, pose.position.y, pose.position.z = visible.place_m
    half_yaw, half_pitch = 0.5 * visible.yaw_rad, -0.5 * pitch_rad
    turned = pose.orientation
    turned.x = math.sin(half_pitch) * math.sin(half_yaw)
    turned.y = math.sin(half_pitch) * math.cos(half_yaw)
    turned.z = math.cos(half_pitch) * math.sin(half_yaw)
    turned.w = math.cos(half_pitch) * math.cos(half_yaw)
