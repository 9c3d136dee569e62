"""A new assignment's folder, which works as it is: an author changes it bit by bit."""

from __future__ import annotations

import keyword
import sys
from pathlib import Path

from grader.assignment.load import ASSIGNMENT_FILE
from grader.assignment.model import Package
from grader.assignment.reference import CPP, PYTHON
from grader.authoring.starter import package_files, programs, rendered
from grader.errors import UsageError
from grader.report.files import check_folder, write_whole
from grader.report.html.handout import HANDOUT_FILE
from grader.spec.name import check_id
from grader.submission.read.rosdistro import PACKAGES


def write_assignment(name: str, folder: Path, *, cpp: bool = False) -> Path:
    """Write a new assignment with a handout, a reference solution and mutants; also in C++."""
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
    for path, text in assignment_files(name, cpp=cpp).items():
        write_whole(target / path, text)
    return target


def assignment_files(name: str, *, cpp: bool = False) -> dict[str, str]:
    """Make the files of a new assignment."""
    languages = (PYTHON, CPP) if cpp else (PYTHON,)
    names = (ASSIGNMENT_FILE, HANDOUT_FILE, PYTHON.mutants)
    files = {file: rendered(f"new/{file}", id=name, cpp=cpp) for file in names}
    for one in languages:
        client = "rclcpp" if one is CPP else "rclpy"
        package = Package(
            name=name,
            build_types=("ament_cmake",) if one is CPP else ("ament_python",),
            depends=(client, "std_msgs"),
            executables=(name,),
        )
        (program,) = programs(package)
        code = rendered(f"new/node.{'cpp' if one is CPP else 'py'}", id=name, program=program)
        made = package_files(package, "Says hello twice a second.", {name: code}, ())
        for path, content in made.items():
            files[f"{one.reference}/{name}/{path}"] = content
    return files
