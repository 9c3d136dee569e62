"""The HTML report: one file that needs no network, and no JavaScript to be read.

Whatever a student chose is untrusted: every value is cleaned of control characters and escaped
on its way into the page, and the page's own policy forbids requests and every script and style
but its own, which it names by their hashes.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from grader import resources
from grader.checks.finding import Status
from grader.checks.wording import counted
from grader.grade.model import Grade
from grader.recording.model import NS, Recording
from grader.report.drawing.callbacks import draw_callbacks
from grader.report.drawing.cases import draw_cases
from grader.report.html.build_log import arrange
from grader.report.html.comparison import align
from grader.report.html.pictures import Gallery, draw_run, draw_shares
from grader.report.html.policy import content_security_policy
from grader.report.html.replay import Replay, embedded, make_replay, with_goals
from grader.report.model.facts import RunFacts
from grader.report.model.remarks import remarks
from grader.report.model.sections import ENDINGS, make_sections, shorten
from grader.report.text import words
from grader.safe_text import clean

if TYPE_CHECKING:
    from jinja2 import Environment

NO_REFERENCE: Mapping[str, Replay] = {}


def render_report(
    grade: Grade,
    recordings: Mapping[str, Recording],
    facts: RunFacts,
    references: Mapping[str, Replay] = NO_REFERENCE,
) -> str:
    """Render the report of one submission.

    Args:
        recordings: By scenario id; may lack scenarios that were not run.

    Returns:
        A whole HTML document; the same input gives the same text.
    """
    sections = make_sections(grade, recordings)
    runs = [section.recording for section in sections if section.recording]
    replays = {
        section.scenario.id: made
        for section in sections
        if section.scenario is not None
        and section.recording is not None
        and (made := make_replay(section.recording, section.scenario)) is not None
    }
    style, script = asset("report.css"), asset("report.js")
    return (
        environment()
        .get_template("report.html.j2")
        .render(
            grade=grade,
            facts=facts,
            sections=sections,
            pictures={
                section.id: draw_run(grade, section, alone=len(runs) == 1) for section in sections
            },
            gallery=Gallery(),
            shares=draw_shares(grade.results),
            replays={
                name: embedded(
                    {
                        "student": with_goals(own, grade.assignment, name),
                        "reference": with_goals(references[name], grade.assignment, name)
                        if name in references
                        else None,
                    }
                )
                for name, own in replays.items()
            },
            told={run.scenario for run in runs},
            runs=runs,
            faults=_faults(grade),
            style=Markup(style),
            script=Markup(script),
            policy=content_security_policy(style, script),
        )
    )


@cache
def asset(name: str) -> str:
    """A style or script of the pages."""
    return (resources.templates() / name).read_text(encoding="utf-8")


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


@cache
def environment() -> Environment:
    """The templates, with all that they call; whatever they print is cleaned and escaped."""
    # Imported late: the commands that write no report start faster without it.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    from grader.report.html.compiled import CompiledTemplates

    environment = Environment(
        loader=FileSystemLoader(resources.templates()),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_cleaned,
        bytecode_cache=CompiledTemplates(resources.cache_folder() / "templates"),
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
        limit_reached=words.limit_reached,
        remarks=remarks,
        counted=counted,
        tally=words.tally,
        points_waiting=words.points_waiting,
        waiting=words.waiting,
        align=align,
        arrange=arrange,
        draw_callbacks=draw_callbacks,
        draw_cases=draw_cases,
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
    return recording.stolen_s(recording.launched_ns, recording.end_ns) * 1e3
