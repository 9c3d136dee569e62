"""Write JUnit XML.

A check is a test case.

A check that failed is a ``failure``, a fault of ours an ``error``, a check that waits for
another is ``skipped``. So is one that failed without points, or full points would look like a
mistake. The default family, xunit2, is what Jenkins' junit-10.xsd allows; xunit1
adds the student's file and line and the points to each test case, which that schema forbids.
Source: https://github.com/jenkinsci/xunit-plugin, ``junit-10.xsd``.
"""

from __future__ import annotations

import re
from collections import Counter
from xml.etree import ElementTree as ET

from grader.checks.finding import Status
from grader.report.formats.options import DEFAULTS, FormatOptions
from grader.report.model.result_model import CheckPart, Result
from grader.report.text import explanation
from grader.report.text.words import number
from grader.safe_text import clean, one_line

_ELEMENT = {Status.FAILED: "failure", Status.ERROR: "error", Status.SKIPPED: "skipped"}
_TYPE = {Status.FAILED: "check", Status.ERROR: "grader", Status.SKIPPED: "requirement"}
_WITHOUT_POINTS = "no points"


def render(result: Result, options: FormatOptions = DEFAULTS) -> str:
    """The whole file."""
    shown = explanation.only_shown(result)
    elements = {
        check.id: _ELEMENT[Status.SKIPPED if check.id in shown else check.status]
        for check in result.checks
        if check.status is not Status.PASSED
    }
    count = Counter(elements.values())
    counts = {
        "tests": str(len(result.checks)),
        "failures": str(count[_ELEMENT[Status.FAILED]]),
        "errors": str(count[_ELEMENT[Status.ERROR]]),
    }
    name, time = one_line(result.assignment.id), f"{result.duration_s:.3f}"
    root = ET.Element("testsuites", {"name": name, **counts, "time": time})
    suite = ET.SubElement(
        root,
        "testsuite",
        {"name": name, **counts, "skipped": str(count[_ELEMENT[Status.SKIPPED]]), "time": time},
    )
    # Without offset: the strictest of the dialects reads no other.
    if re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", result.started):
        suite.set("timestamp", result.started[:19])
    _properties(suite, _of_suite(result))
    for check in result.checks:
        _case(suite, result, check, elements.get(check.id), xunit1=options.xunit1)
    notes = [
        line
        for kind in explanation.notes_of_runs(result)
        for line in (f"{kind.title}:", *kind.lines)
    ]
    if notes:
        ET.SubElement(suite, "system-out").text = "\n".join(notes)
    ET.indent(root)
    text: str = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'


def _of_suite(result: Result) -> dict[str, str]:
    found = {
        "submission": result.submission.id,
        "score": number(result.score) if result.score is not None else "not graded",
        "max_score": number(result.max_score),
        "rosgrade": result.rosgrade_version,
    }
    if result.withheld.checks:
        found["hidden_checks"] = str(result.withheld.checks)
        found["hidden_points"] = number(result.withheld.points)
    found |= {f"points.{check.id}": explanation.points(check) for check in result.checks}
    found |= {f"environment.{name}": value for name, value in result.environment.items()}
    return found


def _properties(parent: ET.Element, values: dict[str, str]) -> None:
    element = ET.SubElement(parent, "properties")
    for name, value in values.items():
        ET.SubElement(element, "property", {"name": one_line(name), "value": one_line(value)})


def _case(
    suite: ET.Element, result: Result, check: CheckPart, element: str | None, *, xunit1: bool
) -> None:
    # What compares two runs knows a test by these two, so they say nothing of how it ended.
    attributes = {"classname": result.assignment.id, "name": check.id}
    place = next(iter(check.evidence.places), None)
    if xunit1 and place is not None:
        attributes["file"] = one_line(place.file)
        if place.line:
            attributes["line"] = str(place.line)
    case = ET.SubElement(suite, "testcase", {k: one_line(v) for k, v in attributes.items()})
    if xunit1:
        _properties(case, {"points": explanation.points(check), "title": check.title})
    if element is None:
        return
    message = one_line(f"{check.title}: {check.observed}")
    kind = _TYPE[check.status] if element == _ELEMENT[check.status] else _WITHOUT_POINTS
    verdict = ET.SubElement(case, element, {"type": kind, "message": message})
    if check.status is not Status.SKIPPED:
        body = [
            f"points: {explanation.points(check)}",
            explanation.plain(check, result),
            check.traceback,
        ]
        verdict.text = clean("\n".join(part for part in body if part))
