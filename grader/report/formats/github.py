"""What GitHub Actions reads: annotations, the job summary, outputs.

A line of output that begins with ``::`` is a command to the runner. What a student chose is
therefore escaped in our own commands, and printed only while commands are stopped by a token
that the student cannot know.
Sources: https://docs.github.com/actions/reference/workflow-commands-for-github-actions;
limits of annotations: actions/runner, ``ExecutionContext.cs``.
"""

from __future__ import annotations

import secrets

from grader.findings.finding import Status
from grader.report.audience import Audience, written_for
from grader.report.formats.markdown import render_markdown
from grader.report.model.excerpt import places
from grader.report.model.mistakes import only_shown
from grader.report.model.result_model import CheckPart, Result
from grader.report.text import explanation
from grader.report.text.words import number
from grader.spec.safe_text import one_line

MOST_ANNOTATIONS = 10
"""Of each kind and step; the runner drops what comes after."""
MOST_CHARACTERS = 4096
"""Of a message; the runner cuts what comes after."""
SUMMARY_BYTES = 1 << 20
"""Of the summary of a step; beyond it GitHub shows nothing of it."""
_LEFT_OUT = ("where", "printed")


@written_for(Audience.STUDENT)
def annotation_lines(result: Result, prefix: str | None = "") -> tuple[str, ...]:
    """Workflow commands that put the most useful findings at the student's lines.

    At most :data:`MOST_ANNOTATIONS` lines: the check to fix first, then those that cost the most
    points. What is not graded is one warning.

    Args:
        prefix: Folder of the submission in the repository, such as ``src/``; empty for its top,
            None where its files are not in the repository.
    """
    if not result.graded:
        return (command("warning", explanation.headline(result), title="Not graded"),)
    failed = [check for check in result.checks if check.status is Status.FAILED]
    failed.sort(key=lambda it: (it.id != result.first_to_fix, it.points - it.max_points))
    shown = only_shown(result.checks)
    return tuple(
        _annotation(check, result, "notice" if check.id in shown else "error", prefix)
        for check in failed[:MOST_ANNOTATIONS]
    )


@written_for(Audience.STUDENT)
def summary(result: Result, used_bytes: int = 0) -> str:
    """Markdown for ``$GITHUB_STEP_SUMMARY``."""
    return render_markdown(result, SUMMARY_BYTES - used_bytes)


@written_for(Audience.STUDENT)
def outputs(result: Result, delimiter: str = "") -> str:
    """Lines for ``$GITHUB_OUTPUT``.

    They set ``score`` (empty where there is none), ``max-score``, ``status`` (``passed`` with full
    points, ``failed`` without, ``error`` where there is no grade) and ``summary``.

    Args:
        delimiter: The line that ends a value; random by default, so that no value can hold it.
    """
    delimiter = delimiter or f"rosgrade_{secrets.token_hex(16)}"
    ended = "passed" if result.known_score == result.known_max_score else "failed"
    values = {
        "score": number(result.known_score) if result.known_score is not None else "",
        "max-score": number(result.known_max_score),
        "status": ended if result.graded else "error",
        "summary": explanation.headline(result),
    }
    return "".join(f"{name}<<{delimiter}\n{value}\n{delimiter}\n" for name, value in values.items())


def command(name: str, message: str, **properties: str) -> str:
    """Write a workflow command; its properties, such as ``file``, are decoded by the runner."""
    settings = ",".join(f"{key}={_property(value)}" for key, value in properties.items())
    return f"::{name}{' ' if settings else ''}{settings}::{_data(message[:MOST_CHARACTERS])}"


def _annotation(check: CheckPart, result: Result, level: str, prefix: str | None) -> str:
    properties: dict[str, str] = {}
    place = next(iter(places(check)), None)
    if place is not None and prefix is not None:
        properties["file"] = one_line(prefix + place.file)
        if place.line:
            properties["line"] = str(place.line)
    properties["title"] = one_line(f"{check.title} ({explanation.points(check)})")
    # The place is that of the annotation, and what was printed is too long for it.
    rows = [one for one in explanation.explain(check, result) if one.name not in _LEFT_OUT]
    return command(level, "\n".join(f"{row.name}: {row.text}" for row in rows), **properties)


def _data(text: str) -> str:
    # The percent sign first, or the escapes would be escaped.
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
