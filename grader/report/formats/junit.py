"""Write JUnit XML.

A check is a test case.

A check that failed is a ``failure``, a check that could not be judged is an ``error``, a check that
waits for another is ``skipped``. So is one that failed without points, or full points would look
like a mistake. The default family, xunit2, is what Jenkins' junit-10.xsd allows; xunit1
adds the student's file and line and the points to each test case, which that schema forbids.
Source: https://github.com/jenkinsci/xunit-plugin, ``junit-10.xsd``.
"""

from __future__ import annotations

import re
from collections import Counter

from grader.findings.finding import Status
from grader.report.html.page import environment
from grader.report.model.mistakes import only_shown
from grader.report.model.result_model import Result
from grader.report.text import additions, explanation
from grader.report.text.words import number

_ENDINGS = {Status.FAILED: "failure", Status.ERROR: "error", Status.SKIPPED: "skipped"}
_TYPES = {"failure": "check", "error": "grader", "skipped": "requirement"}


def render(result: Result, *, xunit1: bool = False) -> str:
    """The whole file, in the dialect xunit2 or xunit1."""
    shown = only_shown(result.checks)
    elements = {
        check.id: "skipped" if check.id in shown else _ENDINGS[check.status]
        for check in result.checks
        if check.status is not Status.PASSED
    }
    # Without offset: the strictest of the dialects reads no other.
    timestamp = re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", result.started)
    notes = explanation.notes_of_runs(result)
    template = environment().get_template("junit.xml.j2")
    return template.render(
        result=result,
        elements=elements,
        count=Counter(elements.values()),
        endings=_ENDINGS,
        types=_TYPES,
        timestamp=timestamp[0] if timestamp else "",
        properties=_properties(result),
        xunit1=int(xunit1),
        notes=[
            *(line for kind in notes for line in (f"{kind.title}:", *kind.lines)),
            *map(additions.comment_line, result.comments),
        ],
    )


def _properties(result: Result) -> dict[str, str]:
    found = {
        "submission": result.submission.id,
        "score": number(result.known_score) if result.known_score is not None else "not graded",
        "max_score": number(result.known_max_score),
        "rosgrade": result.rosgrade_version,
    }
    if result.withheld.checks:
        found["hidden_checks"] = str(result.withheld.checks)
        found["hidden_points"] = number(result.withheld.points)
    found |= {f"points.{check.id}": explanation.points(check) for check in result.checks}
    added = enumerate(map(additions.line, result.adjustments), 1)
    found |= {f"adjustment.{index}": line for index, line in added}
    return found | {f"environment.{name}": value for name, value in result.environment.items()}
