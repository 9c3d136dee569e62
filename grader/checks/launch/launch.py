"""Checks of launch files: what is started with certain arguments, and which arguments there are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_node import why_no_node, why_not_node
from grader.diagnosis.process.process_exit import why_crashed
from grader.findings.finding import Evidence, Finding, Moment, Table
from grader.findings.first_seen import endpoints_seen, nodes_seen
from grader.findings.wording import code, codes
from grader.measure.declarations import process_of
from grader.recording.model import NS, Endpoint, Kind, Recording
from grader.spec.name import QualifiedNodeName, TopicName
from grader.spec.nearest_name import nearest
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

# Of `ros2 launch` itself, and what the commands of ros2 hide.
_OF_ROS2 = re.compile(r"/(.*/)?(_.*|launch_ros_\d+)")
# The report of the first may have been read late.
_EARLIER_S = 0.3
_OF_EVERY_NODE = ("/rosout", "/parameter_events", "/clock")


class Graph(Parameters):
    """Parameters of launch.graph."""

    nodes: tuple[QualifiedNodeName, ...] = Field(
        min_length=1, description="Names of all nodes that are started: these, and no others."
    )
    topics: tuple[TopicName, ...] | None = Field(
        None,
        description="All topics on which they publish or to which they subscribe, and no others "
        "but `/rosout`, `/parameter_events` and `/clock`; by default any.",
    )

    def _asked(self) -> str:
        topics = f", with the topics {codes(self.topics)} only" if self.topics is not None else ""
        return f"{codes(self.nodes)} and no other node{topics}"


@check("launch.graph", Subject.RECORDING, Graph)
def graph(recording: Recording, parameters: Graph) -> Finding:
    """Exactly the expected nodes are started, on the expected topics.

    Judged by the ROS graph of the whole run, so end the run with `until: {elapsed: 3 s}`, after all
    that may be started. Run a launch file in two scenarios with different `arguments`, and judge
    each, to see which nodes and topics come and go.
    """
    stop_if(why_no_node(recording))
    for name in parameters.nodes:
        stop_if(why_not_node(recording, name))
    nodes = [one for one in recording.student_nodes if not _OF_ROS2.fullmatch(one.name)]
    more = [one for one in nodes if one.name not in parameters.nodes]
    if more:
        return Finding.failed(
            parameters.asked_for,
            f"{codes(sorted({one.name for one in more}))} is started, too",
            "Look for a condition such as IfCondition that is missing or reversed, and for names "
            "and namespaces that are written in the launch file instead of taken from an argument.",
            Evidence(moments=nodes_seen(recording)),
        )
    found = {one.topic: one for one in _endpoints(recording)}
    if parameters.topics is not None and found.keys() != set(parameters.topics):
        lacking = codes(sorted(set(parameters.topics) - found.keys()))
        others = codes(sorted(found.keys() - set(parameters.topics)))
        parts = [f"there is no {lacking}"] * bool(lacking) + [f"there is {others}"] * bool(others)
        return Finding.failed(
            parameters.asked_for,
            " and ".join(parts),
            "Look at `remappings` and `namespace` of the nodes in the launch file.",
            Evidence(moments=endpoints_seen(recording, list(found.values()))),
        )
    started = f"{codes(sorted({one.name for one in nodes}))} and no other node"
    return Finding.passed(parameters.asked_for, started, Evidence(moments=nodes_seen(recording)))


def _endpoints(recording: Recording) -> Iterator[Endpoint]:
    for kind in (Kind.PUBLISHER, Kind.SUBSCRIPTION):
        for one in recording.student_endpoints(kind):
            hidden = "/_" in one.topic or _OF_ROS2.fullmatch(one.node)
            if not hidden and one.topic not in _OF_EVERY_NODE:
                yield one


class Delay(Parameters):
    """Parameters of launch.delay."""

    node: QualifiedNodeName = Field(description="Name of the node that is started later.")
    at_least: Duration = Field(
        description="Least time after the first process that the launch file starts."
    )

    def _asked(self) -> str:
        delay = format_duration(self.at_least)
        return f"{code(self.node)} is started at least {delay} after the first process"


@check("launch.delay", Subject.RECORDING, Delay)
def delay(recording: Recording, parameters: Delay) -> Finding:
    """The node is started later than the others, such as by a TimerAction.

    Judged by the times at which `ros2 launch` reports the start of processes, so that it does not
    matter how long a node takes until it is there.
    """
    stop_if(why_not_node(recording, parameters.node))
    # A launch file is called package/file, what it starts has no slash.
    started = {one.name: one.started_ns for one in recording.processes if "/" not in one.name}
    process = process_of(recording, parameters.node)
    if process is None or process.name not in started:
        text = f"{code(parameters.node)} is not known to come from a launch file"
        return Finding.error(parameters.asked_for, text)
    later_s = (process.started_ns - min(started.values())) / NS
    moment = Moment(f"{process.name} started", recording.since_launch_s(process.started_ns))
    seen, evidence = f"it is started {later_s:.2f} s after it", Evidence(moments=(moment,))
    if later_s >= parameters.at_least - _EARLIER_S:
        return Finding.passed(parameters.asked_for, seen, evidence)
    hint = "Put its action into TimerAction(period=..., actions=[...]); the period is in seconds."
    return Finding.failed(parameters.asked_for, seen, hint, evidence)


class Arguments(Parameters):
    """Parameters of launch.arguments."""

    arguments: dict[str, str | float | bool | None] = Field(
        min_length=1,
        description="Name of each argument -> its default, or null where it does not matter.",
    )
    described: bool = Field(False, description="Whether each needs a description.")

    def _asked(self) -> str:
        described = ", each with a description" if self.described else ""
        return f"the launch file declares {codes(self.arguments)}{described}"


@dataclass(frozen=True)
class Argument:
    """A declared argument, as `ros2 launch --show-args` shows it."""

    description: str
    default: str | None

    def is_default(self, wanted: str | float | bool) -> bool:
        """Whether it is the default that is asked for; a substitution has no value yet."""
        shown = (self.default or "").strip("'")
        try:
            return float(shown) == float(wanted)
        except ValueError:
            return shown.casefold() == str(wanted).casefold()


_NO_DESCRIPTION = "no description given"
_HEADING = "Arguments (pass arguments as"
_ARGUMENT = re.compile(r"    '(?P<name>.+)':\*?")
_DEFAULT = re.compile(r" +\(default: (?P<default>.*)\)")


def shown_arguments(lines: Iterable[str]) -> dict[str, Argument] | None:
    """What `ros2 launch --show-args` prints; None where it printed nothing of it."""
    found: dict[str, Argument] | None = None
    name = ""
    for line in lines:
        argument, default = _ARGUMENT.fullmatch(line), _DEFAULT.fullmatch(line)
        if line.startswith(_HEADING):
            found = {}
        elif found is None:
            continue
        elif argument:
            name = argument["name"]
            found[name] = Argument("", None)
        elif default and name:
            found[name] = Argument(found[name].description, default["default"])
        elif line.strip() and name and not line.startswith("*"):
            text = f"{found[name].description} {line.strip()}".strip()
            found[name] = Argument(text, found[name].default)
    return found


@check("launch.arguments", Subject.RECORDING, Arguments)
def arguments(recording: Recording, parameters: Arguments) -> Finding:
    """The launch file declares its arguments, with defaults and descriptions.

    Judged by what `ros2 launch --show-args` prints. It needs a scenario of its own, whose launch is
    `{file: robot.launch.py, arguments: [--show-args]}`.
    """
    asked = parameters.asked_for
    lines = [line for line in recording.log if line.stream == "stdout"]
    shown = shown_arguments(line.text for line in lines)
    if shown is None:
        stop_if(why_crashed(recording))
        return Finding.error(asked, "the scenario does not run `ros2 launch --show-args`")
    rows = tuple((name, str(one.default), one.description) for name, one in shown.items())
    table = Table("ros2 launch --show-args", ("argument", "default", "description"), rows)
    printed = Moment("the arguments were shown", recording.since_launch_s(lines[-1].time_ns))
    evidence = Evidence(moments=(printed,), tables=(table,))
    cause = _wrong_argument(shown, parameters)
    if cause is not None:
        return Finding.failed(asked, cause.observed, cause.hint, evidence)
    return Finding.passed(asked, f"it declares {codes(shown)}", evidence)


def _wrong_argument(shown: dict[str, Argument], parameters: Arguments) -> Cause | None:
    for name, wanted in parameters.arguments.items():
        write = f"DeclareLaunchArgument('{name}', default_value='...', description='...')"
        one = shown.get(name)
        if one is None:
            there = f"it declares {codes(shown)}" if shown else "it declares no argument"
            near = nearest(name, shown)
            hint = f"{code(near)} is misspelt. " if near else ""
            return Cause(f"there is no {code(name)}; {there}", f"{hint}Write {code(write)}.")
        if wanted is not None and not one.is_default(wanted):
            is_ = f"is {one.default}" if one.default is not None else "is missing"
            return Cause(f"the default of {code(name)} {is_}", f"Write default_value='{wanted}'.")
        if parameters.described and one.description in ("", _NO_DESCRIPTION):
            return Cause(f"{code(name)} has no description", f"Write {code(write)}.")
    return None
