"""The starter package of an assignment: real ROS packages that build and run, and solve nothing.

Made from the assignment's ``packages`` and its contract.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from grader.assignment.contract.spot import ANY, module_of
from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Assignment, CheckSpec, Package, Visibility
from grader.diagnosis.not_generated import InterfaceName
from grader.errors import UsageError
from grader.machine import resources
from grader.report.files import check_folder, write_whole
from grader.submission.read.rosdistro import UNKNOWN_TO_CMAKE

if TYPE_CHECKING:
    from jinja2 import Environment


@dataclass(frozen=True)
class Program:
    """An executable that runs one node, in a module that is named like the node."""

    executable: str
    module: str

    @property
    def node_class(self) -> str:
        """Name of the node's class."""
        return "".join(word[:1].upper() + word[1:] for word in re.split(r"\W|_", self.module))


def write_starter(loaded: LoadedAssignment, folder: Path, *, cpp: bool = False) -> tuple[Path, ...]:
    """Write the starter packages of an assignment, unless one is there already."""
    packages = loaded.assignment.packages
    if not packages:
        raise UsageError(
            f"{loaded.assignment.id} asks for a recording and for no package: there is no starter"
        )
    places = tuple(folder / package.name for package in packages)
    for place in places:
        if place.exists():
            raise UsageError(
                f"{place} is there already, and is left as it is: go on with it, or name another "
                "folder"
            )
    check_folder(folder)
    for path, text in starter_files(loaded, cpp=cpp).items():
        write_whole(folder / path, text)
    return places


def starter_files(loaded: LoadedAssignment, *, cpp: bool = False) -> dict[str, str]:
    """The starter packages of an assignment: contents by path, which begins with a package.

    Raises:
        UsageError: C++ is wanted, but the assignment takes Python only.
    """
    assignment = loaded.assignment
    files: dict[str, str] = {}
    if not assignment.packages:
        return files
    for package in assignment.packages:
        files.update(_package(assignment, in_cpp(package) if cpp else package))
    first = assignment.packages[0].name
    places = sorted(path for path, text in files.items() if "TODO" in text)
    files[f"{first}/README.md"] = rendered(
        "starter/README.md", title=assignment.title, assignment=assignment.id, places=places
    )
    return files


def package_files(
    package: Package,
    description: str,
    nodes: Mapping[str, str],
    interfaces: tuple[InterfaceName, ...],
) -> dict[str, str]:
    """Make a package around what its programs do."""
    cpp = is_cpp(package)
    if package.build_type == "ament_python":
        package = package.model_copy(update={"depends": package.depends_in_python})
    if cpp and "rclcpp" not in package.depends:
        package = package.model_copy(update={"depends": ("rclcpp", *package.depends)})
    if package.build_type == "ament_cmake":
        names = ["package.xml", "CMakeLists.txt"]
        files = {}
        code = "src" if cpp else "scripts"
    else:
        names = ["package.xml", "setup.py", "setup.cfg"]
        files = {f"resource/{package.name}": "", f"{package.name}/__init__.py": ""}
        code = package.name
    for name in names:
        files[name] = rendered(
            f"starter/{name}",
            package=package,
            description=description,
            programs=programs(package),
            cpp=cpp,
            found=[one for one in package.depends if one not in UNKNOWN_TO_CMAKE],
            interfaces=interfaces,
        )
    for program in programs(package):
        files[f"{code}/{program.module}.{'cpp' if cpp else 'py'}"] = nodes[program.executable]
    return files


def is_cpp(package: Package) -> bool:
    """Whether the programs of a package are written in C++.

    As `ros2 pkg create` has it for a package that CMake builds, unless it needs rclpy.
    """
    scripts = all(name.endswith(".py") for name in package.executables)
    return package.build_type == "ament_cmake" and "rclpy" not in package.depends and not scripts


def in_cpp(package: Package) -> Package:
    """The same package for students who write C++."""
    if "ament_cmake" not in package.build_types:
        raise UsageError(
            f"the assignment takes {package.name} in Python only (build_type: ament_python): leave "
            "out --cpp"
        )
    changed = {"build_types": ("ament_cmake",), "depends": package.depends_in_cpp}
    return package.model_copy(update=changed)


def programs(package: Package) -> tuple[Program, ...]:
    """The programs of a package; a single one lies in the module that is called like it."""
    alone = len(package.executables) == 1
    return tuple(
        Program(name, module_of(package.name, name, alone=alone)) for name in package.executables
    )


def _package(assignment: Assignment, package: Package) -> Iterator[tuple[str, str]]:
    interfaces = _interfaces(assignment, package)
    nodes = {
        program.executable: rendered(
            f"starter/node.{'cpp' if is_cpp(package) else 'py'}",
            package=package,
            program=program,
            node=_node_name(assignment, package, program),
            assignment=assignment.id,
        )
        for program in programs(package)
    }
    files = package_files(package, assignment.title, nodes, interfaces)
    for interface in interfaces:
        files[interface.file] = rendered("starter/interface", interface=interface)
    for path, content in files.items():
        yield f"{package.name}/{path}", content


def _node_name(assignment: Assignment, package: Package, program: Program) -> str:
    """The name of a program's node: the contract's, or that of its module.

    Without a contract, that which a visible check asks of a program that is launched alone.
    """
    if assignment.contract is not None:
        node = assignment.contract.programs[package.name, program.executable].node
        return program.module if node == ANY else node.rpartition("/")[2]
    launched = {
        scenario.id: [(one.package or package.name, one.executable) for one in scenario.launch]
        for scenario in assignment.scenarios
    }
    for spec in _visible(assignment, "node.exists"):
        judged = [launched[scenario] for scenario in spec.scenarios or launched]
        is_alone = all(programs == [(package.name, program.executable)] for programs in judged)
        if judged and is_alone:
            return str(spec.with_["name"]).rpartition("/")[2]
    return program.module


def _visible(assignment: Assignment, uses: str) -> Iterator[CheckSpec]:
    """The checks of a kind that a student sees."""
    for spec in assignment.checks:
        if (spec.uses or "").startswith(uses) and spec.visibility is Visibility.VISIBLE:
            yield spec


def _interfaces(assignment: Assignment, package: Package) -> tuple[InterfaceName, ...]:
    """The interfaces of a package: the contract's, or without one those that checks name."""
    contract = assignment.contract
    if contract is not None:
        names = [f"{package.name}/{name}" for name in contract.packages[package.name].interfaces]
    else:
        names = [str(spec.with_["interface"]) for spec in _visible(assignment, "interface.")]
    interfaces = map(InterfaceName.of, dict.fromkeys(names))
    return tuple(interface for interface in interfaces if interface.package == package.name)


def rendered(name: str, **values: object) -> str:
    """Fill in a template that is not an HTML page."""
    return _environment().get_template(f"{name}.j2").render(values)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    templates = Environment(
        loader=FileSystemLoader(resources.templates()),
        # Only XML needs escapes.
        autoescape=lambda name: bool(name) and str(name).endswith(".xml.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    templates.filters["quoted"] = repr
    return templates
