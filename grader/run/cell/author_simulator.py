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
from grader.run.cell.probe import Probe, import_interface
from grader.run.cell.signed_messages import Signed, SignedMessages
from grader.run.cell.simulated import Simulated
from grader.run.order import AuthorSimulatorOrder
from grader.spec.unit import format_duration
from sim.motion import Pose, Twist, wrap_angle

if TYPE_CHECKING:
    from grader.assignment.true_motion import TruthTopic

_FACTOR_WINDOW_S = 3.0
_SILENT_S, _SILENT_AT_END_S = 3.0, 1.0
_MOVED_M, _MOVED_RAD = 1e-3, 1e-2
FORGED = "forged_truth"


class TrackedRobot:
    """The robot of the simulator, as far as the end of a run depends on it."""

    def __init__(self) -> None:
        self.seen: list[Sighting] = []
        self.contacts: list[tuple[int, bool]] = []
        self.travelled_m = 0.0
        self._anchor: Pose | None = None
        self._moved_ns = 0
        self._contact_ns: int | None = None

    @property
    def at_rest_s(self) -> float:
        """Seconds since it last moved; 0 if it never has."""
        return (self.seen[-1].time_ns - self._moved_ns) / NS if self._moved_ns else 0.0

    @property
    def in_contact_s(self) -> float:
        """Seconds since the first contact; 0 before."""
        return 0.0 if self._contact_ns is None else (time.time_ns() - self._contact_ns) / NS

    def keep(self, sighting: Sighting) -> None:
        """Keep where it is."""
        if self.seen and sighting.time_ns <= self.seen[-1].time_ns:
            return
        self.seen.append(sighting)
        pose = sighting.pose
        self._anchor = self._anchor or pose
        way_m = math.hypot(pose.x_m - self._anchor.x_m, pose.y_m - self._anchor.y_m)
        turned_rad = abs(wrap_angle(pose.yaw_rad - self._anchor.yaw_rad))
        if way_m > _MOVED_M or turned_rad > _MOVED_RAD:
            self._anchor, self._moved_ns = pose, sighting.time_ns
            self.travelled_m += way_m

    def touch(self, time_ns: int, touches: bool) -> None:
        """Keep whether it touches something from then on."""
        self.contacts.append((time_ns, touches))
        if touches and self._contact_ns is None:
            self._contact_ns = time_ns


class AuthorSimulator(Simulated):
    """What the cell needs of a simulator, from one that is a program of the author's."""

    def __init__(self, probe: Probe, graph: GraphObserver, order: AuthorSimulatorOrder) -> None:
        self._probe, self._graph, self._order = probe, graph, order
        options = self._options = order.options
        wanted = {
            options.truth.topic: options.truth.type,
            **({options.clock: CLOCK} if options.clock else {}),
            **({options.contact: CONTACT} if options.contact else {}),
        }
        self._topics = {
            topic: SignedMessages(probe.node, topic, import_interface(type))
            for topic, type in wanted.items()
        }
        self._trusted = frozenset(self._topics)
        self._robot = TrackedRobot()
        self._began_ns = 0
        self._stop_ns = 0
        self._heard: set[str] = set()
        self._factor = RealTimeFactor(_FACTOR_WINDOW_S)

    @property
    def moving(self) -> tuple[TrackedRobot, ...]:
        """Its robot."""
        return (self._robot,)

    @property
    def name(self) -> str:
        """Of its program."""
        return self._order.name

    @property
    def within_s(self) -> float:
        """Longest time until it is ready."""
        return self._options.within

    def begin(self) -> None:
        """From now on the student's programs run: what comes counts."""
        self._began_ns = time.time_ns()
        self._robot.seen = self._robot.seen[-1:]
        self._factor = RealTimeFactor(_FACTOR_WINDOW_S)

    def stop(self) -> None:
        """The truth ends here."""
        self.look()
        self._stop_ns = time.time_ns()

    def look(self) -> None:
        """Take what it has published."""
        if self._stop_ns:
            return
        for topic, messages in self._topics.items():
            for one in messages.take():
                if self._graph.owner(one.gid) is Owner.COMPANION and self._keep(topic, one):
                    self._heard.add(topic)

    def lacks(self) -> str | None:
        """What has to be there before the student's programs start, and is not, or None."""
        ready = self._options.ready
        for topic in (self._options.truth.topic, self._options.clock):
            if topic and topic not in self._heard:
                of = "no message of its own"
                frame = self._options.truth.frame
                if frame and topic == self._options.truth.topic:
                    of += f" with the child frame {frame!r}"
                return f"there is {of} on {topic}"
        if ready.topic and not self._has_sent(ready.topic):
            return f"there is no message on {ready.topic}"
        if ready.node and ready.node not in {
            one.name for one in self._graph.nodes if one.owner is Owner.COMPANION
        }:
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
        silent_s = (now_ns - max(self._robot.seen[-1].time_ns, self._began_ns)) / NS
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
        return truth_of(self._robot.seen, list(self._commands()), self._robot.contacts)

    @property
    def incidents(self) -> tuple[Incident, ...]:
        """Nodes of the student's that publish where only the simulator is believed."""
        return tuple(
            Incident(one.appeared_ns, FORGED, f"{one.node} publishes on {one.topic}")
            for one in self._graph.endpoints
            if one.owner is Owner.STUDENT
            and one.kind is Kind.PUBLISHER
            and one.topic in self._trusted
        )

    @property
    def scenes(self) -> dict[str, Scene]:
        """The robot, and what is known of its world."""
        options, order = self._options, self._order
        world = read_scenario_world(Path(order.map), order.values) if order.map else None
        return {
            "": Scene(
                radius_m=options.radius,
                max_linear_m_s=options.max_speed,
                max_angular_rad_s=options.max_angular_speed,
                outlines={one.label: tuple(one.capsules) for one in world.shapes} if world else {},
                moving=(),
                began_ns=self._began_ns,
                command_topic=options.command.topic,
                odometry_topic=options.odometry.topic if options.odometry else "",
                scan_topic=options.scan.topic if options.scan else "",
                acceleration_m_s2=options.max_acceleration,
                lines=tuple(line.points for line in world.lines) if world else (),
            )
        }

    def _keep(self, topic: str, one: Signed) -> bool:
        """Keep a message; whether it says what it is for."""
        if topic == self._options.clock:
            self._factor.note(one.time_ns, _nanoseconds(one.value.clock))
        elif topic == self._options.contact:
            self._robot.touch(one.time_ns, one.value.data)
        elif topic == self._options.truth.topic:
            found = sighting_of(one, self._options.truth)
            if found is None:
                return False
            self._robot.keep(found)
        return True

    def _has_sent(self, topic: str) -> bool:
        """Whether it has published there; from now on that is watched."""
        if topic not in self._topics:
            for one in self._graph.endpoints:
                if one.topic == topic and one.kind is Kind.PUBLISHER:
                    kind = import_interface(one.type)
                    self._topics[topic] = SignedMessages(self._probe.node, topic, kind)
                    break
        return topic in self._heard

    def _commands(self) -> Iterator[tuple[int, Twist]]:
        """What was commanded from when on."""
        command = self._options.command
        for one in self._probe.messages:
            if one.topic == command.topic and not one.join:
                value = deserialize_message(one.cdr, import_interface(command.type))
                value = getattr(value, "twist", value)
                twist = Twist(value.linear.x, value.angular.z)
                if twist.is_finite:
                    yield one.received_ns, twist


def sighting_of(one: Signed, truth: TruthTopic) -> Sighting | None:
    """The pose in a message, or None where it has none of the robot."""
    value, stamp = one.value, None
    if truth.frame is not None:
        of_robot = (t for t in value.transforms if t.child_frame_id == truth.frame)
        value = next(of_robot, None)
        if value is None:
            return None
    if hasattr(value, "header"):
        stamp = _nanoseconds(value.header.stamp)
    for part in ("pose", "pose", "transform"):
        value = getattr(value, part, value)
    place = getattr(value, "position", None) or value.translation
    turn = getattr(value, "orientation", None) or value.rotation
    yaw_rad = math.atan2(
        2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2)
    )
    pose = Pose(place.x, place.y, yaw_rad)
    if not all(map(math.isfinite, (pose.x_m, pose.y_m, yaw_rad))):
        return None
    return Sighting(one.time_ns, stamp or one.time_ns, pose)


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * NS + int(stamp.nanosec)
