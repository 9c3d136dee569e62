"""Checks of launch files: what is started with certain arguments, and which arguments there are."""

from __future__ import annotations

import re
from collections.abc import Iterable

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_node import why_no_node, why_not_node
from grader.diagnosis.process.process_exit import why_crashed
from grader.findings.finding import Evidence, Finding, Table, moment, nodes_seen
from grader.findings.words import code, codes
from grader.recording.model import Kind, Recording
from grader.spec.name import QualifiedNodeName, TopicName
from grader.spec.nearest_name import nearest

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


@check("launch.graph", Subject.RECORDING, Graph, concept="names")
def graph(recording: Recording, parameters: Graph) -> Finding:
    """Exactly the expected nodes are started, on the expected topics.

    Judged by the ROS graph of the whole run, so end the run with `until: {elapsed: 3 s}`, after all
    that may be started. Run a launch file in two scenarios with different `arguments`, and judge
    each, to see which nodes and topics come and go.
    """
    stop_if(why_no_node(recording))
    for name in parameters.nodes:
        stop_if(why_not_node(recording, name))
    started = {node.name for node in recording.written_nodes}
    evidence = Evidence(moments=nodes_seen(recording))
    others = started.difference(parameters.nodes)
    if others:
        return mistaken("more_nodes", f"{codes(sorted(others))} is started, too", evidence)
    topics = {
        endpoint.topic
        for kind in Kind
        for endpoint in recording.student_endpoints(kind)
        # A TransformListener in C++ subscribes with a node of its own.
        if (endpoint.node in parameters.nodes or "/_" not in endpoint.node)
        and "/_" not in endpoint.topic
    }.difference(_OF_EVERY_NODE)
    wanted = topics if parameters.topics is None else set(parameters.topics)
    if topics != wanted:
        lacking, beyond = codes(sorted(wanted - topics)), codes(sorted(topics - wanted))
        seen = f"lacking: {lacking or 'no topic'}; beyond that there is: {beyond or 'no topic'}"
        return mistaken("other_topics", seen, evidence)
    return Finding.as_asked(f"{codes(sorted(started))} and no other node", evidence)


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


_NO_DESCRIPTION = "no description given"
_ARGUMENT = re.compile(r"    '(?P<name>.+)':\*?")
_DEFAULT = re.compile(r" +\(default: (?P<default>.*)\)")


def shown_arguments(lines: Iterable[str]) -> dict[str, tuple[str, str]]:
    """What `ros2 launch --show-args` prints: name -> description and default, or empty texts."""
    found: dict[str, tuple[str, str]] = {}
    name = description = ""
    for line in lines:
        argument, default = _ARGUMENT.fullmatch(line), _DEFAULT.fullmatch(line)
        if argument:
            name, description = argument["name"], ""
            found[name] = ("", "")
        elif name and default:
            found[name] = (description, default["default"])
        elif name and line.startswith("     "):
            description = f"{description} {line.strip()}".strip()
            found[name] = (description, found[name][1])
    return found


@check("launch.arguments", Subject.RECORDING, Arguments)
def arguments(recording: Recording, parameters: Arguments) -> Finding:
    """The launch file declares its arguments, with defaults and descriptions.

    Judged by what `ros2 launch --show-args` prints. It needs a separate scenario with the launch
    `{file: robot.launch.py, arguments: [--show-args]}`.
    """
    lines = [line for line in recording.log if line.stream == "stdout"]
    if not any(line.text.startswith("Arguments (pass") for line in lines):
        stop_if(why_crashed(recording))
        return Finding.ours("the scenario does not run `ros2 launch --show-args`")
    shown = shown_arguments(line.text for line in lines)
    rows = tuple((name, default, description) for name, (description, default) in shown.items())
    table = Table("ros2 launch --show-args", ("argument", "default", "description"), rows)
    printed = moment(recording, "the arguments were shown", lines[-1].time_ns)
    evidence = Evidence(moments=(printed,), tables=(table,))
    there = f"it declares {codes(shown) or 'no argument'}"
    for name, wanted in parameters.arguments.items():
        description, default = shown.get(name, ("", ""))
        if name not in shown:
            near = nearest(name, shown)
            seen = f"there is no {code(name)}; {there}" + (f": {code(near)}?" if near else "")
        elif wanted is not None and not _is_default(default, wanted):
            seen = f"the default of {code(name)} is {default or 'missing'}"
        elif parameters.described and description in ("", _NO_DESCRIPTION):
            seen = f"{code(name)} has no description"
        else:
            continue
        value = "..." if wanted is None else wanted
        write = f"DeclareLaunchArgument('{name}', default_value='{value}', description='...')"
        return mistaken("other_argument", seen, evidence, argument=code(write))
    return Finding.as_asked(there, evidence)


def _is_default(shown: str, wanted: str | float | bool) -> bool:
    """Whether a default, as it is shown, is the one that is asked for."""
    text = shown.strip("'")
    try:
        return float(text) == float(wanted)
    except ValueError:
        return text.casefold() == str(wanted).casefold()
