"""The processes that a launch file starts, told apart by what `ros2 launch` prints of them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from grader.recording.model import Declaration, LogLine, Process

# Such as driver-1: the program, and a number.
_NAME = r"\[(?P<name>[^\]\s]+-\d+)\]"
_BEGUN = re.compile(rf"\[INFO\] {_NAME}: process started with pid \[(?P<pid>\d+)\]")
_ENDED = re.compile(
    rf"\[(INFO|ERROR)\] {_NAME}: process has (finished cleanly|died) "
    r"\[pid (?P<pid>\d+)(, exit code (?P<code>-?\d+), cmd '(?P<command>.*)')?\]\.?"
)
_WRITTEN = re.compile(rf"{_NAME} ?(?P<text>.*)")
# Of a package, as opposed to what ExecuteProcess starts, such as `ros2 service call`.
_PROGRAM = re.compile(r"\S+/lib/[^/\s]+/[^/\s]+(\s|$)")


@dataclass(frozen=True)
class _Child:
    """A process that a launch file started, by what `ros2 launch` printed.

    Attributes:
        launch: The process that ran the launch file.
        ended_ns: When launch told that it had ended, or None.
        exit_code: 0 where it ended cleanly.
        is_program: Whether it ran an executable of a package, as far as is known.
    """

    launch: Process
    name: str
    pid: int
    begun_ns: int
    ended_ns: int | None = None
    exit_code: int = 0
    is_program: bool = False

    def died_before(self, time_ns: int) -> bool:
        """Whether it ended by itself, and not cleanly."""
        return self.exit_code != 0 and self.ended_ns is not None and self.ended_ns < time_ns


def launched(
    files: Collection[str],
    stop_ns: int,
    processes: Sequence[Process],
    log: Sequence[LogLine],
    declarations: Sequence[Declaration],
) -> tuple[tuple[Process, ...], tuple[LogLine, ...], tuple[Declaration, ...]]:
    """Give nodes of launch files processes of their own, with their output and declarations.

    What has no node, and what ends well before the end of the run, stays with the launch file: a
    helper that sets a parameter may do so.

    Args:
        files: Names of the processes that run launch files.
        stop_ns: When SIGINT was sent.
    """
    started = [
        one for launch in processes if launch.name in files for one in _children(launch, log)
    ]
    by_pid = {(one.launch.name, one.pid): one for one in started}
    by_name = {(one.launch.name, one.name): one for one in started}
    # The command `ros2` hides its own nodes.
    with_node = {
        (item.process, _pid(item))
        for item in declarations
        if item.kind == "node" and "/_" not in str(item.data.get("node"))
    }
    nodes = {key: one for key, one in by_pid.items() if key in with_node}
    # A program that died may have had no node yet.
    own = [
        one
        for key, one in by_pid.items()
        if key in nodes or (one.is_program and one.died_before(stop_ns))
    ]
    return (
        (*processes, *(_process(one, stop_ns) for one in own)),
        tuple(_of_its_writer(line, by_name) for line in log),
        (
            *(_of_its_node(item, nodes) for item in declarations),
            *(
                Declaration(one.begun_ns, one.name, "started", {"pid": one.pid})
                for one in nodes.values()
            ),
        ),
    )


def _children(launch: Process, log: Sequence[LogLine]) -> Iterable[_Child]:
    """The processes that a launch file started, in the order of their start."""
    found: dict[int, _Child] = {}
    for line in log:
        if line.process != launch.name:
            continue
        if begun := _BEGUN.fullmatch(line.text):
            pid = int(begun["pid"])
            found[pid] = _Child(launch, begun["name"], pid, line.time_ns)
        elif (ended := _ENDED.fullmatch(line.text)) and (pid := int(ended["pid"])) in found:
            found[pid] = replace(
                found[pid],
                ended_ns=line.time_ns,
                exit_code=int(ended["code"] or 0),
                is_program=bool(_PROGRAM.match(ended["command"] or "")),
            )
    return found.values()


def _of_its_writer(line: LogLine, by_name: Mapping[tuple[str, str], _Child]) -> LogLine:
    """A line that one of the processes wrote becomes its own."""
    written = _WRITTEN.fullmatch(line.text)
    if written is None or (line.process, written["name"]) not in by_name:
        return line
    # Which of both streams it was, launch does not say.
    return replace(line, process=written["name"], stream="stderr", text=written["text"])


def _pid(item: Declaration) -> int:
    """The process that declared something; a program may declare anything as its id."""
    pid = item.data.get("pid")
    return pid if isinstance(pid, int) else 0


def _of_its_node(item: Declaration, nodes: Mapping[tuple[str, int], _Child]) -> Declaration:
    """A declaration of a process with a node becomes its own."""
    child = nodes.get((item.process, _pid(item)))
    return item if child is None else replace(item, process=child.name)


def _process(child: _Child, stop_ns: int) -> Process:
    """The record of a process; how it had to be stopped is known of its launch alone."""
    found = replace(
        child.launch, name=child.name, pid=child.pid, started_ns=child.begun_ns, survivors=()
    )
    if child.died_before(stop_ns):
        found = replace(found, exit_code=child.exit_code, stopped_by="itself", stop_s=None)
    elif child.ended_ns is None or child.ended_ns < stop_ns:
        # A helper may end when its work is done.
        return found
    return replace(found, exited_ns=child.ended_ns)
