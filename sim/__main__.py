"""``python -m sim WORLD``: the simulator alone."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from grader.errors import RosgradeError


def main(arguments: list[str] | None = None) -> int:
    """Read the command line and simulate until Ctrl-C."""
    parser = argparse.ArgumentParser(
        prog="python -m sim", description="Simulate a TurtleBot3 in a world, for your own nodes."
    )
    add = parser.add_argument
    add("world", type=Path, help="world file (YAML)")
    add("--options", type=Path, help="robot, sensors and topics (YAML)")
    add("--robot", help="burger or waffle")
    add("--pose", help="start, such as '1, 0.5, 90 deg'")
    add("--seed", type=int, default=0, help="of noise and drift (0)")
    add("--domain-id", type=int, help="ROS domain (ROS_DOMAIN_ID)")
    add("--duration", type=float, help="end after so many seconds")
    add("--set", dest="values", action="append", metavar="NAME=VALUE", help="a value of the world")
    given = parser.parse_args(arguments)
    try:
        # Reading the command line needs no ROS, so that --help works without.
        from sim.live import run

        run(**vars(given))
    except RosgradeError as error:
        print(f"ERROR: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
