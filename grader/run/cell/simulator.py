"""The simulated robot of a cell: runs the simulator and keeps its ground truth.

The truth comes from the simulator's memory and never from a topic that a student could fake.
"""

from __future__ import annotations

import math
import threading
from pathlib import Path

from rclpy.node import Node

from grader.assignment.simulation import read_scenario_world
from grader.recording.model import NS
from grader.recording.simulated import Incident, Scene, Truth
from grader.run.order import SimulatorOrder
from sim.description import SimulatorOptions
from sim.motion import Pose, Twist
from sim.node import RosSimulator
from sim.pacing import Lateness
from sim.simulation import Simulation, Step, make_simulation
from sim.world_model import WorldModel

# By itself pydantic makes what validates a model when it is first used: in each cell, instead of
# once in the process that cells are forked from.
for _model in (SimulatorOptions, WorldModel):
    _model.model_rebuild()

_REST_M_S = 1e-3
_REST_RAD_S = 1e-3
# Drifting odometry and noise never move the robot; this is motion that was commanded.
_MOVED_M = 1e-3
_MOVED_RAD = 1e-2


class SimulatedRobot:
    """A robot in its world, driven by what the student publishes; keeps every step so far."""

    def __init__(self, node: Node, order: SimulatorOrder) -> None:
        options = self._options = SimulatorOptions.model_validate_json(order.options)
        self._world = read_scenario_world(Path(order.world), order.values)
        self._simulation: Simulation = make_simulation(self._world, options, order.seed)
        self._ros = RosSimulator(node, self._simulation, self, recorders=1)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._ros.run, args=(self._stop,), daemon=True)
        self._start = self._simulation.pose
        self.truth: list[Truth] = []
        self.incidents: list[Incident] = []
        self._stamp_ns = 0
        self._began_ns = 0
        self.travelled_m = 0.0
        self._has_moved = False
        self._rest_since_ns = 0
        self._contact_ns: int | None = None

    def start(self) -> None:
        """Let simulated time run, in a thread of its own."""
        self._thread.start()

    def stop(self) -> None:
        """Stop simulated time; the truth ends here."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    @property
    def pose(self) -> Pose:
        """Where it is."""
        now = self.truth[-1] if self.truth else None
        return Pose(now.x_m, now.y_m, now.yaw_rad) if now else self._start

    def drive(self, twist: Twist) -> None:
        """Command it from here, and not by a topic that the student publishes on too."""
        self._ros.drive(twist)

    @property
    def at_rest_s(self) -> float:
        """Simulated seconds at rest since it last moved; 0 while it moves or has never moved."""
        return (self._stamp_ns - self._rest_since_ns) / NS if self._rest_since_ns else 0.0

    @property
    def in_contact_s(self) -> float:
        """Simulated seconds since the first contact; 0 before."""
        return 0.0 if self._contact_ns is None else (self._stamp_ns - self._contact_ns) / NS

    def scene(self) -> Scene:
        """World and robot."""
        robot = self._simulation.model
        return Scene(
            radius_m=robot.radius_m,
            max_linear_m_s=robot.limits.speed_m_s,
            max_angular_rad_s=robot.limits.angular_speed_rad_s,
            outlines={shape.label: tuple(shape.capsules) for shape in self._world.shapes},
            moving=self._world.moving,
            began_ns=self._began_ns,
            lidar=self._options.lidar.pose,
            command_topic=self._options.topics.command.topic,
            odometry_topic=self._options.topics.odometry.topic,
            scan_topic=self._options.topics.scan.topic,
            acceleration_m_s2=robot.limits.acceleration_m_s2,
        )

    def on_step(self, step: Step, stamp_ns: int) -> None:
        """Keep the truth; called by the simulator."""
        if not self._began_ns:
            self._began_ns = stamp_ns - step.time_ns
        self._follow(step, stamp_ns)
        self._stamp_ns = stamp_ns
        pose, twist, command = step.pose, step.twist, step.command
        self.truth.append(
            Truth(
                *(stamp_ns, pose.x_m, pose.y_m, pose.yaw_rad),
                *(twist.linear_m_s, twist.angular_rad_s),
                *(command.linear_m_s, command.angular_rad_s),
                step.contact,
            )
        )
        for event in step.events:
            self.incidents.append(Incident(stamp_ns, event.kind.value, event.text))

    def on_late(self, lateness: Lateness) -> None:
        """Note steps that are late because of the host; called by the simulator."""
        late_ms = lateness.late_ns / 1e6
        text = f"{lateness.steps} steps done {late_ms:.0f} ms late"
        self.incidents.append(Incident(self._stamp_ns, "late", text, lateness.late_ns / NS))

    def _follow(self, step: Step, stamp_ns: int) -> None:
        if self.truth:
            before = self.truth[-1]
            self.travelled_m += math.hypot(step.pose.x_m - before.x_m, step.pose.y_m - before.y_m)
        turned_rad = abs(math.remainder(step.pose.yaw_rad - self._start.yaw_rad, math.tau))
        self._has_moved |= self.travelled_m > _MOVED_M or turned_rad > _MOVED_RAD
        resting = (
            abs(step.twist.linear_m_s) < _REST_M_S and abs(step.twist.angular_rad_s) < _REST_RAD_S
        )
        if not resting or not self._has_moved:
            self._rest_since_ns = 0
        elif not self._rest_since_ns:
            self._rest_since_ns = stamp_ns
        if step.contact is not None and self._contact_ns is None:
            self._contact_ns = stamp_ns
