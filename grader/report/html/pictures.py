"""The pictures of a report: which are drawn, and none of them twice."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.checks.finding import Moment, Plot, Status
from grader.grade.model import CheckResult, Grade
from grader.report.drawing.motion import draw_motion
from grader.report.drawing.path import draw_path
from grader.report.drawing.plot import draw_plot
from grader.report.drawing.svg import Figure, element
from grader.report.drawing.timeline import draw_timeline
from grader.report.html.qos_table import Pair, pairs
from grader.report.model.sections import Section
from grader.report.model.target import targets

NO_POINTS = 0.15
"""Width of a check without points, as if it gave these."""


@dataclass(frozen=True)
class Pictures:
    """What is shown of a run; None or nothing where there is nothing to show.

    Attributes:
        open: Whether they are shown at once: something was lost in this run, or a limit reached.
    """

    open: bool
    path: Figure | None
    motion: Figure | None
    timeline: Figure | None
    qos: tuple[Pair, ...]


@dataclass(frozen=True)
class Drawn:
    """A plot of a finding: drawn now, or where it is drawn already."""

    name: str
    figure: Figure | None


class Gallery:
    """The plots of one report; checks of the same run often show the same."""

    def __init__(self) -> None:
        """Start empty."""
        self._names: dict[tuple[Plot, str | None], str] = {}
        self._folded: set[str] = set()

    def plot(self, plot: Plot, name: str, scenario: str | None, *, folded: bool = False) -> Drawn:
        """Draw a plot, or say where it is.

        Args:
            folded: Whether the finding is folded up at first. One that is not shows its plot,
                even if one that is has it too.
        """
        known = self._names.get((plot, scenario))
        if known is not None and (folded or known not in self._folded):
            return Drawn(known, None)
        self._names[plot, scenario] = name
        if folded:
            self._folded.add(name)
        return Drawn(name, draw_plot(plot, name))


def draw_run(grade: Grade, section: Section, *, alone: bool) -> Pictures | None:
    """Draw what there is of a section's run, or None where it has none."""
    if section.scenario is None or section.recording is None:
        return None
    name, recording = section.scenario.id, section.recording
    return Pictures(
        alone or bool(recording.breaches) or _is_lost(grade.results, name),
        draw_path(recording, targets(grade.assignment, name, recording.values), f"path-{name}"),
        draw_motion(recording, f"motion-{name}"),
        draw_timeline(recording, _moments(grade, name), f"line-{name}"),
        pairs(recording),
    )


def draw_shares(results: Sequence[CheckResult]) -> Markup:
    """Draw the checks as parts of a bar, as wide as their points."""
    widths = [max(result.max_points, NO_POINTS) for result in results]
    scale = 1000.0 / (sum(widths) or 1.0)
    parts, x = [], 0.0
    for result, width in zip(results, widths, strict=True):
        parts.append(
            element(
                "rect",
                x=x,
                y=1,
                width=max(1.0, width * scale - 4.0),
                height=10,
                class_=f"part is-{result.status.value}",
            )
        )
        x += width * scale
    return element(
        "svg",
        *parts,
        class_="shares",
        viewBox="0 0 1000 12",
        preserveAspectRatio="none",
        aria_hidden="true",
    )


def _is_lost(results: Sequence[CheckResult], scenario: str) -> bool:
    return any(
        item.scenario == scenario and item.finding.status in (Status.FAILED, Status.ERROR)
        for result in results
        for item in result.findings
    )


def _moments(grade: Grade, scenario: str) -> tuple[Moment, ...]:
    """Times that findings which did not pass point at."""
    return tuple(
        moment
        for result in grade.results
        for item in result.findings
        if item.scenario == scenario and item.finding.status is not Status.PASSED
        for moment in item.finding.evidence.moments
        if math.isfinite(moment.time_s)
    )
