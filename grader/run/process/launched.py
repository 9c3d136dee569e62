"""The processes that a launch file starts, told apart by what `ros2 launch` prints of them."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from grader.recording.model import Declaration, LogLine, Process

# Such as driver-1: the program, and a number.
_NAME = r"\[(?P<name>[^\]\s]+-\d+)\]"
_BEGUN = re.compile(rf"\[INFO\] {_NAME}: process started with pid \[(?P<pid>\d+)\]")
_DIED = re.compile(
    rf"\[ERROR\] {_NAME}: process has died "
    r"\[pid (?P<pid>\d+), exit code (?P<code>-?\d+), cmd '(?P<command>.*)'\]\.?"
)
_WRITTEN = re.compile(rf"{_NAME} ?(?P<text>.*)")
# Of a package, as opposed to what ExecuteProcess starts, such as `ros2 service call`.
_PROGRAM = re.compile(r"\S+/lib/[^/\s]+/[^/\s]+(\s|$)")


@dataclass
class _Child:
    name: str
    pid: int
    begun_ns: int
    died_ns: int | None = None
    exit_code: int = 0
    command: str = ""
    declared: list[Declaration] = field(default_factory=list)

    @property
    def has_node(self) -> bool:
        names = [str(one.data.get("node")) for one in self.declared if one.kind == "node"]
        # The command `ros2` hides its own.
        return any(not name.rpartition("/")[2].startswith("_") for name in names)


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
    for process in processes:
        if process.name not in files:
            continue
        children = _children(process, log, declarations)
        for number, line in enumerate(lines):
            match = _WRITTEN.fullmatch(line.text) if line.process == process.name else None
            if match and match["name"] in {child.name for child in children.values()}:
                # Which of both streams it was, launch does not say.
                lines[number] = replace(
                    line, process=match["name"], stream="stderr", text=match["text"]
                )
        own = {pid: child.name for pid, child in children.items() if child.has_node}
        for position, item in enumerate(declared):
            if item.process == process.name and item.data.get("pid") in own:
                declared[position] = replace(item, process=own[item.data["pid"]])
        # A program of a package that died may have had no node yet.
        for child in children.values():
            early = child.died_ns is not None and child.died_ns < stop_ns
            if child.has_node:
                started = {"pid": child.pid}
                declared.append(Declaration(child.begun_ns, child.name, "started", started))
            elif not (early and _PROGRAM.match(child.command)):
                continue
            more.append(_record(child, process, early=early))
    return (*processes, *more), tuple(lines), tuple(declared)


def _children(
    process: Process, log: Sequence[LogLine], declarations: Sequence[Declaration]
) -> dict[int, _Child]:
    """What a launch file started, by process id."""
    found: dict[int, _Child] = {}
    for line in log:
        if line.process != process.name:
            continue
        if begun := _BEGUN.fullmatch(line.text):
            pid = int(begun["pid"])
            found[pid] = _Child(begun["name"], pid, line.time_ns)
        elif (died := _DIED.fullmatch(line.text)) and int(died["pid"]) in found:
            child = found[int(died["pid"])]
            child.died_ns, child.exit_code = line.time_ns, int(died["code"])
            child.command = died["command"]
    for item in declarations:
        if item.process == process.name and item.data.get("pid") in found:
            found[item.data["pid"]].declared.append(item)
    return found


def _record(child: _Child, launch: Process, *, early: bool) -> Process:
    alike = replace(launch, name=child.name, pid=child.pid, started_ns=child.begun_ns, survivors=())
    if not early:
        return alike
    return replace(
        alike, exited_ns=child.died_ns, exit_code=child.exit_code, stopped_by="itself", stop_s=None
    )
