"""The simulated robots of a cell: runs the simulator and keeps its ground truth.

The truth comes from the simulator's memory and never from a topic that a student could fake.
"""

from __future__ import annotations

import math
from itertools import chain
from operator import attrgetter
from pathlib import Path

from rclpy.node import Node

from grader.assignment.simulation import read_scenario_world
from grader.recording.model import NS
from grader.recording.simulated import Filmed, Incident, Scene, Truth
from grader.run.cell.simulated import Simulated
from grader.run.order import SimulatorOrder
from sim.description import RobotOptions, SimulatorOptions
from sim.motion import Pose, Twist
from sim.node import RosSimulator
from sim.pacing import Lateness
from sim.simulation import Simulation, Step, make_simulations
from sim.world import World
from sim.world_model import WorldModel

# By itself pydantic makes what validates a model when it is first used: in each cell, instead of
# once in the process that cells are forked from.
for _model in (SimulatorOptions, RobotOptions, WorldModel):
    _model.model_rebuild()

_REST_M_S = 1e-3
_REST_RAD_S = 1e-3
# Drifting odometry and noise never move the robot; this is motion that was commanded.
_MOVED_M = 1e-3
_MOVED_RAD = 1e-2


class SimulatedRobot:
    """One robot of a run: every step so far, and what the end of the run depends on."""

    def __init__(self, name: str, simulation: Simulation, ros: RosSimulator) -> None:
        self._name, self._simulation, self._ros = name, simulation, ros
        self._start = simulation.pose
        self.truth: list[Truth] = []
        self.incidents: list[Incident] = []
        self._stamp_ns = 0
        self.began_ns = 0
        self.travelled_m = 0.0
        self._has_moved = False
        self._rest_since_ns = 0
        self._contact_ns: int | None = None

    @property
    def pose(self) -> Pose:
        """Where it is."""
        now = self.truth[-1] if self.truth else None
        return Pose(now.x_m, now.y_m, now.yaw_rad) if now else self._start

    def drive(self, twist: Twist) -> None:
        """Command it from here, and not by a topic that the student publishes on too."""
        self._ros.drive(twist, self._name)

    @property
    def at_rest_s(self) -> float:
        """Simulated seconds at rest since it last moved; 0 while it moves or has never moved."""
        return (self._stamp_ns - self._rest_since_ns) / NS if self._rest_since_ns else 0.0

    @property
    def in_contact_s(self) -> float:
        """Simulated seconds since the first contact; 0 before."""
        return 0.0 if self._contact_ns is None else (self._stamp_ns - self._contact_ns) / NS

    def scene(self, world: World) -> Scene:
        """World and robot."""
        robot, options = self._simulation.model, self._simulation.options
        camera = self._simulation.camera
        return Scene(
            radius_m=robot.radius_m,
            max_linear_m_s=robot.limits.speed_m_s,
            max_angular_rad_s=robot.limits.angular_speed_rad_s,
            outlines={shape.label: tuple(shape.capsules) for shape in world.shapes},
            moving=world.moving,
            began_ns=self.began_ns,
            lidar=options.lidar.pose,
            command_topic=options.topics.command.topic,
            odometry_topic=options.topics.odometry.topic,
            scan_topic=options.topics.scan.topic,
            acceleration_m_s2=robot.limits.acceleration_m_s2,
            sensor_topics=(
                *(sensor.topic for sensor in options.sensors),
                *(camera.options.topics if camera is not None else ()),
            ),
            lines=tuple(line.points for line in world.lines),
            filmed=Filmed(world.text, camera.options.model_dump_json(), camera.seed)
            if camera is not None
            else None,
        )

    def keep(self, step: Step, stamp_ns: int) -> None:
        """Keep the truth of a step."""
        if not self.began_ns:
            self.began_ns = stamp_ns - step.time_ns
        self._follow(step, stamp_ns)
        self._stamp_ns = stamp_ns
        pose, twist, command = step.pose, step.twist, step.command
        self.truth.append(
            Truth(
                *(stamp_ns, pose.x_m, pose.y_m, pose.yaw_rad),
                *(twist.linear_m_s, twist.angular_rad_s),
                *(command.linear_m_s, command.angular_rad_s),
                *(step.contact, self._name),
            )
        )
        for event in step.events:
            incident = Incident(stamp_ns, event.kind.value, event.text, robot=self._name)
            self.incidents.append(incident)

    def note_late(self, lateness: Lateness) -> None:
        """Note steps that are late because of the host."""
        late_s = lateness.late_ns / NS
        incident = Incident(self._stamp_ns, "late", str(lateness), late_s, robot=self._name)
        self.incidents.append(incident)

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


class Simulator(Simulated):
    """The robots of a run in their world, driven by what the student publishes."""

    def __init__(self, node: Node, order: SimulatorOrder) -> None:
        options = SimulatorOptions.model_validate_json(order.options)
        own = {name: RobotOptions.model_validate_json(text) for name, text in order.robots.items()}
        self._world = read_scenario_world(Path(order.world), order.values)
        simulations = make_simulations(self._world, options.each(own), order.seed)
        self._ros = RosSimulator(node, simulations, self, recorders=1)
        self.robots = {
            name: SimulatedRobot(name, one, self._ros) for name, one in simulations.items()
        }

    def start(self) -> None:
        """Let simulated time run, in a thread of its own."""
        self._ros.run_in_thread()

    def stop(self) -> None:
        """Stop simulated time; the truth ends here."""
        self._ros.end()

    @property
    def moving(self) -> tuple[SimulatedRobot, ...]:
        """Its robots."""
        return tuple(self.robots.values())

    @property
    def driven(self) -> dict[str, SimulatedRobot]:
        """All of them."""
        return self.robots

    @property
    def truth(self) -> tuple[Truth, ...]:
        """Every step so far of all robots, oldest first."""
        steps = zip(*(robot.truth for robot in self.robots.values()), strict=False)
        return tuple(chain.from_iterable(steps))

    @property
    def incidents(self) -> tuple[Incident, ...]:
        """What happened so far, oldest first."""
        found = (robot.incidents for robot in self.robots.values())
        return tuple(sorted(chain.from_iterable(found), key=attrgetter("time_ns")))

    @property
    def scenes(self) -> dict[str, Scene]:
        """World and robot, by the names of the robots."""
        return {name: robot.scene(self._world) for name, robot in self.robots.items()}

    def on_step(self, step: Step, stamp_ns: int, robot: str) -> None:
        """Keep the truth; called by the simulator."""
        self.robots[robot].keep(step, stamp_ns)

    def on_late(self, lateness: Lateness) -> None:
        """Note steps that are late because of the host; called by the simulator."""
        for robot in self.robots.values():
            robot.note_late(lateness)
