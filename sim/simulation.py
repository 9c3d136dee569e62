"""The simulation: a robot in its world, step by step, without ROS and without a clock.

The same world, options, seed and commands give the same steps, bit by bit. Several robots are
several simulations in one world, each of which does its step in turn.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from typing import Any

import numpy as np

from sim.camera import Camera
from sim.contact import ContactFinder
from sim.description import LidarOptions, OdometryOptions, SimulatorOptions
from sim.lidar import Lidar, Scan
from sim.motion import NS, REST, Pose, Twist, integrate
from sim.odometry import OdometrySample, WheelOdometry
from sim.robot import next_velocity, others, robot_model, starting
from sim.sensors import Sensor, sensors_of
from sim.shapes import Body
from sim.topic_options import Timed
from sim.world import World

STEP_NS = 10_000_000
"""Length of a step: 100 Hz."""
STEP_S = STEP_NS / NS


class EventKind(str, Enum):
    """Something worth a line in a recording; after either of a command the robot stops."""

    CONTACT_BEGAN = "contact_began"
    CONTACT_ENDED = "contact_ended"
    COMMAND_REJECTED = "command_rejected"
    COMMAND_TIMEOUT = "command_timeout"
    PUSHED = "pushed"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened in a step."""

    kind: EventKind
    text: str


@dataclass(frozen=True, slots=True)
class Step:
    """The ground truth after one step.

    Attributes:
        index: Number of the step, from 1.
        time_ns: Simulated time at its end: ``index * STEP_NS``.
        pose: In the world's frame.
        command: What was asked for, before any limit; zero after a rejected command.
        contact: What the robot touches, such as ``boxes[2]``, or None.
        readings: Of the other sensors, those that are due.
        is_pictured: Whether a picture of the camera is due. It is made only where somebody
            subscribes, since that takes time and changes nothing in the simulation.
    """

    index: int
    time_ns: int
    pose: Pose
    twist: Twist
    command: Twist
    contact: str | None
    events: tuple[Event, ...] = ()
    scan: Scan | None = None
    odometry: OdometrySample | None = None
    readings: tuple[tuple[Sensor, Any], ...] = ()
    is_pictured: bool = False


class Schedule:
    """When the data of a sensor are due.

    The k-th time (from 1) is ``k / rate`` exactly, as a fraction: 30 Hz on steps of 10 ms comes
    after 40, 30, 30, 40, ... ms, 300 times in every 10 s.
    """

    def __init__(self, options: LidarOptions | OdometryOptions | Timed) -> None:
        """Begin at simulated time 0."""
        rate = Fraction(options.rate).limit_denominator(1_000_000)
        # Whole numbers are computed with several times as fast as fractions.
        self._times, self._in_ns = rate.numerator, rate.denominator * NS
        self._starts_ns = round(options.starts * NS)
        self._stops_ns = math.inf if options.stops is None else round(options.stops * NS)
        self._plan(1)

    def _plan(self, number: int) -> None:
        self.next_ns = -(-number * self._in_ns // (self._times * STEP_NS)) * STEP_NS
        """End of the step at which it will be due."""

    def is_due(self, time_ns: int) -> bool:
        """Whether it is due at the end of a step; times must increase."""
        if time_ns < self.next_ns:
            return False
        self._plan(time_ns * self._times // self._in_ns + 1)
        return self._starts_ns <= time_ns < self._stops_ns


class Simulation:
    """The stepping core, with the true pose of its robot."""

    def __init__(
        self,
        world: World,
        options: SimulatorOptions,
        seed: tuple[int, ...],
        body: Body,
    ) -> None:
        """Begin at simulated time 0, at rest.

        Args:
            body: Its footprint, by which others know where it is.
            seed: Of the noise of the LiDAR, the drift of odometry and the noise of the camera,
                which are drawn independently of each other.
        """
        self.world, self.options = world, options
        self.model = robot_model(options.robot)
        self.lidar = Lidar(world, options.lidar)
        self.camera = Camera(world, options.camera, seed) if options.camera else None
        self.body = body
        lidar_seed, odometry_seed, *seeds = np.random.SeedSequence(seed).spawn(
            3 + len(options.ranges)
        )
        self._noise = np.random.default_rng(lidar_seed)
        self._odometry = WheelOdometry(
            options.odometry,
            self.pose,
            self.model.wheel_separation_m,
            np.random.default_rng(odometry_seed),
        )
        self._contacts = ContactFinder(world, self.model.radius_m)
        self._scans = Schedule(options.lidar) if options.lidar.enabled else None
        self._samples = Schedule(options.odometry) if options.odometry.enabled else None
        sensors = sensors_of(world, options, self.model.wheel_separation_m, seeds)
        self.sensors = {sensor: Schedule(sensor.options) for sensor in sensors}
        self._pictures = Schedule(options.camera) if options.camera else None
        self._drives = deque(sorted(options.robot.drives, key=lambda drive: drive.at))
        self._pushes = deque(sorted(options.robot.pushes, key=lambda push: push.after))
        self._pushed: tuple[int, Twist] = (0, REST)
        self._way_m = 0.0
        self._index = 0
        self._wheels = REST
        self._motion = REST
        self._command = REST
        self._commanded_ns: int | None = None
        self._contact: str | None = None

    @property
    def pose(self) -> Pose:
        """Where the robot is, in the world's frame."""
        return self.body.pose

    @property
    def time_ns(self) -> int:
        """Simulated time."""
        return self._index * STEP_NS

    def next_output_ns(
        self,
        *,
        scans: bool = True,
        odometry: bool = True,
        pictures: bool = True,
        others: Iterable[Sensor] = (),
    ) -> int | None:
        """Simulated time of the next step that brings data of these sensors, or None for never."""
        wanted = [scans and self._scans, odometry and self._samples, pictures and self._pictures]
        wanted += [self.sensors[one] for one in others]
        return min((one.next_ns for one in wanted if one), default=None)

    def advance(self, command: Twist | None = None) -> Step:
        """Simulate one step of 10 ms.

        A command with NaN or infinity is rejected, and the robot is commanded to stop. Gazebo
        is no model here: its DiffDrive (gz-sim, SpeedLimiter of gz-math) passes NaN on to the
        wheels and never recovers. Keeping the last command instead would let a broken
        controller drive on blindly, which is harder to notice than a robot that stops.

        Args:
            command: A command that arrived since the last step, or None. It holds until the
                next, unless the robot has a command timeout.
        """
        events: list[Event] = []
        if self._drives and round(self._drives[0].at * NS) <= self.time_ns:
            drive = self._drives.popleft()
            command = command or Twist(drive.linear, drive.angular)
        self._obey(command, events)
        self._index += 1
        time_ns = self.time_ns
        contact = self._move(time_ns, self._push(time_ns, events))
        if contact != self._contact:
            if self._contact is not None:
                events.append(Event(EventKind.CONTACT_ENDED, self._contact))
            if contact is not None:
                events.append(Event(EventKind.CONTACT_BEGAN, contact))
            self._contact = contact
        scan = sample = None
        if self._scans is not None and self._scans.is_due(time_ns):
            scan = self.lidar.scan(self.pose, time_ns, self._noise)
        if self._samples is not None and self._samples.is_due(time_ns):
            sample = self._odometry.sample(time_ns, self.pose, self._motion)
        for sensor in self.sensors:
            sensor.take_part(self._motion, STEP_S)
        due = tuple(one for one, schedule in self.sensors.items() if schedule.is_due(time_ns))
        is_pictured = self._pictures is not None and self._pictures.is_due(time_ns)
        return Step(
            self._index,
            time_ns,
            self.pose,
            self._motion,
            self._command,
            contact,
            tuple(events),
            scan,
            sample,
            tuple((one, one.read(self.pose, time_ns)) for one in due),
            is_pictured,
        )

    def _obey(self, command: Twist | None, events: list[Event]) -> None:
        timeout_s = self.options.robot.command_timeout
        if command is not None and command.is_finite:
            self._command, self._commanded_ns = command, self.time_ns
        elif command is not None:
            self._command, self._commanded_ns = REST, None
            text = f"linear {command.linear_m_s}, angular {command.angular_rad_s}"
            events.append(Event(EventKind.COMMAND_REJECTED, text))
        elif (
            timeout_s is not None
            and self._commanded_ns is not None
            and self.time_ns - self._commanded_ns >= round(timeout_s * NS)
        ):
            self._command, self._commanded_ns = REST, None
            events.append(Event(EventKind.COMMAND_TIMEOUT, f"none for {timeout_s:g} s"))

    def _push(self, time_ns: int, events: list[Event]) -> Twist:
        """The velocity that a push adds in the step that ends at a time."""
        if self._pushes and self._way_m >= self._pushes[0].after:
            push = self._pushes.popleft()
            twist = Twist(push.ahead / push.lasts, push.turn / push.lasts)
            self._pushed = (time_ns + round(push.lasts * NS), twist)
            text = f"{push.ahead:g} m ahead, {math.degrees(push.turn):g} degrees to the left"
            events.append(Event(EventKind.PUSHED, text))
        until_ns, twist = self._pushed
        return twist if time_ns < until_ns else REST

    def _move(self, time_ns: int, push: Twist) -> str | None:
        """Move along an exact arc: the velocity is constant within a step."""
        self._wheels = next_velocity(self._wheels, self._command, STEP_S, self.model.limits)
        self._motion = self._wheels + push
        pose, linear, angular = self.pose, self._motion.linear_m_s, self._motion.angular_rad_s
        contact = self._contacts.find(pose, linear, angular, STEP_S, time_ns)
        if self._motion == REST:
            return contact.label
        self.body.pose = integrate(pose, linear, angular, STEP_S)
        if contact.share < 1.0:
            # Turning goes on: a circle can turn where it touches.
            self._wheels = Twist(0.0, self._wheels.angular_rad_s)
            self._motion = Twist(0.0, angular)
            reached = integrate(pose, linear, angular, STEP_S * contact.share)
            self.body.pose = Pose(reached.x_m, reached.y_m, self.pose.yaw_rad)
        way_m = linear * STEP_S * contact.share
        self._way_m += abs(way_m)
        self._odometry.move(way_m, angular * STEP_S)
        return contact.label


def make_simulations(
    world: World, robots: Mapping[str, SimulatorOptions], seed: int = 0
) -> dict[str, Simulation]:
    """Put together what the YAML describes; a robot inside a wall or another one is refused."""
    found = {}
    bodies = starting(world, robots)
    for number, (name, options) in enumerate(robots.items()):
        around = replace(world, bodies=others(bodies, name))
        found[name] = Simulation(around, options, (seed, number), bodies[name])
    return found


def make_simulation(world: World, options: SimulatorOptions, seed: int = 0) -> Simulation:
    """The same for a robot that is alone."""
    return make_simulations(world, {"": options}, seed)[""]
