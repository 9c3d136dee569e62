"""A failed check leads to the page that explains the idea behind it."""

from __future__ import annotations

import re

import pytest
from typer.testing import CliRunner

from grader.assignment.lesson_checks import all_checks
from grader.checks.check import NoParameters, Subject, check
from grader.cli.app import app
from grader.diagnosis.explanation import explanations
from grader.errors import UsageError
from grader.findings.finding import Finding
from grader.report.concepts import FOLDER, concepts

PAGES = set(concepts()) - {"index"}
NAMED = {entry.concept for entries in explanations().values() for entry in entries}
NAMED |= {one.concept for one in all_checks().values()}


def test_a_misspelt_idea_is_answered_with_the_nearest() -> None:
    ended = CliRunner().invoke(app, ["explain", "qso"])
    assert isinstance(ended.exception, UsageError) and "Did you mean 'qos'" in str(ended.exception)
    assert "best effort" in CliRunner().invoke(app, ["explain", "qos"]).stdout


def test_every_named_concept_has_a_page_and_every_page_is_named() -> None:
    assert NAMED - {""} == PAGES


def test_the_overview_lists_every_page() -> None:
    overview = (FOLDER / "index.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\((\w+)\.md\)", overview)) == PAGES


@pytest.mark.parametrize("name", sorted(PAGES))
def test_a_page_has_its_picture_described_and_no_links_that_lead_nowhere(name: str) -> None:
    page = concepts()[name]
    described = re.search(r'<svg role="img" aria-label="([^"]{40,})"', page.html)
    assert described
    assert described[1] in page.plain
    assert not re.findall(r'<img|style="|<style|<script', page.html)
    assert re.findall(r'href="([^"]*)"', page.html) == re.findall(
        r'href="(https://[^"]*)"', page.html
    )
    assert "<div" not in page.plain and "![" not in page.plain


def test_what_a_cause_explains_comes_before_what_its_check_explains() -> None:
    cause = Finding("nothing came", concept="qos")

    @check("sample.cause", Subject.SUBMISSION, NoParameters, concept="timers")
    def by_cause(submission: object, parameters: NoParameters) -> Finding:
        """A message comes."""
        return cause

    @check("sample.plain", Subject.SUBMISSION, NoParameters, concept="timers")
    def plain(submission: object, parameters: NoParameters) -> Finding:
        """A message comes in time."""
        return Finding.failed("in time", "late")

    parameters = NoParameters()
    assert by_cause.judge(None, parameters).concept == "qos"
    assert plain.judge(None, parameters).concept == "timers"


def test_a_check_that_passes_explains_nothing() -> None:
    @check("sample.passed", Subject.SUBMISSION, NoParameters, concept="timers")
    def passed(submission: object, parameters: NoParameters) -> Finding:
        """All is well."""
        return Finding.passed("well", "well")

    assert passed.judge(None, NoParameters()).concept == ""
