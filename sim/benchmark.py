"""What the simulator costs: figures for ``make bench``. Nothing is judged here."""

from __future__ import annotations

import math
import random
import threading
import time

from sim.description import SimulatorOptions
from sim.motion import NS, Pose, Twist
from sim.shapes import Shape, wall
from sim.simulation import STEP_NS, Simulation, make_simulation
from sim.world import World

_FREE_M = 1.3
_HALF_M = 4.0


def random_world(segments: int, seed: int = 0) -> World:
    """Walls of 0.2 to 1 m, scattered over 8 m x 8 m, with room for a robot at the origin."""
    source = random.Random(seed)
    shapes: list[Shape] = []
    while len(shapes) < segments:
        x_m, y_m = source.uniform(-_HALF_M, _HALF_M), source.uniform(-_HALF_M, _HALF_M)
        angle, length_m = source.uniform(0.0, math.tau), source.uniform(0.2, 1.0)
        ends = (x_m, y_m, x_m + length_m * math.cos(angle), y_m + length_m * math.sin(angle))
        shape = wall(f"segments[{len(shapes)}]", *ends)
        if shape.clearance_m(0.0, 0.0) > _FREE_M:
            shapes.append(shape)
    return World(tuple(shapes))


def step_s(segments: int, steps: int = 5_000) -> float:
    """Mean wall time of a step without its sensors, driving in a circle."""
    simulation = _circling(segments, sensors=False)
    began_s = time.perf_counter()
    for _ in range(steps):
        simulation.advance()
    return (time.perf_counter() - began_s) / steps


def scan_s(segments: int, scans: int = 200) -> float:
    """Mean wall time of a scan of 360 beams, from places all around."""
    simulation = _circling(segments, sensors=False)
    poses = [Pose(0.003 * i, 0.0, 0.01 * i) for i in range(scans)]
    began_s = time.perf_counter()
    for pose in poses:
        simulation.lidar.cast(pose, 0)
    return (time.perf_counter() - began_s) / scans


def share_of_core(segments: int, duration_s: float = 10.0, domain_id: int | None = None) -> float:
    """CPU time over wall time of the whole simulator on its topics, in real time.

    Physics at 100 Hz, odometry at 30 Hz, scans at 5 Hz, publication and the threads of the
    middleware; everything that this process does meanwhile is counted.

    Args:
        domain_id: ROS domain, or None for ROS_DOMAIN_ID.
    """
    import rclpy
    from rclpy.context import Context

    from sim.node import RosSimulator, make_node

    context = Context()
    rclpy.init(context=context, domain_id=domain_id)
    try:
        simulation = _circling(segments, sensors=True)
        node = make_node("simulator", context)
        simulator = RosSimulator(node, simulation, SimulatorOptions())
        stop = threading.Event()
        loop = threading.Thread(target=simulator.run, args=(stop,))
        loop.start()
        cpu_s, began_s = time.process_time(), time.perf_counter()
        time.sleep(duration_s)
        share = (time.process_time() - cpu_s) / (time.perf_counter() - began_s)
        stop.set()
        loop.join()
    finally:
        context.try_shutdown()
    return share


def _circling(segments: int, *, sensors: bool) -> Simulation:
    options = SimulatorOptions.model_validate(
        {"lidar": {"enabled": sensors}, "odometry": {"enabled": sensors}}
    )
    simulation = make_simulation(random_world(segments), options)
    simulation.advance(Twist(0.2, 0.4))
    for _ in range(NS // STEP_NS):
        simulation.advance()
    return simulation
