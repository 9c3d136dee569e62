"""Recordings and submissions made by hand: a healthy one, and the pieces to spoil it with.

All times are seconds since launch. ``recording()`` is a run of a good timed publisher: node
``/bot_publisher`` publishes a Twist (linear.x = 1.0, angular.z = 0.5) on ``/cmd_vel`` every
300 ms, answers calls, and ends 0.1 s after SIGINT.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from grader.assignment.lesson_checks import all_checks
from grader.findings.finding import Finding, Status
from grader.recording.event import Disturbance
from grader.recording.model import (
    NS,
    Call,
    Declaration,
    Ending,
    Endpoint,
    Join,
    Kind,
    LogLine,
    Message,
    Node,
    Owner,
    Process,
    Qos,
    Recording,
)
from grader.recording.simulated import Filmed, Incident, Scene, Truth
from grader.recording.submission import (
    BuildRecord,
    Dependency,
    Import,
    PackageRecord,
    SubmissionRecord,
)
from sim.description import SimulatorOptions
from sim.lidar import Scan
from sim.motion import Pose, Twist
from sim.odometry import OdometrySample
from sim.simulation import Simulation, make_simulation
from sim.world import parse_world

CHECKS = all_checks()
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
    entry = CHECKS[check]
    finding = entry.judge(subject, entry.parameters.model_validate(parameters))
    assert finding.status is not Status.FAILED or leads_somewhere(finding, subject), finding
    return finding


def text(finding: Finding) -> str:
    """Everything a student reads of a finding."""
    return f"{finding.observed} | {finding.hint}"


def leads_somewhere(finding: Finding, subject: Recording | SubmissionRecord) -> bool:
    """Whether a finding about a run says where in its recording, or in which file, to look."""
    if not isinstance(subject, Recording) or not subject.processes:
        return True
    if subject.ending is Ending.NOT_STARTED:
        return True
    evidence = finding.evidence
    return bool(evidence.moments or evidence.spans or evidence.places)


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
    **more: Any,
) -> Endpoint:
    """A publisher (or a subscription) in the graph."""
    gid = f"{topic}{node}{kind.value}{appeared_s}".encode().hex()
    return Endpoint(kind, topic, type, node, owner, qos, gid, at(appeared_s), **more)


def reader(topic: str = "/cmd_vel", type: str = TWIST, qos: Qos = RELIABLE) -> Endpoint:
    """The probe's subscription."""
    return endpoint(
        topic, kind=Kind.SUBSCRIPTION, type=type, node="/probe", owner=Owner.PROBE, qos=qos
    )


def senses(topic: str, type: str, qos: Qos = RELIABLE) -> tuple[Endpoint, Endpoint]:
    """A publisher of the robot, and the student's subscription to it."""
    robot = endpoint(topic, type=type, node="/probe", owner=Owner.PROBE)
    return robot, endpoint(topic, type=type, kind=Kind.SUBSCRIPTION, qos=qos)


def deaf(topic: str, type: str) -> tuple[Endpoint, Endpoint]:
    """The same, where the subscription requests more than the robot offers."""
    return senses(topic, type, replace(RELIABLE, durability="transient_local"))


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
    *,
    timer_s: float | None = PERIOD_S,
    spin: bool = True,
    depth: int = 10,
    name: str = BOT,
    exiting_ns: int | None = None,
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
    exiting_ns = at(STOP_S) + NS // 20 if exiting_ns is None else exiting_ns
    return (*found, Declaration(exiting_ns, name, "exiting", {}))


def sent(
    times_s: Iterable[float],
    topic: str = "/chatter",
    type: str = "std_msgs/msg/String",
    values: Iterable[Mapping[str, Any]] | None = None,
) -> dict[str, tuple[Message, ...]]:
    """What the probe published on a topic, numbered from 1; see ``Recording.sent``."""
    times = list(times_s)
    fields = [{"data": f"message {n}"} for n in range(len(times))] if values is None else values
    return {
        topic: tuple(
            message(t, value, sequence=n, topic=topic, type=type, received_s=t)
            for n, (t, value) in enumerate(zip(times, fields, strict=True), start=1)
        )
    }


def stimulus(
    topic: str = "/chatter", type: str = "std_msgs/msg/String", qos: Qos = RELIABLE
) -> Endpoint:
    """The probe's publisher of a stimulus."""
    return endpoint(topic, type=type, node="/probe", owner=Owner.PROBE, qos=qos, appeared_s=0.0)


def join(
    joined_s: float, topic: str = "/cmd_vel", matched_s: float | None = None, **changes: Any
) -> Join:
    """A late joiner called ``late`` that asks for what was before."""
    healthy = Join(
        name="late",
        topic=topic,
        type=TWIST,
        qos=Qos("reliable", "transient_local", "keep_last", 100),
        joined_ns=at(joined_s),
        matched_ns=at(joined_s + 0.02 if matched_s is None else matched_s),
    )
    return replace(healthy, **changes)


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
        declarations=declarations(exiting_ns=changes.get("stop_ns", at(STOP_S)) + NS // 20),
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
        "declarations": (declared("started"), declared("exiting", STOP_S + 0.05)),
    }
    return silent(**{**defaults, **changes})


# --- Runs with a simulated robot -----------------------------------------------------------

BEGAN_S = 0.5
DELAY_S = 0.001
ODOMETRY = "nav_msgs/msg/Odometry"
SCAN = "sensor_msgs/msg/LaserScan"


@dataclass(frozen=True)
class Senses:
    """What a controller knows: simulated time, and the newest of each sensor or None."""

    time_s: float
    odometry: OdometrySample | None
    scan: Scan | None
    new_odometry: bool
    new_scan: bool


Controller = Callable[[Senses], tuple[float, float] | None]
"""Called after every step of 10 ms; returns a command (linear, angular), or None for none."""


def on_odometry(law: Callable[[Pose], tuple[float, float]]) -> Controller:
    """A controller that works in the odometry callback."""

    def control(senses: Senses) -> tuple[float, float] | None:
        if not senses.new_odometry or senses.odometry is None:
            return None
        return law(senses.odometry.pose)

    return control


def on_timer(period_s: float, law: Callable[[Pose], tuple[float, float]]) -> Controller:
    """A controller that works in a timer, with the newest odometry."""
    ticks = [1]

    def control(senses: Senses) -> tuple[float, float] | None:
        if senses.odometry is None or senses.time_s < ticks[0] * period_s:
            return None
        ticks[0] += 1
        return law(senses.odometry.pose)

    return control


def on_scan(law: Callable[[list[float]], tuple[float, float]]) -> Controller:
    """A controller that works in the scan callback."""

    def control(senses: Senses) -> tuple[float, float] | None:
        if not senses.new_scan or senses.scan is None:
            return None
        return law([float(item) for item in senses.scan.ranges_m])

    return control


def drive(
    controller: Controller,
    *,
    world: str = "{}",
    seconds: float = 10.0,
    rest_s: float | None = 1.0,
    options: Mapping[str, Any] | None = None,
    **changes: Any,
) -> Recording:
    """Let a controller drive the simulated robot, and record it as a cell would.

    Args:
        controller: Who drives. Its commands arrive 1 ms after the data they were made from.
        world: The world's YAML.
        seconds: Simulated time at most.
        rest_s: The run ends when the robot has moved and been at rest for so long, or None.
        options: ``robot``, ``lidar`` and ``odometry`` as in YAML.
        changes: Fields of the recording to replace.
    """
    place = parse_world(world)
    simulation = make_simulation(
        place, SimulatorOptions.model_validate(dict(options or {})), seed=1
    )
    truth: list[Truth] = []
    incidents: list[Incident] = []
    found: dict[str, list[Message]] = {"/cmd_vel": [], "/odom": [], "/scan": []}
    command: Twist | None = None
    odometry, scan, moved, rested = None, None, False, 0
    for _ in range(round(seconds * 100)):
        step = simulation.advance(command)
        command = None
        time_s = BEGAN_S + step.time_ns / NS
        pose, velocity = step.pose, step.twist
        truth.append(
            Truth(
                at(time_s), pose.x_m, pose.y_m, pose.yaw_rad, velocity.linear_m_s,
                velocity.angular_rad_s, step.command.linear_m_s, step.command.angular_rad_s,
                step.contact,
            )
        )  # fmt: skip
        incidents += [Incident(at(time_s), event.kind.value, event.text) for event in step.events]
        if step.odometry is not None:
            odometry = step.odometry
            _record(found["/odom"], "/odom", ODOMETRY, time_s, _odometry_value(odometry, time_s))
        if step.scan is not None:
            scan = step.scan
            _record(found["/scan"], "/scan", SCAN, time_s, _scan_value(simulation, scan))
        said = controller(
            Senses(
                step.time_ns / NS, odometry, scan, step.odometry is not None, step.scan is not None
            )
        )
        if said is not None:
            command = Twist(*said)
            value = twist((said[0], 0, 0), (0, 0, said[1]))
            _record(found["/cmd_vel"], "/cmd_vel", TWIST, time_s + DELAY_S, value)
        resting = abs(velocity.linear_m_s) < 1e-3 and abs(velocity.angular_rad_s) < 1e-3
        moved |= not resting
        rested = rested + 1 if moved and resting else 0
        if rest_s is not None and rested >= rest_s * 100:
            break
    return simulated(
        truth,
        scene_of(simulation),
        incidents=tuple(incidents),
        messages={topic: tuple(items) for topic, items in found.items() if items},
        **changes,
    )


def simulated(truth: Sequence[Truth], scene: Scene, **changes: Any) -> Recording:
    """A healthy run with a simulated robot that ended with its last step."""
    end_s = (truth[-1].time_ns - LAUNCH_NS) / NS
    defaults: dict[str, Any] = {
        "truth": tuple(truth),
        "scenes": {"": scene},
        "stop_s": end_s,
        "end_s": end_s + 0.1,
        "matched_s": BEGAN_S,
        "processes": (process(exited_s=end_s + 0.1),),
        "messages": {},
        "calls": (),
    }
    return recording(**{**defaults, **changes})


def scene_of(simulation: Simulation) -> Scene:
    """World and robot as a cell records them."""
    model, camera = simulation.model, simulation.camera
    return Scene(
        radius_m=model.radius_m,
        max_linear_m_s=model.limits.speed_m_s,
        max_angular_rad_s=model.limits.angular_speed_rad_s,
        outlines={shape.label: tuple(shape.capsules) for shape in simulation.world.shapes},
        moving=simulation.world.moving,
        began_ns=at(BEGAN_S),
        lidar=simulation.lidar.options.pose,
        acceleration_m_s2=model.limits.acceleration_m_s2,
        lines=tuple(line.points for line in simulation.world.lines),
        filmed=Filmed(simulation.world.text, camera.options.model_dump_json(), camera.seed)
        if camera is not None
        else None,
    )


def _record(
    found: list[Message], topic: str, type: str, time_s: float, value: Mapping[str, Any]
) -> None:
    found.append(message(time_s, value, sequence=len(found) + 1, topic=topic, type=type))


def _stamp(time_s: float) -> dict[str, int]:
    sec, nanosec = divmod(at(time_s), NS)
    return {"sec": sec, "nanosec": nanosec}


def _odometry_value(sample: OdometrySample, time_s: float) -> dict[str, Any]:
    pose = sample.pose
    return {
        "header": {"stamp": _stamp(time_s), "frame_id": "odom"},
        "child_frame_id": "base_footprint",
        "pose": {
            "pose": {
                "position": {"x": pose.x_m, "y": pose.y_m, "z": 0.0},
                "orientation": {
                    "x": 0.0,
                    "y": 0.0,
                    "z": math.sin(0.5 * pose.yaw_rad),
                    "w": math.cos(0.5 * pose.yaw_rad),
                },
            }
        },
    }


def _scan_value(simulation: Simulation, scan: Scan) -> dict[str, Any]:
    lidar = simulation.lidar
    return {
        "angle_min": lidar.angle_min_rad,
        "angle_max": lidar.angle_max_rad,
        "angle_increment": lidar.angle_increment_rad,
        "range_min": lidar.options.range_min,
        "range_max": lidar.options.range_max,
        "ranges": [float(item) for item in scan.ranges_m],
    }
