"""``rosgrade sim``: the simulator alone, for a student to drive against."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.machine.resources import cache_folder
from grader.machine.ros import find
from grader.run.cell.main import add_type_support
from grader.submission.underlay.store import UnderlayStore
from sim.live import described, run, run_turtles
from sim.simulation import make_simulation
from sim.turtles.simulation import Turtles


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
    """Simulate a robot or turtles in a world, with a live view, until Ctrl-C.

    Runs in real time. The robot subscribes to /cmd_vel and publishes /odom and /scan, like a
    TurtleBot3 in Gazebo. Turtles have the topics, services and the action of turtlesim.
    """
    found, options_of_robot = described(world, values or (), options, robot, pose)
    if found.turtles:
        _find_turtlesim()
        run_turtles(Turtles(found.turtles), domain_id=domain_id, duration=duration)
        return
    run(make_simulation(found, options_of_robot, seed), domain_id=domain_id, duration=duration)


def _find_turtlesim() -> None:
    """Make the interfaces of turtlesim importable, and say where they are if ROS lacks them."""
    ros = find()
    for prefix in UnderlayStore(cache_folder(), ros).completed(ros, ["turtlesim"]).underlays:
        add_type_support([prefix])
        typer.echo(f"For your own nodes: source {prefix / 'local_setup.bash'}", err=True)
