"""The processes that a launch file starts, told apart by what `ros2 launch` prints of them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from grader.recording.model import Declaration, LogLine, Process

# Such as `driver-1`: the name of the program, and its place in the order of start.
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
        """Whether it ended with an error before a time, so not because it was stopped then."""
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
    children = [
        child for launch in processes if launch.name in files for child in _children(launch, log)
    ]
    child_by_pid = {(child.launch.name, child.pid): child for child in children}
    child_by_name = {(child.launch.name, child.name): child for child in children}
    keys_with_node = {
        (declaration.process, _pid(declaration))
        for declaration in declarations
        # The command `ros2` hides its own nodes: the names of these begin with an underscore.
        if declaration.kind == "node" and "/_" not in str(declaration.data.get("node"))
    }
    nodes = {key: child for key, child in child_by_pid.items() if key in keys_with_node}
    # A program that died may have had no node yet.
    recorded = [
        child
        for key, child in child_by_pid.items()
        if key in nodes or (child.is_program and child.died_before(stop_ns))
    ]
    started = [
        Declaration(child.begun_ns, child.name, "started", {"pid": child.pid})
        for child in nodes.values()
    ]
    return (
        (*processes, *(_process(child, stop_ns) for child in recorded)),
        tuple(_line_of_writer(line, child_by_name) for line in log),
        (*(_declaration_of_node(item, nodes) for item in declarations), *started),
    )


def _children(launch: Process, log: Sequence[LogLine]) -> Iterable[_Child]:
    """The processes that a launch file started, in the order of their start."""
    children: dict[int, _Child] = {}
    for line in log:
        if line.process != launch.name:
            continue
        if begun := _BEGUN.fullmatch(line.text):
            pid = int(begun["pid"])
            children[pid] = _Child(launch, begun["name"], pid, line.time_ns)
        elif (ended := _ENDED.fullmatch(line.text)) and (pid := int(ended["pid"])) in children:
            children[pid] = replace(
                children[pid],
                ended_ns=line.time_ns,
                exit_code=int(ended["code"] or 0),
                is_program=bool(_PROGRAM.match(ended["command"] or "")),
            )
    return children.values()


def _line_of_writer(line: LogLine, child_by_name: Mapping[tuple[str, str], _Child]) -> LogLine:
    """A line as of the process that wrote it; as it is where that was none of these."""
    written = _WRITTEN.fullmatch(line.text)
    if written is None or (line.process, written["name"]) not in child_by_name:
        return line
    # Which of both streams it was, launch does not say.
    return replace(line, process=written["name"], stream="stderr", text=written["text"])


def _pid(declaration: Declaration) -> int:
    """The process that declared something, or 0: a program may declare anything as its id."""
    pid = declaration.data.get("pid")
    return pid if isinstance(pid, int) else 0


def _declaration_of_node(
    declaration: Declaration, nodes: Mapping[tuple[str, int], _Child]
) -> Declaration:
    """A declaration as of the process with a node that made it; else as it is."""
    child = nodes.get((declaration.process, _pid(declaration)))
    return declaration if child is None else replace(declaration, process=child.name)


def _process(child: _Child, stop_ns: int) -> Process:
    """The record of a process; how it had to be stopped is known of its launch alone."""
    record = replace(
        child.launch, name=child.name, pid=child.pid, started_ns=child.begun_ns, survivors=()
    )
    if child.died_before(stop_ns):
        return replace(
            record,
            exit_code=child.exit_code,
            stopped_by="itself",
            stop_s=None,
            exited_ns=child.ended_ns,
        )
    # A helper may end when its work is done: only what ends at the stop has a time of its end.
    if child.ended_ns is None or child.ended_ns < stop_ns:
        return record
    return replace(record, exited_ns=child.ended_ns)
