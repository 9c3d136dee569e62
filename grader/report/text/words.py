"""Words that every format uses: of a status, of points, of what a run ran in."""

from __future__ import annotations

from typing import NamedTuple

from grader.findings.finding import Status
from grader.recording.model import Ending


class StatusWords(NamedTuple):
    """A status for people; the symbol tells it without colour, and in ASCII too."""

    word: str
    symbol: str
    ascii: str


STATUS = {
    Status.PASSED: StatusWords("passed", "✓", "+"),
    Status.FAILED: StatusWords("failed", "✗", "x"),
    Status.SKIPPED: StatusWords("skipped", "–", "-"),
    Status.ERROR: StatusWords("error", "!", "!"),
}
HIDDEN_UNTIL = {
    "visible": "",
    "after_due_date": "for students after the due date",
    "after_published": "for students after grades are published",
    "hidden": "never shown to students",
}
ENVIRONMENT = {
    "ros_distro": "ROS distribution",
    "ros_source": "ROS from",
    "rmw": "RMW",
    "python": "Python",
    "sandbox": "Sandbox",
    "domain_id": "ROS domain",
    "cpus": "CPUs",
}
ENDINGS = {
    Ending.UNTIL: "everything that the scenario waits for was seen",
    Ending.TIMEOUT: "the time limit of the scenario passed",
    Ending.EXITED: "every process had ended by itself",
    Ending.NO_NODE: "no node appeared in time",
    Ending.NO_MATCH: "nodes appeared, but no expected publisher or subscription",
    Ending.NOT_STARTED: "nothing could be launched",
    Ending.FAULT: "the grader or the machine failed",
}
ADVICE = ("try next", "also")
"""What stands before the first piece of advice, and before every other."""


def number(value: float) -> str:
    """Points without needless digits: ``3``, ``2.5``."""
    return f"{value:.10g}"


def counted_points(points: float) -> str:
    """``1 point``, ``2.5 points``."""
    return f"{number(points)} point{'' if points == 1 else 's'}"


def cut(text: str, most: int) -> str:
    """The beginning of a text that is too long."""
    return text if len(text) <= most else f"{text[: most - 1]}…"
