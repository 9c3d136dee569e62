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
from grader.report.audience import Audience, written_for
from grader.report.html.page import environment
from grader.report.model.mistakes import only_shown
from grader.report.model.result_model import Result

_ENDINGS = {Status.FAILED: "failure", Status.ERROR: "error", Status.SKIPPED: "skipped"}


@written_for(Audience.INSTRUCTOR)
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
    template = environment().get_template("junit.xml.j2")
    return template.render(
        result=result,
        elements=elements,
        count=Counter(elements.values()),
        timestamp=timestamp[0] if timestamp else "",
        xunit1=int(xunit1),
    )
