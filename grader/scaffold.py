"""A new assignment's folder, which works as it is: an author changes it bit by bit."""

from __future__ import annotations

import keyword
import sys
from pathlib import Path

from grader.assignment.load import ASSIGNMENT_FILE
from grader.assignment.model import Package
from grader.assignment.mutant import PYTHON
from grader.errors import UsageError
from grader.report.files import check_folder, write_whole
from grader.report.html.handout import HANDOUT_FILE
from grader.spec.name import check_id
from grader.starter import package_files, programs, rendered
from grader.submission.read.rosdistro import PACKAGES


def write_assignment(name: str, folder: Path) -> Path:
    """Write a new assignment with a handout, a reference solution and mutants."""
    try:
        check_id(name)
    except ValueError as error:
        raise UsageError(str(error)) from error
    if keyword.iskeyword(name) or name in sys.stdlib_module_names or name in PACKAGES:
        raise UsageError(
            f"{name!r} is a name of Python's own or a package of ROS, which the assignment's "
            "package would hide: take another id"
        )
    target = folder / name
    if target.exists():
        raise UsageError(f"{target} is there already, and is left as it is: take another id")
    check_folder(target)
    for path, text in assignment_files(name).items():
        write_whole(target / path, text)
    return target


def assignment_files(name: str) -> dict[str, str]:
    """Make the files of a new assignment."""
    package = Package(name=name, depends=("rclpy", "std_msgs"), executables=(name,))
    (program,) = programs(package)
    solution = {name: rendered("new/node.py", id=name, program=program)}
    files = {
        file: rendered(f"new/{file}", id=name)
        for file in (ASSIGNMENT_FILE, HANDOUT_FILE, PYTHON.mutants)
    }
    description = "Says hello twice a second."
    for path, content in package_files(package, description, solution, ()).items():
        files[f"{PYTHON.reference}/{name}/{path}"] = content
    return files
