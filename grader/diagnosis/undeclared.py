"""Why the ROS graph and what a process declares of itself disagree."""

from __future__ import annotations

from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Evidence, Finding, Moment
from grader.findings.words import worded
from grader.measure import declarations
from grader.measure.declarations import was_held_up
from grader.recording.model import Recording


def why_undeclared(recording: Recording, what: str) -> Finding:
    """Why the process did not declare what the ROS graph shows of it.

    The tracer is in each program of Python that is started by its entry point, in each compiled one
    where the machine has a C compiler, and in the programs that these start.
    """
    seen = f"the process did not declare {what}"
    compiled = any(item.build_type == "ament_cmake" for item in recording.submission.packages)
    # Older recordings do not tell: there was no such tracer.
    compiled = compiled and recording.environment.get("compiled_tracer", "lacking") == "lacking"
    launched = any("launch" in item.name.rpartition("/")[2] for item in recording.processes)
    if not declarations.traced(recording) and (compiled or launched):
        why = worded(
            python="rosgrade sees this in Python programs only",
            cpp="rosgrade could not see into this program",
        )
        return Finding.ours(f"{seen}: {why}")
    return mistaken(
        "undeclared",
        f"{seen}: it was created without {worded('rclpy', 'rclcpp')}, or in a program that was "
        "started without the environment of the first, or after the file descriptors of rosgrade "
        "were closed",
        Evidence(moments=(Moment("launched", 0.0),)),
    )


def why_never_appeared(recording: Recording, what: str) -> Finding:
    """Why what the process declared is not in the ROS graph."""
    seen = f"the process declared {what}, but it never appeared in the ROS graph"
    names = declarations.changed_environment(recording)
    others = recording.environment.get("other_domains")
    if others:
        seen, names = f"the process joined ROS domain {others} and not its own", ["ROS_DOMAIN_ID"]
    if not names and was_held_up(recording):
        return Finding.undecided(f"{seen}, while the machine was busy")
    changed = f": the program changed {', '.join(names)}, which nodes use to find each other"
    cause = mistaken(
        "never_appeared",
        seen + (changed if names else ""),
        Evidence(moments=(Moment("launched", 0.0),)),
    )
    # What was created right before the end may not have been seen yet.
    return cause.doubted(not names)
