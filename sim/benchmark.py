"""What the simulator costs: the figure for ``make bench``. Nothing is judged here."""

from __future__ import annotations

import threading
import time
from itertools import product

import rclpy
from rclpy.context import Context

from sim.description import SimulatorOptions
from sim.motion import NS, Twist
from sim.node import RosSimulator, make_node
from sim.shapes import wall
from sim.simulation import STEP_NS, make_simulation
from sim.world import World

SEGMENTS = 100


def share_of_core(duration_s: float = 10.0, domain_id: int | None = None) -> float:
    """CPU time over wall time of the whole simulator on its topics, in real time.

    A robot that drives in a circle among 100 walls. Physics at 100 Hz, odometry at 30 Hz, scans
    at 5 Hz, publication and the threads of the middleware; everything that this process does
    meanwhile is counted.

    Args:
        domain_id: ROS domain, or None for ROS_DOMAIN_ID.
    """
    places = [(x, y) for x, y in product(range(-5, 6), repeat=2) if abs(x) + abs(y) > 2]
    walls = [wall(f"wall {x} {y}", x, y, x + 0.5, y + 0.3) for x, y in places[:SEGMENTS]]
    simulation = make_simulation(World(tuple(walls)), SimulatorOptions())
    simulation.advance(Twist(0.2, 0.4))
    for _ in range(NS // STEP_NS):
        simulation.advance()
    context = Context()
    rclpy.init(context=context, domain_id=domain_id)
    try:
        simulator = RosSimulator(make_node("simulator", context), simulation)
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
