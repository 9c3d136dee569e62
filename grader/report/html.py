"""The HTML report: one file that needs no network and no JavaScript.

Whatever a student chose is untrusted: every value is cleaned of control characters and escaped
on its way into the page, and the page's own policy forbids scripts and requests besides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from grader import resources
from grader.checks.finding import Status
from grader.checks.wording import counted
from grader.grade.model import Grade
from grader.recording.model import NS, Recording
from grader.report import words
from grader.report.clean import clean
from grader.report.facts import RunFacts
from grader.report.plot import draw_plot
from grader.report.sections import ENDINGS, Section, make_sections, shorten
from grader.report.svg import Figure
from grader.report.timeline import draw_timeline

if TYPE_CHECKING:
    from jinja2 import Environment


def render_report(grade: Grade, recordings: Mapping[str, Recording], facts: RunFacts) -> str:
    """Render the report of one submission.

    Args:
        grade: The grade.
        recordings: By scenario id; may lack scenarios that were not run.
        facts: How the grade came about.

    Returns:
        A whole HTML document; the same input gives the same text.
    """
    sections = make_sections(grade, recordings)
    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            grade=grade,
            facts=facts,
            sections=sections,
            timelines={section.id: _timeline(grade, section) for section in sections},
            runs=[section.recording for section in sections if section.recording],
            faults=_faults(grade),
        )
    )


def _faults(grade: Grade) -> tuple[str, ...]:
    """What went wrong on our side, each cause once."""
    return tuple(
        dict.fromkeys(
            item.finding.observed
            for result in grade.results
            for item in result.findings
            if item.finding.status is Status.ERROR
        )
    )


def _timeline(grade: Grade, section: Section) -> Figure | None:
    if section.scenario is None or section.recording is None:
        return None
    moments = tuple(
        moment
        for result in grade.results
        for item in result.findings
        if item.scenario == section.scenario.id and item.finding.status is not Status.PASSED
        for moment in item.finding.evidence.moments
        if math.isfinite(moment.time_s)
    )
    return draw_timeline(section.recording, moments, f"line-{section.id}")


@cache
def _environment() -> Environment:
    # Imported late: the commands that write no report start faster without it.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(resources.templates()),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_cleaned,
    )
    environment.filters["prose"] = _prose
    environment.filters["number"] = words.number
    environment.globals.update(
        Status=Status,
        STATUS=words.STATUS,
        HIDDEN_UNTIL=words.HIDDEN_UNTIL,
        ENDINGS=ENDINGS,
        ENVIRONMENT=words.ENVIRONMENT,
        advice=words.advice,
        headline=words.headline,
        counted=counted,
        tally=words.tally,
        waiting=words.waiting,
        draw_plot=draw_plot,
        shorten=shorten,
        taken_ms=_taken_ms,
        run_s=lambda recording: (recording.end_ns - recording.launched_ns) / NS,
    )
    return environment


def _cleaned(value: Any) -> Any:
    return clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _prose(text: str) -> Markup:
    """Text of a finding, with what stands between backticks as code."""
    parts = clean(text).split("`")
    if len(parts) % 2 == 0:
        parts[-2:] = [f"{parts[-2]}`{parts[-1]}"]
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if index % 2 else escape(part)
        for index, part in enumerate(parts)
    )


def _taken_ms(recording: Recording) -> float:
    return recording.taken_s(recording.launched_ns, recording.end_ns) * 1e3
