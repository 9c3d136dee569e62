"""Packages in C++ as students hand them in, but on rcl, which is wherever the wheels are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

NODES = Path(__file__).with_name("nodes")
MUTANTS = Path(__file__).with_name("mutants")
HEADER = "rcl_node.hpp"
_DEPENDS = ("rcl", "rcl_interfaces", "rcutils", "tracetools")
_MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.0.1</version>
  <description>What a student hands in</description>
  <maintainer email="student@example.com">Student</maintainer>
  <license>Apache-2.0</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
{depends}
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""
_CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({name} CXX)

find_package(ament_cmake REQUIRED)
{found}
{more}
{programs}
install(TARGETS {names} DESTINATION lib/${{PROJECT_NAME}})

ament_package()
"""
_PROGRAM = """\
add_executable({name} src/{name}.cpp)
ament_target_dependencies({name} {depends})
"""


def write_package(
    folder: Path,
    name: str,
    programs: Mapping[str, str],
    depends: Iterable[str],
    more_cmake: str = "",
) -> Path:
    """Make a package; the folder of the submission is returned.

    Args:
        folder: Of the submission.
        name: Of the package.
        programs: Name of each executable -> its source.
        depends: What the programs need beside rcl.
        more_cmake: Run before the programs are built.
    """
    every = [*depends, *_DEPENDS]
    files = {
        "package.xml": _MANIFEST.format(
            name=name, depends="".join(f"  <depend>{one}</depend>\n" for one in every)
        ),
        "CMakeLists.txt": _CMAKE.format(
            name=name,
            more=more_cmake,
            found="".join(f"find_package({one} REQUIRED)\n" for one in every),
            programs="".join(
                _PROGRAM.format(name=one, depends=" ".join(every)) for one in programs
            ),
            names=" ".join(programs),
        ),
        f"src/{HEADER}": (NODES / HEADER).read_text(encoding="utf-8"),
        **{f"src/{one}.cpp": source for one, source in programs.items()},
    }
    for path, text in files.items():
        file = folder / name / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return folder


def node(name: str) -> str:
    """The source of a node."""
    return (NODES / f"{name}.cpp").read_text(encoding="utf-8")
