"""Makes command lines of what a scenario launches, as `ros2 run` and `ros2 launch` would."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import GraderFault
from grader.machine.ros import RosInstallation
from grader.run.order import ProcessCommand
from grader.spec.name import FIND_SHARE
from grader.spec.names import NO_NAMES, Names, Thing

if TYPE_CHECKING:
    from grader.assignment.model import Assignment, Launch


def ros_arguments(
    launch: Launch,
    values: dict[str, float],
    names: Names = NO_NAMES,
) -> tuple[str, ...]:
    """Command line arguments of a launch, as ``ros2 run`` passes them on, with names put right."""
    from grader.assignment.random_values import fill_in

    rules: list[str] = []
    if launch.name:
        rules += ["-r", f"__node:={launch.name}"]
    if launch.namespace:
        rules += ["-r", f"__ns:={launch.namespace}"]
    remaps = [f"{old}:={new}" for old, new in launch.remap.items()]
    for rule in (*remaps, *names.rules):
        rules += ["-r", rule]
    for name, value in launch.parameters.items():
        # The value is YAML to rcl, and JSON is YAML.
        text = json.dumps(fill_in(value, values))
        for spelling in dict.fromkeys((name, names.own(Thing.PARAMETER, name))):
            rules += ["-p", f"{spelling}:={text}"]
    ros_args = ("--ros-args", *rules) if rules else ()
    return (*launch.arguments, *ros_args)


def launch_file_program(ros: RosInstallation, package: str, file: str) -> tuple[str, ...]:
    """What starts a launch file, as `ros2 launch` does."""
    for prefix in (*ros.underlays, *ros.prefixes):
        ros2 = prefix / "bin" / "ros2"
        if ros2.is_file() and "ros2launch" in ros.packages:
            return (str(ros.python), str(ros2), "launch", package, file)
    raise GraderFault(
        f"{package}/{file} is a launch file, and this ROS ({ros.source}) has no `ros2 launch`: "
        "write `underlays: [launch]` into assignment.yaml, and get it with `rosgrade underlay add "
        "launch`"
    )


def with_shares(arguments: Sequence[str], prefixes: Sequence[Path]) -> tuple[str, ...]:
    """Arguments with the folders of packages in place of ``$(find-pkg-share PACKAGE)``.

    Raises:
        GraderFault: No install space has such a package.
    """

    def share(match: re.Match[str]) -> str:
        for prefix in prefixes:
            if (folder := prefix / "share" / match[1]).is_dir():
                return str(folder)
        raise GraderFault(f"{match[0]}: there is no package {match[1]!r}")

    return tuple(FIND_SHARE.sub(share, argument) for argument in arguments)


def process_command(
    ros: RosInstallation,
    launch: Launch,
    assignment: Assignment,
    install: Path,
    values: dict[str, float],
    names: Names = NO_NAMES,
) -> ProcessCommand:
    """What to execute for a launch, with names put right."""
    prefixes = (install, *ros.underlays, *ros.prefixes)
    asked = launch.package or assignment.packages[0].name
    package = names.own(Thing.PACKAGE, asked)
    if launch.executable is None:
        file = names.own_file(f"share/{asked}", launch.program)
        program = launch_file_program(ros, package, file)
        # It says itself how its nodes and their topics are called.
        names = NO_NAMES
    else:
        place = f"lib/{asked}/{launch.executable}"
        # The setup.cfg of a package with a wrong name may say the right one.
        if not (install / place).is_file():
            place = f"lib/{package}/{launch.executable}"
        program = _program(ros, install / names.own(Thing.FILE, place))
    return ProcessCommand(
        name=f"{asked}/{launch.program}",
        argv=(*program, *with_shares(ros_arguments(launch, values, names), prefixes)),
        after_s=launch.after,
        is_launch_file=launch.file is not None,
    )


def companion(ros: RosInstallation, launch: Launch, values: dict[str, float]) -> ProcessCommand:
    """What to execute of the author's.

    Raises:
        GraderFault: No install space has such an executable or launch file.
    """
    package = str(launch.package)
    name = f"{package}/{launch.program}"
    prefixes = (*ros.underlays, *ros.prefixes)
    arguments = with_shares(ros_arguments(launch, values), prefixes)
    if launch.file is None:
        for prefix in prefixes:
            if (file := prefix / "lib" / name).is_file():
                return ProcessCommand(name, (*_program(ros, file), *arguments))
    # `ros2 launch` finds it in any folder there.
    elif any(any((prefix / "share" / package).rglob(launch.file)) for prefix in prefixes):
        program = launch_file_program(ros, package, launch.file)
        return ProcessCommand(name, (*program, *arguments), is_launch_file=True)
    what = "executable" if launch.file is None else "launch file"
    raise GraderFault(
        f"the program {name} of the assignment is not there: its package installs no such {what}"
    )


def _program(ros: RosInstallation, file: Path) -> tuple[str, ...]:
    """What `ros2 run` would execute.

    A Python script is given to the interpreter by name, because its first line cannot hold a path
    with a space in it.
    """
    try:
        with file.open("rb") as stream:
            first = stream.readline(256)
    except OSError:
        first = b""
    is_python = first.startswith(b"#!") and b"python" in first
    return (str(ros.python), str(file)) if is_python else (str(file),)
