"""Recordings and submissions made by hand: a healthy one, and the pieces to spoil it with.

All times are seconds since launch. ``recording()`` is a run of a good timed publisher: node
``/bot_publisher`` publishes a Twist (linear.x = 1.0, angular.z = 0.5) on ``/cmd_vel`` every
300 ms, answers calls, and ends 0.1 s after SIGINT.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from grader.checks.catalogue import get
from grader.checks.finding import Finding, Status
from grader.recording.model import (
    NS,
    Call,
    Declaration,
    Disturbance,
    Ending,
    Endpoint,
    Kind,
    LogLine,
    Message,
    Node,
    Owner,
    Process,
    Qos,
    Recording,
)
from grader.submission.record import (
    BuildRecord,
    Dependency,
    Import,
    PackageRecord,
    SubmissionRecord,
)

LAUNCH_NS = 1_700_000_000 * NS
FIRST_S = 0.7
PERIOD_S = 0.3
STOP_S = 4.5
END_S = 4.6
TWIST = "geometry_msgs/msg/Twist"
BOT = "bot_publisher/bot_pub"
NODE = "/bot_publisher"
INSTALLED = "/w/install/lib/python3.12/site-packages/bot_publisher/node.py"
SOURCE = "src/bot_publisher/bot_publisher/node.py"
RELIABLE = Qos(reliability="reliable", durability="volatile", liveliness="automatic")


def judge(check: str, subject: Recording | SubmissionRecord, **parameters: Any) -> Finding:
    """Run a check of the catalogue with parameters as YAML has them."""
    entry = get(check)
    return entry.judge(subject, entry.parameters.model_validate(parameters))


def text(finding: Finding) -> str:
    """Everything a student reads of a finding."""
    return f"{finding.observed} | {finding.hint}"


def failing(check: str, subject: Recording | SubmissionRecord, **parameters: Any) -> str:
    """The text of a finding that must have failed."""
    finding = judge(check, subject, **parameters)
    assert finding.status is Status.FAILED, finding
    assert finding.expected and finding.observed and finding.hint, finding
    assert finding.credit == 0.0
    return text(finding)


def at(seconds: float) -> int:
    """A time since launch as nanoseconds since the epoch."""
    return LAUNCH_NS + round(seconds * NS)


def twist(linear: Sequence[float] = (1.0, 0, 0), angular: Sequence[float] = (0, 0, 0.5)) -> Any:
    """The value of a Twist."""
    axes = ("x", "y", "z")
    return {
        "linear": {axis: float(v) for axis, v in zip(axes, linear, strict=True)},
        "angular": {axis: float(v) for axis, v in zip(axes, angular, strict=True)},
    }


def message(
    time_s: float,
    value: Mapping[str, Any] | None = None,
    *,
    sequence: int = 1,
    topic: str = "/cmd_vel",
    type: str = TWIST,
    received_s: float | None = None,
) -> Message:
    """A message that arrives 1 ms after it was published."""
    arrival_s = time_s + 0.001 if received_s is None else received_s
    value = twist() if value is None else value
    return Message(topic, type, value, at(time_s), at(arrival_s), sequence)


def messages(
    times_s: Iterable[float], value: Mapping[str, Any] | None = None, topic: str = "/cmd_vel"
) -> dict[str, tuple[Message, ...]]:
    """Messages of one writer, numbered from 1."""
    found = [message(t, value, sequence=n, topic=topic) for n, t in enumerate(times_s, start=1)]
    return {topic: tuple(found)}


def every(period_s: float, count: int = 12, first_s: float = FIRST_S) -> list[float]:
    """Equidistant times."""
    return [first_s + index * period_s for index in range(count)]


def after(intervals_s: Iterable[float], first_s: float = FIRST_S) -> list[float]:
    """Times with these intervals between them."""
    times = [first_s]
    for interval_s in intervals_s:
        times.append(times[-1] + interval_s)
    return times


def node(
    name: str = NODE,
    appeared_s: float = 0.3,
    vanished_s: float | None = None,
    owner: Owner = Owner.STUDENT,
) -> Node:
    """A node in the graph."""
    return Node(name, owner, at(appeared_s), None if vanished_s is None else at(vanished_s))


def endpoint(
    topic: str = "/cmd_vel",
    *,
    kind: Kind = Kind.PUBLISHER,
    type: str = TWIST,
    node: str = NODE,
    owner: Owner = Owner.STUDENT,
    qos: Qos = RELIABLE,
    appeared_s: float = 0.35,
) -> Endpoint:
    """A publisher (or a subscription) in the graph."""
    gid = f"{topic}{node}{kind.value}{appeared_s}".encode().hex()
    return Endpoint(kind, topic, type, node, owner, qos, gid, at(appeared_s))


def reader(topic: str = "/cmd_vel", type: str = TWIST, qos: Qos = RELIABLE) -> Endpoint:
    """The probe's subscription."""
    return endpoint(
        topic, kind=Kind.SUBSCRIPTION, type=type, node="/probe", owner=Owner.PROBE, qos=qos
    )


def process(name: str = BOT, **changes: Any) -> Process:
    """A process that ran until SIGINT; ``exited_s`` is its end."""
    exited_s = changes.pop("exited_s", END_S)
    healthy = Process(
        name,
        pid=1000,
        started_ns=LAUNCH_NS,
        exited_ns=None if exited_s is None else at(exited_s),
        exit_code=-2,
        stopped_by="SIGINT",
        stop_s=0.1,
    )
    return replace(healthy, **changes)


def died(exit_code: int | None, exited_s: float = 1.2, name: str = BOT) -> Process:
    """A process that ended before it was asked to."""
    return process(name, exited_s=exited_s, exit_code=exit_code, stopped_by="itself", stop_s=None)


def output(
    lines: str, *, stream: str = "stderr", time_s: float = 1.0, name: str = BOT
) -> tuple[LogLine, ...]:
    """Lines that a process wrote at a time."""
    return tuple(LogLine(at(time_s), name, stream, line) for line in lines.splitlines())


def traceback(raised: str, *, source: str = "self.go()", line: int = 14) -> str:
    """A traceback as Python prints it, from the student's file through rclpy."""
    return (
        "Traceback (most recent call last):\n"
        '  File "/w/install/lib/bot_publisher/bot_pub", line 33, in <module>\n'
        "    sys.exit(load_entry_point('bot-publisher', 'console_scripts', 'bot_pub')())\n"
        f'  File "{INSTALLED}", line {line}, in main\n'
        f"    {source}\n"
        "    ^^^^^^^^^\n"
        '  File "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/node.py", line 205, in f\n'
        "    raise it\n"
        f"{raised}"
    )


def declared(kind: str, time_s: float = 0.4, name: str = BOT, **data: Any) -> Declaration:
    """Something the tracer reported."""
    return Declaration(at(time_s), name, kind, data)


def declarations(
    *, timer_s: float | None = PERIOD_S, spin: bool = True, depth: int = 10, name: str = BOT
) -> tuple[Declaration, ...]:
    """What the tracer reports of a publisher."""
    found = [
        declared("started", 0.05, name, executable="bot_pub"),
        declared("init", 0.2, name),
        declared("node", 0.3, name, node=NODE),
        declared(
            "publisher", 0.35, name, node=NODE, topic="/cmd_vel", type=TWIST,
            reliability="reliable", durability="volatile", history="keep_last", depth=depth,
        ),
    ]  # fmt: skip
    if timer_s is not None:
        found.append(
            declared("timer", 0.4, name, node=NODE, period_s=timer_s, callback="f", group={})
        )
    if spin:
        found.append(declared("spin", 0.41, name, executor="SingleThreadedExecutor", threads=1))
    return tuple(found)


def call(requested_s: float, answer_s: float | None = 0.002, of: str = NODE) -> Call:
    """A call to a node's list_parameters, answered so many seconds later."""
    return Call(
        f"{of}/list_parameters",
        "rcl_interfaces/srv/ListParameters",
        at(requested_s),
        None if answer_s is None else at(requested_s + answer_s),
    )


def calls(answer_s: float | None = 0.002) -> tuple[Call, ...]:
    """A call every 0.5 s, each answered after the same time."""
    return tuple(call(0.5 * index, answer_s) for index in range(1, 9))


def taken(
    begin_s: float, end_s: float, waited_s: float = 0.0, late_s: float = 0.0
) -> tuple[Disturbance, ...]:
    """Samples every 10 ms; what the host took lies in the one that ends at ``end_s``."""
    return (
        Disturbance(at(begin_s), 0, 0),
        Disturbance(at(end_s), round(late_s * NS), round(waited_s * NS)),
    )


def package(name: str = "bot_publisher", **changes: Any) -> PackageRecord:
    """A good package."""
    path = f"src/{name}"
    source = f"{path}/{name}/node.py"
    healthy = PackageRecord(
        name=name,
        path=path,
        dependencies=(
            Dependency("rclpy", "depend", 10, known=True),
            Dependency("geometry_msgs", "exec_depend", 11, known=True),
        ),
        imports=(Import("rclpy", source, 1), Import("geometry_msgs", source, 3)),
        ros_imports=(Import("rclpy", source, 1), Import("geometry_msgs", source, 3)),
        entry_points=(("bot_pub", f"{name}.node:main"),),
        executables=("bot_pub",),
        files=((f"{name}/node.py", source), (f"{name}/__init__.py", f"{path}/{name}/__init__.py")),
    )
    return replace(healthy, **changes)


def submission(*packages: PackageRecord, **changes: Any) -> SubmissionRecord:
    """A submission of these packages (by default the good one) that was built."""
    healthy = SubmissionRecord(
        id="ada",
        sha256="0" * 64,
        packages=packages or (package(),),
        build=BuildRecord(succeeded=True, duration_s=0.9),
    )
    return replace(healthy, **changes)


def recording(**changes: Any) -> Recording:
    """A healthy run; every keyword replaces that field of the recording.

    ``matched_s``, ``stop_s`` and ``end_s`` give times since launch.
    """
    for name in ("matched", "stop", "end"):
        if f"{name}_s" in changes:
            changes[f"{name}_ns"] = at(changes.pop(f"{name}_s"))
    healthy = Recording(
        scenario="idle",
        seed=1,
        ending=Ending.UNTIL,
        launched_ns=LAUNCH_NS,
        stop_ns=at(STOP_S),
        end_ns=at(END_S),
        submission=submission(),
        matched_ns=at(0.4),
        messages=messages(every(PERIOD_S)),
        nodes=(node(), node("/probe", 0.0, owner=Owner.PROBE)),
        endpoints=(endpoint(), endpoint("/rosout", type="rcl_interfaces/msg/Log"), reader()),
        processes=(process(),),
        declarations=declarations(),
        calls=calls(),
    )
    return replace(healthy, **changes)


def silent(**changes: Any) -> Recording:
    """A run in which nothing was recorded, else healthy."""
    return recording(**{"messages": {}, "ending": Ending.TIMEOUT, **changes})


def nodeless(**changes: Any) -> Recording:
    """A run in which no node of the student appeared."""
    defaults = {
        "nodes": (),
        "endpoints": (reader(),),
        "calls": (),
        "matched_ns": None,
        "ending": Ending.NO_NODE,
        "declarations": (declared("started"),),
    }
    return silent(**{**defaults, **changes})
