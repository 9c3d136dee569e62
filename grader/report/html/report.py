"""The HTML report of one submission: one file that can be read without JavaScript."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from markupsafe import Markup

from grader.assignment.model import Scenario
from grader.findings.finding import Plot, Status
from grader.grade.model import Grade
from grader.recording.model import Recording
from grader.recording.one_robot import each_robot
from grader.recording.submission import BuildRecord
from grader.report.concepts import SCRIPT, STYLE, concepts
from grader.report.drawing.callbacks import draw_callbacks
from grader.report.drawing.cases import draw_cases
from grader.report.drawing.frames import draw_frames
from grader.report.drawing.motion import draw_motion
from grader.report.drawing.path import draw_path, targets
from grader.report.drawing.plot import draw_plot
from grader.report.drawing.svg import Figure
from grader.report.drawing.timeline import draw_timeline
from grader.report.drawing.turtles import draw_turtles, figures
from grader.report.html.film import make_film
from grader.report.html.page import render_page
from grader.report.html.replay import Replay, embedded, make_replay, with_goals
from grader.report.html.source_code import ShownSource
from grader.report.html.tables import SIGNS, align, pairs
from grader.report.model.excerpt import places, shorten
from grader.report.model.result_model import CheckPart, FindingPart, Result
from grader.report.text import explanation


@dataclass(frozen=True)
class Section:
    """Checks that belong together; of a scenario with its recording and all its findings."""

    id: str
    title: str
    checks: tuple[CheckPart, ...]
    scenario: Scenario | None = None
    recording: Recording | None = None
    findings: tuple[FindingPart, ...] = ()

    @property
    def lost(self) -> bool:
        """Whether something was lost in the run, or a limit reached."""
        reached = self.recording is not None and bool(self.recording.breaches)
        return reached or any(
            finding.status in (Status.FAILED, Status.ERROR) for finding in self.findings
        )

    @property
    def moments_s(self) -> list[float]:
        """Times that findings which did not pass point at, in seconds since launch."""
        return [
            moment.time_s
            for finding in self.findings
            if finding.status is not Status.PASSED
            for moment in finding.evidence.moments
            if math.isfinite(moment.time_s)
        ]


def make_sections(
    grade: Grade, result: Result, recordings: Mapping[str, Recording]
) -> list[Section]:
    """Group the checks of a result; sections in which all passed come last.

    A section without anything to show is left out.

    Args:
        grade: The whole grade; of checks that are not in the result nothing is shown.
    """
    judge = {one.id: one.scenarios for one in grade.results}
    is_copy = len(result.checks) < len(grade.results)
    seen = {name for check in result.checks for name in judge[check.id]}

    def of(*scenarios: str) -> tuple[CheckPart, ...]:
        return tuple(check for check in result.checks if judge[check.id] == scenarios)

    several = tuple(check for check in result.checks if len(judge[check.id]) > 1)
    sections = [
        Section("submission", "The submission", of()),
        Section("several", "In several scenarios", several),
    ]
    for scenario in grade.assignment.scenarios:
        title = scenario.title.rstrip(".") or f"Scenario {scenario.id}"
        # What no visible check judges, a student does not get to see.
        recording = None if is_copy and scenario.id not in seen else recordings.get(scenario.id)
        found = tuple(
            finding
            for check in result.checks
            for finding in check.findings
            if finding.scenario == scenario.id
        )
        checks = of(scenario.id)
        sections.append(Section(f"run-{scenario.id}", title, checks, scenario, recording, found))
    shown = [section for section in sections if section.checks or section.recording]
    return sorted(
        shown,
        key=lambda one: not one.lost and all(c.status is Status.PASSED for c in one.checks),
    )


CONTEXT = 6
"""Lines of a build log that are shown around the student's own."""
MOST_PLACES = 3
"""Places in the log that are shown before the whole of it."""


def render_report(
    grade: Grade,
    result: Result,
    recordings: Mapping[str, Recording],
    references: Mapping[str, Replay] = {},
    before: Mapping[str, Replay] = {},
    source: ShownSource | None = None,
) -> str:
    """Render the report of one submission.

    Args:
        grade: The whole grade.
        result: Its result or the student's copy of it: nothing else of the checks is shown.
        recordings: By scenario id; may lack scenarios that were not run.
        references: Runs of the reference by scenario id, ``before`` those of the attempt before.
        source: What is shown of the submission's source; by default nothing.
    """
    assignment = grade.assignment
    sections = make_sections(grade, result, recordings)
    named = {one.concept for check in result.checks for one in check.findings}
    pages = {name: page for name, page in concepts().items() if name in named}
    runs = [section.recording for section in sections if section.recording]
    return render_page(
        "report.html.j2",
        ("report.css", *([STYLE] if pages else ())),
        "report.js",
        *([SCRIPT] if pages else ()),
        title=assignment.title,
        result=result,
        # The first of all has none before it to be compared with.
        attempts=result.attempts if len(result.attempts) > 1 else (),
        first=next((one for one in result.checks if one.id == result.first_to_fix), None),
        concepts=pages,
        titles={check.id: check.title for check in result.checks},
        sections=sections,
        faults=_faults(result),
        replays=_replays(grade, sections, references, before),
        runs=runs,
        shown_runs={run.scenario for run in runs},
        files={run.id: run.recording for run in result.scenarios},
        remarks={run.id: run.remarks for run in result.scenarios},
        gallery=Gallery(),
        source=source or ShownSource({}, None),
        places=places,
        same_as=explanation.same_as(result),
        SIGNS=SIGNS,
        align=align,
        build_lines=build_lines,
        draw_callbacks=draw_callbacks,
        draw_cases=draw_cases,
        draw_frames=draw_frames,
        draw_motion=draw_motion,
        draw_path=draw_path,
        draw_timeline=draw_timeline,
        each_robot=each_robot,
        draw_turtles=draw_turtles,
        figures=partial(figures, assignment),
        pairs=pairs,
        targets=partial(targets, assignment),
        shorten=shorten,
    )


class Gallery(dict[tuple[Plot, str | None, bool], str]):
    """The plots of one report by where they are drawn; checks of a run often show the same."""

    def plot(
        self, plot: Plot, name: str, scenario: str | None, *, folded: bool = False
    ) -> tuple[str, Figure | None]:
        """Draw a plot, or only name the figure that shows it already, and not folded up."""
        known = self.get((plot, scenario, False)) or self.setdefault((plot, scenario, folded), name)
        return known, draw_plot(plot, name) if known == name else None


def _faults(result: Result) -> list[str]:
    """Why something could not be judged, each cause once; of a question also how to answer it."""
    findings = [finding for check in result.checks for finding in check.findings]
    errors = (one for one in findings if one.status is Status.ERROR)
    return list(
        dict.fromkeys(f"{one.observed}. {one.hint}" if one.asks else one.observed for one in errors)
    )


def _replays(
    grade: Grade,
    sections: list[Section],
    references: Mapping[str, Replay],
    before: Mapping[str, Replay],
) -> dict[str, Markup]:
    found: dict[str, Markup] = {}
    for section in sections:
        if section.scenario is None or section.recording is None:
            continue
        name, own = section.scenario.id, make_replay(section.recording, section.scenario)
        if own is not None:
            all_ = {"student": own, "reference": references.get(name), "before": before.get(name)}
            roles = {
                role: with_goals(replay, grade.assignment, name) if replay else None
                for role, replay in all_.items()
            }
            found[name] = embedded({**roles, "film": make_film(section.recording)})
    return found


def build_lines(build: BuildRecord) -> list[tuple[str, bool]]:
    """The lines of a build log around the student's own mistake, each with whether it names it.

    The first lines that name the file (and the line, if one is known) or repeat the message;
    nothing where the log tells nothing of it.
    """
    lines, culprit = build.log.splitlines(), build.culprit
    if culprit is None:
        return []
    file = culprit.file.rpartition("/")[2]
    place = (f":{culprit.line}", f"line {culprit.line}") if culprit.line else ("",)
    named = [i for i, text in enumerate(lines) if file in text and any(p in text for p in place)]
    quoting = [i for i, text in enumerate(lines) if culprit.message and culprit.message in text]
    hits = sorted({*named[:MOST_PLACES], *quoting[:1]})
    if not hits:
        return []
    begin = max(0, hits[0] - 2)
    end = min(len(lines), hits[-1] + CONTEXT, begin + 4 * CONTEXT)
    return [(lines[i], i in hits) for i in range(begin, end)]
