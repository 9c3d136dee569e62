"""The autograder of a Classroom 50 assignment; its runner starts this in the student's checkout.

Goes into CLASSROOM/autograders/@ASSIGNMENT@/ together with the folder rosgrade beside it.
"""

import subprocess
import sys
from pathlib import Path

ROSGRADE = Path(__file__).resolve().parent / "rosgrade"


def main() -> int:
    """Set rosgrade up and grade; 0 if there is a grade, even without points."""
    made = subprocess.run([sys.executable, "-m", "grader.bootstrap"], cwd=ROSGRADE, check=False)
    if made.returncode:
        return made.returncode
    rosgrade = str(ROSGRADE / ".venv/bin/rosgrade")
    # Such as rclcpp for nodes in C++; where it cannot be had, `check` says so.
    underlay = ["underlay", "add", "--for", "@ASSIGNMENT@", "--submission", "."]
    subprocess.run([rosgrade, *underlay], check=False)
    command = ["check", "@ASSIGNMENT@", ".", "--github", "--classroom50"]
    return subprocess.run([rosgrade, *command], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
