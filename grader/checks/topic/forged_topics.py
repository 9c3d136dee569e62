"""The check that a submission does not speak for the robot."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.first_seen import nodes_seen
from grader.checks.wording import code, codes
from grader.diagnosis.no_node import why_no_node
from grader.recording.model import Kind, Recording
from grader.spec.name import TopicName

PROBE = "rosgrade_probe"
"""Name of the node through which a run is watched."""


class Untouched(Parameters):
    """Parameters of topic.untouched."""

    topics: tuple[TopicName, ...] = Field(
        ("/odom", "/scan", "/clock", "/tf", "/tf_static"),
        description="Topics that belong to the robot.",
    )


@check("topic.untouched", Subject.RECORDING, Untouched)
def untouched(recording: Recording, parameters: Untouched) -> Finding:
    """Only the robot publishes its sensors.

    Judged by the ROS graph: no node of the student has a publisher on a topic of the robot, or
    the name of the node that watches the run. Motion is judged by the simulator itself, so
    that publishing there could gain nothing.
    """
    expected = f"no publisher on {codes(parameters.topics, last='or')}"
    missing = why_no_node(recording)
    if missing is not None:
        return missing.finding(expected)
    for endpoint in recording.student_endpoints(Kind.PUBLISHER):
        if endpoint.topic in parameters.topics:
            when_s = recording.since_launch_s(endpoint.appeared_ns)
            return Finding.failed(
                expected,
                f"the node {code(endpoint.node)} publishes on {code(endpoint.topic)}, which "
                "belongs to the robot",
                "To read the sensor use create_subscription; what you compute goes to a topic of "
                "your own.",
                Evidence(moments=(Moment(f"publisher on {endpoint.topic} appeared", when_s),)),
            )
    for node in recording.student_nodes:
        if node.name.rpartition("/")[2] == PROBE:
            return Finding.failed(
                expected,
                f"a node of the submission is called {code(node.name)}, which is the name of the "
                "node that watches the run",
                "Give your node the name that the assignment asks for.",
                Evidence(moments=nodes_seen(recording)),
            )
    return Finding.passed(expected, "none")
