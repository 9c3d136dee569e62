"""A simulator of the author's in a cell: watches it, and keeps the truth that it publishes.

Only what participants of the author's publish counts, so that no student can say where the robot
is. How the program is started and stopped is the same as for other programs of the author's.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rclpy.serialization import deserialize_message

from grader.assignment.simulation import read_scenario_world
from grader.assignment.true_motion import CLOCK, CONTACT
from grader.recording.model import NS, Kind, Owner
from grader.recording.simulated import Incident, Scene, Truth
from grader.recording.tracked import RealTimeFactor, Sighting, truth_of
from grader.run.cell.graph import GraphObserver
from grader.run.cell.interfaces import import_interface
from grader.run.cell.probe import Probe
from grader.run.cell.signed_messages import Signed, SignedMessages
from grader.run.cell.simulated import Simulated
from grader.run.order import AuthorSimulatorOrder
from grader.spec.unit import format_duration
from sim.motion import Pose, Twist, wrap_angle

if TYPE_CHECKING:
    from grader.assignment.true_motion import TruthTopic
    from sim.shapes import Capsule

_FACTOR_WINDOW_S = 3.0
"""The speed of simulated time is a mean over this window: shorter ones show pauses of the host."""
_SILENT_S, _SILENT_AT_END_S = 3.0, 1.0
"""A simulator without a pose for so long is at fault, while it runs and when the run ends."""
_MOVED_M, _MOVED_RAD = 1e-3, 1e-2
"""Smaller differences of the pose are the jitter of a simulator's physics, and not motion."""
FORGED = "forged_truth"


class TrackedRobot:
    """The robot of the simulator, as far as the end of a run depends on it.

    Attributes:
        sightings: Its poses, oldest first.
        contacts: Times, and whether it touches something from then on.
    """

    def __init__(self) -> None:
        self.sightings: list[Sighting] = []
        self.contacts: list[tuple[int, bool]] = []
        self.travelled_m = 0.0
        self._last_moved_pose: Pose | None = None
        self._last_moved_ns = 0
        self._first_contact_ns: int | None = None

    @property
    def at_rest_s(self) -> float:
        """Seconds since it last moved; 0 if it never has."""
        if not self._last_moved_ns:
            return 0.0
        return (self.sightings[-1].time_ns - self._last_moved_ns) / NS

    @property
    def in_contact_s(self) -> float:
        """Seconds since the first contact; 0 before."""
        if self._first_contact_ns is None:
            return 0.0
        return (time.time_ns() - self._first_contact_ns) / NS

    def add_sighting(self, sighting: Sighting) -> None:
        """Keep a pose that is newer than all before it, and note whether the robot has moved."""
        if self.sightings and sighting.time_ns <= self.sightings[-1].time_ns:
            return
        self.sightings.append(sighting)
        pose, last = sighting.pose, self._last_moved_pose
        if last is None:
            self._last_moved_pose = pose
            return
        distance_m = math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m)
        if distance_m > _MOVED_M or abs(wrap_angle(pose.yaw_rad - last.yaw_rad)) > _MOVED_RAD:
            self._last_moved_pose, self._last_moved_ns = pose, sighting.time_ns
            self.travelled_m += distance_m

    def add_contact(self, time_ns: int, touches: bool) -> None:
        """Keep whether it touches something from then on."""
        self.contacts.append((time_ns, touches))
        if touches and self._first_contact_ns is None:
            self._first_contact_ns = time_ns


class AuthorSimulator(Simulated):
    """What the cell needs of a simulator, from one that is a program of the author's."""

    def __init__(self, probe: Probe, graph: GraphObserver, order: AuthorSimulatorOrder) -> None:
        self._probe, self._graph, self._order = probe, graph, order
        options = self._options = order.options
        types: dict[str, str] = {options.truth.topic: options.truth.type}
        if options.clock:
            types[options.clock] = CLOCK
        if options.contact:
            types[options.contact] = CONTACT
        self._subscriptions = {
            topic: SignedMessages(probe.node, topic, import_interface(type))
            for topic, type in types.items()
        }
        self._truth_topics = frozenset(types)
        self._robot = TrackedRobot()
        self._began_ns = 0
        self._stop_ns = 0
        self._topics_with_messages: set[str] = set()
        self._factor = RealTimeFactor(_FACTOR_WINDOW_S)

    @property
    def moving(self) -> tuple[TrackedRobot, ...]:
        """Its robot."""
        return (self._robot,)

    @property
    def name(self) -> str:
        """Name of its program."""
        return self._order.name

    @property
    def within_s(self) -> float:
        """Longest time until it is ready."""
        return self._options.within

    def begin(self) -> None:
        """The student's programs start now: of what came before, only the last pose counts."""
        self._began_ns = time.time_ns()
        self._robot.sightings = self._robot.sightings[-1:]
        self._factor = RealTimeFactor(_FACTOR_WINDOW_S)

    def stop(self) -> None:
        """The truth ends here."""
        self.look()
        self._stop_ns = time.time_ns()

    def look(self) -> None:
        """Take what it has published."""
        if self._stop_ns:
            return
        for topic, subscription in self._subscriptions.items():
            for message in subscription.take():
                is_own = self._graph.owner(message.gid) is Owner.COMPANION
                if is_own and self._keep(topic, message):
                    self._topics_with_messages.add(topic)

    def lacks(self) -> str | None:
        """What has to be there before the student's programs start, and is not, or None."""
        truth, clock, ready = self._options.truth, self._options.clock, self._options.ready
        if truth.topic not in self._topics_with_messages:
            frame = f" with the child frame {truth.frame!r}" if truth.frame else ""
            return f"there is no message of its own{frame} on {truth.topic}"
        if clock and clock not in self._topics_with_messages:
            return f"there is no message of its own on {clock}"
        if ready.topic and not self._has_published_on(ready.topic):
            return f"there is no message on {ready.topic}"
        if ready.node:
            own_nodes = {n.name for n in self._graph.nodes if n.owner is Owner.COMPANION}
            if ready.node not in own_nodes:
                return f"there is no node {ready.node} of its own"
        if ready.service:
            services = self._probe.node.get_service_names_and_types()
            if ready.service not in {name for name, _ in services}:
                return f"there is no service {ready.service}"
        return None

    def faults(self) -> Iterator[str]:
        """What went wrong with it while the student's programs ran, one sentence each."""
        if not self._began_ns:
            return
        now_ns = self._stop_ns or time.time_ns()
        silent_s = (now_ns - max(self._robot.sightings[-1].time_ns, self._began_ns)) / NS
        limit_s = _SILENT_AT_END_S if self._stop_ns else _SILENT_S
        if silent_s > limit_s:
            limit = format_duration(limit_s)
            topic = self._options.truth.topic
            yield f"the simulator {self.name} has published nothing on {topic} for {limit}"
        factor = self._factor.now(now_ns)
        if factor is not None and factor < self._options.slowest:
            yield (
                f"the simulator {self.name} ran at {factor:.2f} of real time, slower than "
                f"{self._options.slowest:g}: this machine is too busy or too slow for it"
            )

    @property
    def truth(self) -> tuple[Truth, ...]:
        """Every step so far, oldest first."""
        return truth_of(self._robot.sightings, list(self._commands()), self._robot.contacts)

    @property
    def incidents(self) -> tuple[Incident, ...]:
        """Publishers of the student's on topics where only the simulator is believed."""
        return tuple(
            Incident(item.appeared_ns, FORGED, f"{item.node} publishes on {item.topic}")
            for item in self._graph.endpoints
            if item.owner is Owner.STUDENT
            and item.kind is Kind.PUBLISHER
            and item.topic in self._truth_topics
        )

    @property
    def scenes(self) -> dict[str, Scene]:
        """The robot, and what is known of its world."""
        options, order = self._options, self._order
        outlines: dict[str, tuple[Capsule, ...]] = {}
        lines: tuple[tuple[tuple[float, float], ...], ...] = ()
        if order.map:
            world = read_scenario_world(Path(order.map), order.values)
            outlines = {shape.label: tuple(shape.capsules) for shape in world.shapes}
            lines = tuple(line.points for line in world.lines)
        return {
            "": Scene(
                radius_m=options.radius,
                max_linear_m_s=options.max_speed,
                max_angular_rad_s=options.max_angular_speed,
                outlines=outlines,
                moving=(),
                began_ns=self._began_ns,
                command_topic=options.command.topic,
                odometry_topic=options.odometry.topic if options.odometry else "",
                scan_topic=options.scan.topic if options.scan else "",
                acceleration_m_s2=options.max_acceleration,
                lines=lines,
            )
        }

    def _keep(self, topic: str, message: Signed) -> bool:
        """Keep a message; False if it is on the topic of the truth and has no pose of the robot."""
        if topic == self._options.clock:
            self._factor.note(message.time_ns, _nanoseconds(message.value.clock))
        elif topic == self._options.contact:
            self._robot.add_contact(message.time_ns, message.value.data)
        elif topic == self._options.truth.topic:
            sighting = sighting_of(message, self._options.truth)
            if sighting is None:
                return False
            self._robot.add_sighting(sighting)
        return True

    def _has_published_on(self, topic: str) -> bool:
        """Whether it has published there; the first such question subscribes to the topic."""
        if topic not in self._subscriptions:
            for endpoint in self._graph.endpoints:
                if endpoint.topic == topic and endpoint.kind is Kind.PUBLISHER:
                    interface = import_interface(endpoint.type)
                    self._subscriptions[topic] = SignedMessages(self._probe.node, topic, interface)
                    break
        return topic in self._topics_with_messages

    def _commands(self) -> Iterator[tuple[int, Twist]]:
        """Times, and the velocity that is commanded from then on."""
        command = self._options.command
        interface = import_interface(command.type)
        for message in self._probe.messages:
            # What late joiners hear was recorded before.
            if message.topic != command.topic or message.join:
                continue
            value = deserialize_message(message.cdr, interface)
            # A TwistStamped holds the Twist.
            value = getattr(value, "twist", value)
            twist = Twist(value.linear.x, value.angular.z)
            if twist.is_finite:
                yield message.received_ns, twist


def sighting_of(message: Signed, truth: TruthTopic) -> Sighting | None:
    """The pose in a message, or None where it has none of the robot."""
    value = message.value
    if truth.frame is not None:
        of_robot = (t for t in value.transforms if t.child_frame_id == truth.frame)
        value = next(of_robot, None)
        if value is None:
            return None
    stamp_ns = _nanoseconds(value.header.stamp) if hasattr(value, "header") else 0
    # An Odometry has pose.pose, a PoseStamped pose, a TransformStamped transform, a Pose none.
    for part in ("pose", "pose", "transform"):
        value = getattr(value, part, value)
    if hasattr(value, "position"):
        position, rotation = value.position, value.orientation
    else:
        position, rotation = value.translation, value.rotation
    x, y, z, w = rotation.x, rotation.y, rotation.z, rotation.w
    yaw_rad = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2))
    pose = Pose(position.x, position.y, yaw_rad)
    if not all(map(math.isfinite, (pose.x_m, pose.y_m, yaw_rad))):
        return None
    return Sighting(message.time_ns, stamp_ns or message.time_ns, pose)


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * NS + int(stamp.nanosec)
