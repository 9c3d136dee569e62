"""A parameter file for another node than there is, in a run of a launch file."""

from __future__ import annotations

import pytest

from grader.diagnosis.no_parameter import why_not_taken
from grader.findings.finding import Status
from grader.recording.submission import ParameterFile
from grader.submission.read.parameter_file import nodes_in
from tests.checks.builder import failing, judge, node, package, process, recording, submission


def launched(text, *nodes, program="bringup.launch.py"):
    files = (ParameterFile("config/driver.yaml", nodes_in(text)),)
    handed_in = submission(package(executables=("driver", "monitor")), parameter_files=files)
    return recording(
        submission=handed_in,
        nodes=tuple(map(node, nodes)),
        processes=(process(f"bot_publisher/{program}"),),
    )


def of(name, tag="ros__parameters"):
    return f"{name}:\n  {tag}:\n    turn: 0.3\n"


@pytest.mark.parametrize(
    ("text", "nodes"),
    [
        (of("/lab/driver"), {"/lab/driver": 2}),
        (of("driver"), {"/driver": 2}),
        (of("/**"), {"/**": 2}),
        ("lab:\n  driver:\n    ros__parameters: {turn: 0.3}\n", {"/lab/driver": 3}),
        (of("a") + of("b"), {"/a": 2, "/b": 5}),
        (of("a", "ros_parameters"), {}),
        ("a: &a\n  b: *a\n", {}),
        ("a: [", {}),
        ("[" * 5000, {}),
        ("", {}),
    ],
)
def test_a_parameter_file_tells_for_which_nodes_it_is(text, nodes):
    assert dict(nodes_in(text)) == nodes


@pytest.mark.parametrize(
    ("text", "node_name"),
    [
        (of("/lab/drivr"), "/lab/driver"),
        (of("driver"), "/lab/driver"),
        (of("/robot2/driver"), "/robot1/driver"),
    ],
)
def test_a_file_for_another_node_is_named_with_the_name_that_is_right(text, node_name):
    run = launched(text, node_name, "/launch_ros_123")
    found = failing("parameter.given", run)
    assert "`config/driver.yaml` gives values to `/" in found
    assert f"found `{node_name}`" in found and f"Write `{node_name}` in this file" in found
    assert judge("parameter.given", run).evidence.places[0].line == 2


@pytest.mark.parametrize(
    "text",
    [
        of("/lab/driver"),
        of("/**"),
        of("/*/driver"),
        of("/**/driver"),
        of("monitor"),
        of("turtlesim"),
        of("monitor") + of("/lab/driver"),
        # Of two robots only one runs.
        of("/lab/driver") + of("/other/driver"),
        of("amcl") + of("planner_server"),
    ],
)
def test_a_file_that_is_for_the_node_or_for_a_program_that_does_not_run_is_right(text):
    run = launched(text, "/lab/driver")
    assert judge("parameter.given", run).status is Status.PASSED


def test_a_file_matters_only_where_a_launch_file_may_use_it():
    assert why_not_taken(launched(of("drivr"), "/driver", program="driver"), ()) is None
    assert why_not_taken(launched(of("drivr")), ()) is None
