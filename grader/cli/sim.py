"""``rosgrade sim``: the simulator alone, for a student to drive against."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.live import described, run
from sim.simulation import make_simulation


def sim(
    world: Annotated[Path, typer.Argument(help="World file (YAML).")],
    robot: Annotated[str | None, typer.Option(help="Model of the robot: burger or waffle.")] = None,
    pose: Annotated[str | None, typer.Option(help="Start pose, such as '1, 0.5, 90 deg'.")] = None,
    options: Annotated[
        Path | None, typer.Option(help="YAML file with robot, lidar, odometry and topics.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of noise and drift.")] = 0,
    domain_id: Annotated[
        int | None, typer.Option(help="ROS domain; by default ROS_DOMAIN_ID.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="End after this simulated time, in seconds.")
    ] = None,
    values: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Value of the world.")
    ] = None,
) -> None:
    """Simulate a robot in a world, with a live view, until Ctrl-C.

    Runs in real time. The robot subscribes to /cmd_vel and publishes /odom and /scan, like a
    TurtleBot3 in Gazebo.
    """
    simulation = make_simulation(*described(world, values or (), options, robot, pose), seed)
    run(simulation, domain_id=domain_id, duration=duration)
