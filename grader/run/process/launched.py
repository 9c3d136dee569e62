"""The processes that a launch file starts, told apart by what `ros2 launch` prints of them."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from grader.recording.model import Declaration, LogLine, Process

# Such as driver-1: the program, and a number.
_NAME = r"\[(?P<name>[^\]\s]+-\d+)\]"
_BEGUN = re.compile(rf"\[INFO\] {_NAME}: process started with pid \[(?P<pid>\d+)\]")
_DIED = re.compile(
    rf"\[ERROR\] {_NAME}: process has died "
    r"\[pid (?P<pid>\d+), exit code (?P<code>-?\d+), cmd '(?P<command>.*)'\]\.?"
)
_FINISHED = re.compile(rf"\[INFO\] {_NAME}: process has finished cleanly \[pid (?P<pid>\d+)\]")
_WRITTEN = re.compile(rf"{_NAME} ?(?P<text>.*)")
# Of a package, as opposed to what ExecuteProcess starts, such as `ros2 service call`.
_PROGRAM = re.compile(r"\S+/lib/[^/\s]+/[^/\s]+(\s|$)")


@dataclass
class _Child:
    name: str
    begun_ns: int
    died_ns: int | None = None
    ended_ns: int | None = None
    exit_code: int = 0
    is_program: bool = False
    has_node: bool = False


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
    lines, declared, more = list(log), list(declarations), []
    for launch in (one for one in processes if one.name in files):
        children: dict[int, _Child] = {}
        for number, line in enumerate(log):
            if line.process == launch.name:
                lines[number] = _read(line, children, stop_ns)
        for item in declarations:
            # The command `ros2` hides its own nodes.
            named = item.kind == "node" and "/_" not in str(item.data.get("node"))
            if named and item.process == launch.name and item.data.get("pid") in children:
                children[item.data["pid"]].has_node = True
        nodes = {pid: child for pid, child in children.items() if child.has_node}
        for number, item in enumerate(declarations):
            if item.process == launch.name and item.data.get("pid") in nodes:
                declared[number] = replace(item, process=nodes[item.data["pid"]].name)
        for pid, child in children.items():
            if child.has_node:
                declared.append(Declaration(child.begun_ns, child.name, "started", {"pid": pid}))
            # A program that died may have had no node yet.
            if child.has_node or (child.died_ns is not None and child.is_program):
                more.append(_record(pid, child, launch))
    return (*processes, *more), tuple(lines), tuple(declared)


def _read(line: LogLine, children: dict[int, _Child], stop_ns: int) -> LogLine:
    """Note what launch says of a process; a line that one of them wrote becomes its own."""
    if begun := _BEGUN.fullmatch(line.text):
        children[int(begun["pid"])] = _Child(begun["name"], line.time_ns)
    died = _DIED.fullmatch(line.text)
    ended = died or _FINISHED.fullmatch(line.text)
    if ended and (child := children.get(int(ended["pid"]))):
        child.ended_ns = line.time_ns
    if died and line.time_ns < stop_ns and (child := children.get(int(died["pid"]))):
        child.died_ns, child.exit_code = line.time_ns, int(died["code"])
        child.is_program = bool(_PROGRAM.match(died["command"]))
    written = _WRITTEN.fullmatch(line.text)
    if written and written["name"] in {child.name for child in children.values()}:
        # Which of both streams it was, launch does not say.
        return replace(line, process=written["name"], stream="stderr", text=written["text"])
    return line


def _record(pid: int, child: _Child, launch: Process) -> Process:
    found = replace(launch, name=child.name, pid=pid, started_ns=child.begun_ns, survivors=())
    if child.died_ns is None:
        # As launch tells; how it had to be stopped is known of launch alone.
        return replace(found, exited_ns=child.ended_ns or found.exited_ns)
    found = replace(found, exited_ns=child.died_ns, exit_code=child.exit_code)
    return replace(found, stopped_by="itself", stop_s=None)
