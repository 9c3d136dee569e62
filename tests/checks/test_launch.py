"""Checks of launch files: the graph that they start, and the arguments that they declare."""

from __future__ import annotations

from grader.findings.finding import Status
from grader.recording.model import Ending, Kind, Recording
from tests.checks.builder import (
    died,
    endpoint,
    failing,
    judge,
    node,
    output,
    process,
    recording,
)

FILE = "bot_bringup/robot.launch.py"
SHOWN = """\
Arguments (pass arguments as '<name>:=<value>'):

    'robot':
        Namespace of the
        nodes
        (default: 'robot1')

    'speed':
        no description given
        (default: '0.20')

    'goal':*
        Where to go
        (default: LaunchConfig('home'))

* argument(s) which are only used if specific conditions occur"""


def started(*names: str, topics: tuple[str, ...] = ("/cmd_vel",)) -> Recording:
    """A run in which nodes were started; the first publishes."""
    ends = [endpoint(topic, node=names[0]) for topic in topics]
    return recording(nodes=tuple(map(node, names)), endpoints=tuple(ends))


def shown(text: str) -> Recording:
    """A run of `ros2 launch --show-args`."""
    log = output(text, stream="stdout", name=FILE)
    return recording(processes=(process(FILE),), log=log, nodes=(), ending=Ending.EXITED)


def test_the_nodes_that_are_asked_for_and_no_others_pass() -> None:
    run = started("/robot1/driver", "/robot1/monitor")
    assert (
        judge("launch.graph", run, nodes=["/robot1/driver", "/robot1/monitor"]).status
        is Status.PASSED
    )
    assert "`/robot1/monitor` is started, too" in failing(
        "launch.graph", run, nodes=["/robot1/driver"]
    )


def test_a_node_that_is_not_started_is_named() -> None:
    text = failing("launch.graph", started("/driver"), nodes=["/driver", "/monitor"])
    assert "`/driver`" in text


LISTENER = "/transform_listener_impl_55d0ac2bf090"


def test_nodes_of_ros2_itself_do_not_count() -> None:
    run = started("/driver", "/launch_ros_4711", "/_ros2cli_12", LISTENER)
    assert judge("launch.graph", run, nodes=["/driver"]).status is Status.PASSED


def test_what_the_node_of_a_transform_listener_in_cpp_subscribes_to_counts() -> None:
    ends = (
        endpoint("/tf", kind=Kind.SUBSCRIPTION, node=LISTENER),
        endpoint("/cmd_vel", kind=Kind.SUBSCRIPTION, node="/_ros2cli_12"),
    )
    run = recording(nodes=(node("/driver"), node(LISTENER)), endpoints=ends)
    for topics, status in ((["/tf"], Status.PASSED), ([], Status.FAILED)):
        assert judge("launch.graph", run, nodes=["/driver"], topics=topics).status is status


def test_topics_that_lack_or_are_too_many_are_named() -> None:
    run = started("/driver", topics=("/cmd_vel", "/rosout", "/fibonacci/_action/status"))
    assert (
        judge("launch.graph", run, nodes=["/driver"], topics=["/cmd_vel"]).status is Status.PASSED
    )
    text = failing("launch.graph", run, nodes=["/driver"], topics=["/base/cmd_vel"])
    assert "lacking: `/base/cmd_vel`; beyond that there is: `/cmd_vel`" in text
    heard = endpoint("/scan", kind=Kind.SUBSCRIPTION, node="/bot_publisher")
    text = failing(
        "launch.graph", recording(endpoints=(heard,)), nodes=["/bot_publisher"], topics=[]
    )
    assert "beyond that there is: `/scan`" in text


def test_declared_arguments_pass_whatever_the_form_of_their_defaults() -> None:
    wanted = {"robot": "robot1", "speed": 0.2, "goal": None}
    finding = judge("launch.arguments", shown(SHOWN), arguments=wanted)
    assert finding.status is Status.PASSED
    assert "Namespace of the nodes" in finding.evidence.tables[0].rows[0]


def test_another_default_no_description_and_a_misspelt_name_fail() -> None:
    run = shown(SHOWN)
    assert "default of `speed` is '0.20'" in failing(
        "launch.arguments", run, arguments={"speed": 0.3}
    )
    assert "`speed` has no description" in failing(
        "launch.arguments", run, arguments={"robot": None, "speed": None}, described=True
    )
    assert "there is no `speeed`" in failing("launch.arguments", run, arguments={"speeed": None})


def test_booleans_are_compared_as_launch_reads_them() -> None:
    run = shown(SHOWN.replace("'0.20'", "'False'"))
    assert judge("launch.arguments", run, arguments={"speed": False}).status is Status.PASSED


def test_a_launch_file_without_arguments_fails() -> None:
    text = f"{SHOWN.splitlines()[0]}\n\n  No arguments."
    assert "declares no argument" in failing(
        "launch.arguments", shown(text), arguments={"robot": None}
    )


def test_a_launch_file_that_raises_has_no_arguments_to_show() -> None:
    run = recording(processes=(died(1, name=FILE),), nodes=(), ending=Ending.EXITED)
    assert "exit code 1" in failing("launch.arguments", run, arguments={"robot": None})


def test_a_scenario_that_shows_no_arguments_is_the_authors_mistake() -> None:
    finding = judge("launch.arguments", recording(), arguments={"robot": None})
    assert finding.status is Status.ERROR
