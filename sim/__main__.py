"""``python -m sim WORLD``: the simulator alone."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

from grader.errors import RosgradeError, UsageError


def main(arguments: list[str] | None = None) -> int:
    """Read the command line and simulate until Ctrl-C."""
    parser = argparse.ArgumentParser(
        prog="python -m sim", description="Simulate a TurtleBot3 in a world, for your own nodes."
    )
    parser.add_argument("world", type=Path, help="world file (YAML)")
    parser.add_argument("--options", type=Path, help="robot, sensors and topics (YAML)")
    parser.add_argument("--robot", help="burger or waffle")
    parser.add_argument("--pose", help="start, such as '1, 0.5, 90 deg'")
    parser.add_argument("--seed", type=int, default=0, help="of noise and drift (0)")
    parser.add_argument("--domain-id", type=int, help="ROS domain (ROS_DOMAIN_ID)")
    parser.add_argument("--duration", type=float, help="end after so many seconds")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="a value of the world"
    )
    given = parser.parse_args(arguments)
    try:
        values = read_values(given.set)
        # Reading the command line needs no ROS, so that --help works without.
        from sim.live import run

        run(
            given.world,
            options_file=given.options,
            robot=given.robot,
            pose=given.pose,
            seed=given.seed,
            domain_id=given.domain_id,
            values=values,
            duration_s=given.duration,
        )
    except RosgradeError as error:
        print(f"ERROR: {error}", file=sys.stderr)
        return 2
    return 0


def read_values(texts: Iterable[str]) -> dict[str, str]:
    """Values of the world from a command line.

    Raises:
        UsageError: One of them is not of the form ``NAME=VALUE``.
    """
    values = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise UsageError(f"--set {text}: write NAME=VALUE")
        values[name] = value
    return values


if __name__ == "__main__":
    sys.exit(main())
