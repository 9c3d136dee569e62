"""The sections of a report: the submission, what holds in every scenario, each scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from grader.assignment.model import Scenario
from grader.grade.model import CheckResult, Grade
from grader.grade.points import total
from grader.recording.model import Ending, LogLine, Recording

KEPT_LINES = 150
"""Lines of output shown from the beginning, and again from the end."""
KEPT_CHARACTERS = 2000
"""Characters shown of a line."""

ENDINGS = {
    Ending.UNTIL: "everything that was waited for had been seen",
    Ending.TIMEOUT: "the time limit of the scenario passed",
    Ending.EXITED: "every process had ended by itself",
    Ending.NO_NODE: "no node appeared within the discovery limit",
    Ending.NO_MATCH: "nodes appeared, but no endpoint on a recorded topic",
    Ending.NOT_STARTED: "nothing could be launched",
    Ending.FAULT: "a fault of the grader or of the machine",
}


@dataclass(frozen=True)
class Output:
    """What the processes printed."""

    head: tuple[LogLine, ...]
    tail: tuple[LogLine, ...]
    left_out: int
    dropped_bytes: int

    @property
    def count(self) -> int:
        """Number of lines in all."""
        return len(self.head) + self.left_out + len(self.tail)


@dataclass(frozen=True)
class Section:
    """Checks that belong together.

    Attributes:
        scenario: The scenario, or None.
        recording: Its recording, or None where there is none.
    """

    id: str
    title: str
    results: tuple[CheckResult, ...]
    scenario: Scenario | None = None
    recording: Recording | None = None

    @property
    def points(self) -> float:
        """Points earned in it."""
        return total(result.points for result in self.results)

    @property
    def max_points(self) -> float:
        """Points that it gives."""
        return total(result.max_points for result in self.results)


def make_sections(grade: Grade, recordings: Mapping[str, Recording]) -> tuple[Section, ...]:
    """Group the results of a grade; a section without anything to show is left out."""
    of_submission = tuple(result for result in grade.results if not result.scenarios)
    of_several = tuple(result for result in grade.results if len(result.scenarios) > 1)
    sections = [
        Section("submission", "The submission", of_submission),
        Section("several", "In several scenarios", of_several),
    ]
    for scenario in grade.assignment.scenarios:
        results = tuple(result for result in grade.results if result.scenarios == (scenario.id,))
        title = scenario.title.rstrip(".") or f"Scenario {scenario.id}"
        recording = recordings.get(scenario.id)
        sections.append(Section(f"run-{scenario.id}", title, results, scenario, recording))
    return tuple(section for section in sections if section.results or section.recording)


def printed(recording: Recording) -> tuple[LogLine, ...]:
    """Lines that the processes wrote; /rosout only where there are none.

    rclpy writes each log message to stderr and to /rosout: shown together, all would be twice.
    """
    written = tuple(entry for entry in recording.log if entry.stream != "rosout")
    return written or recording.log


def shorten(recording: Recording) -> Output:
    """The output of a run, without its middle where it is long."""
    lines = tuple(replace(entry, text=_cut(entry.text)) for entry in printed(recording))
    dropped = sum(process.dropped_bytes for process in recording.processes)
    if len(lines) <= 2 * KEPT_LINES:
        return Output(lines, (), 0, dropped)
    left_out = len(lines) - 2 * KEPT_LINES
    return Output(lines[:KEPT_LINES], lines[-KEPT_LINES:], left_out, dropped)


def _cut(text: str) -> str:
    more = len(text) - KEPT_CHARACTERS
    return f"{text[:KEPT_CHARACTERS]}… ({more:,} more characters)" if more > 0 else text
