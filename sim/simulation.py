"""The simulation: one robot in one world, step by step, without ROS and without a clock.

The same world, options, seed and commands give the same steps, bit by bit.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from sim.contact import ContactFinder
from sim.description import LidarOptions, OdometryOptions, SimulatorOptions
from sim.lidar import Lidar, Scan
from sim.motion import NS, REST, Pose, Twist, integrate
from sim.odometry import OdometrySample, WheelOdometry
from sim.robot import Robot, State, make_robot, velocity
from sim.schedule import Schedule
from sim.world import World

STEP_NS = 10_000_000
"""Length of a step: 100 Hz."""
STEP_S = STEP_NS / NS


class EventKind(str, Enum):
    """Something worth a line in a recording."""

    CONTACT_BEGAN = "contact_began"
    CONTACT_ENDED = "contact_ended"
    COMMAND_REJECTED = "command_rejected"
    """A command was NaN or infinite; the robot is commanded to stop instead."""
    COMMAND_TIMEOUT = "command_timeout"
    """No command came for the robot's ``command_timeout``; it is commanded to stop."""
    PUSHED = "pushed"
    """A push began that moves the robot besides its wheels."""


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
        pose: True pose in the world's frame.
        twist: True velocity at its end, in the robot's frame.
        command: What was asked for, before any limit; zero after a rejected command.
        contact: What the robot touches, such as ``boxes[2]``, or None.
        scan: The scan that was taken at its end, or None if none was due.
        odometry: The odometry at its end, or None if none was due.
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


@dataclass(frozen=True, slots=True)
class Sensors:
    """The sensors of a simulation."""

    lidar: LidarOptions = field(default_factory=LidarOptions)
    odometry: OdometryOptions = field(default_factory=OdometryOptions)


class Simulation:
    """The stepping core."""

    def __init__(self, world: World, robot: Robot, sensors: Sensors, seed: int = 0) -> None:
        """Begin at simulated time 0, at rest.

        Args:
            seed: Of the noise of the LiDAR and the drift of odometry, which are drawn
                independently of each other.
        """
        self.world, self.robot, self.sensors, self.seed = world, robot, sensors, seed
        self.lidar = Lidar(world, sensors.lidar)
        lidar_seed, odometry_seed = np.random.SeedSequence(seed).spawn(2)
        self._noise = np.random.default_rng(lidar_seed)
        self._odometry = WheelOdometry(
            sensors.odometry,
            robot.start,
            robot.model.wheel_separation_m,
            np.random.default_rng(odometry_seed),
        )
        self._contacts = ContactFinder(world, robot.model.radius_m)
        self._scans = _schedule(sensors.lidar)
        self._samples = _schedule(sensors.odometry)
        self._drives = deque(robot.drives)
        self._pushes = deque(robot.pushes)
        self._pushed: tuple[int, Twist] = (0, REST)
        self._way_m = 0.0
        self._index = 0
        self._state = State(robot.start)
        self._motion = REST
        self._command = REST
        self._commanded_ns: int | None = None
        self._contact: str | None = None

    @property
    def time_ns(self) -> int:
        """Simulated time."""
        return self._index * STEP_NS

    @property
    def pose(self) -> Pose:
        """True pose now."""
        return self._state.pose

    @property
    def next_output_ns(self) -> int | None:
        """Simulated time of the next step that brings data of a sensor, or None without one."""
        times = [schedule.next_ns(STEP_NS) for schedule in (self._scans, self._samples) if schedule]
        return min(times, default=None)

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
        if self._drives and self._drives[0][0] <= self.time_ns:
            command = command or self._drives[0][1]
            self._drives.popleft()
        if command is not None or self._command is not REST:
            self._obey(command, events)
        self._index += 1
        time_ns = self._index * STEP_NS
        contact = self._move(time_ns, self._push(time_ns, events))
        if contact != self._contact:
            if self._contact is not None:
                events.append(Event(EventKind.CONTACT_ENDED, self._contact))
            if contact is not None:
                events.append(Event(EventKind.CONTACT_BEGAN, contact))
            self._contact = contact
        state = self._state
        scan = sample = None
        if self._scans is not None and self._scans.is_due(time_ns):
            scan = self.lidar.scan(state.pose, time_ns, self._noise)
        if self._samples is not None and self._samples.is_due(time_ns):
            sample = self._odometry.sample(time_ns, state.pose, self._motion)
        return Step(
            self._index,
            time_ns,
            state.pose,
            self._motion,
            self._command,
            contact,
            tuple(events),
            scan,
            sample,
        )

    def _obey(self, command: Twist | None, events: list[Event]) -> None:
        now_ns = self._index * STEP_NS
        if command is not None:
            self._commanded_ns = now_ns
            if command.is_finite:
                self._command = command
            else:
                self._command = REST
                text = f"linear {command.linear_m_s}, angular {command.angular_rad_s}"
                events.append(Event(EventKind.COMMAND_REJECTED, text))
            return
        timeout_ns = self.robot.command_timeout_ns
        if (
            timeout_ns is not None
            and self._commanded_ns is not None
            and now_ns - self._commanded_ns >= timeout_ns
        ):
            self._commanded_ns = None
            self._command = REST
            events.append(Event(EventKind.COMMAND_TIMEOUT, f"none for {timeout_ns / NS:g} s"))

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
        state = self._state
        wheels = velocity(state.twist, self._command, STEP_S, self.robot.model.limits)
        twist = wheels + push
        linear_m_s, angular_rad_s = twist.linear_m_s, twist.angular_rad_s
        pose = state.pose
        contact = self._contacts.find(pose, linear_m_s, angular_rad_s, STEP_S, time_ns)
        self._motion = twist
        if twist == REST:
            if state.twist != wheels:
                self._state = State(pose, wheels)
            return contact.label
        if contact.share < 1.0:
            # Turning goes on: a circle can turn where it touches.
            wheels = Twist(0.0, wheels.angular_rad_s)
            self._motion = Twist(0.0, angular_rad_s)
            reached = pose
            if contact.share > 0.0:
                reached = integrate(pose, linear_m_s, angular_rad_s, STEP_S * contact.share)
            turned = integrate(pose, 0.0, angular_rad_s, STEP_S)
            self._state = State(Pose(reached.x_m, reached.y_m, turned.yaw_rad), wheels)
        else:
            self._state = State(integrate(pose, linear_m_s, angular_rad_s, STEP_S), wheels)
        way_m = linear_m_s * STEP_S * contact.share
        self._way_m += abs(way_m)
        self._odometry.move(way_m, angular_rad_s * STEP_S)
        return contact.label


def make_simulation(world: World, options: SimulatorOptions, seed: int = 0) -> Simulation:
    """Put together what the YAML describes.

    Raises:
        AssignmentError: The robot would start inside a wall.
    """
    robot = make_robot(options.robot, options.start(world.start))
    world.check_start(robot.start, robot.model.radius_m)
    return Simulation(world, robot, Sensors(options.lidar, options.odometry), seed)


def _schedule(options: LidarOptions | OdometryOptions) -> Schedule | None:
    if not options.enabled:
        return None
    stops_ns = None if options.stops is None else round(options.stops * NS)
    return Schedule(options.rate, round(options.starts * NS), stops_ns)
