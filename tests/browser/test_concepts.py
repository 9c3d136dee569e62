"""The pages of ideas in a report and in a file of their own: one file each, without a network."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect
from typer.testing import CliRunner

from grader.cli.app import app
from grader.findings.finding import Finding
from tests.grade.sample import Told
from tests.report.sample import judged

pytestmark = pytest.mark.slow


def failed(concept: str) -> Finding:
    return replace(Finding.failed("messages", "none", "Look at the QoS."), concept=concept)


def test_a_finding_leads_to_its_idea_in_the_same_file(look):
    sample = judged([Told("qos", failed("qos")), Told("other", failed("qos"))])
    found = look(sample.html(), 390)
    page = found.page
    page.get_by_role("link", name="QoS: when a publisher").first.click()
    idea = page.locator("#concept-qos")
    assert idea.get_attribute("open") is not None
    expect(idea.get_by_role("img")).to_be_visible()
    expect(idea.get_by_role("status")).to_contain_text("No match")
    idea.get_by_label("Reliability").first.select_option("reliable")
    expect(idea.get_by_role("status")).to_contain_text("They match")
    assert Axe().run(page).response["violations"] == []
    assert found.complaints == [] and found.requests == []


def test_a_report_without_a_failure_carries_no_ideas(look):
    html = judged([Told("fine", Finding.passed("a", "b"))]).html()
    assert "concept-" not in html.partition("<body>")[2].partition("<script>")[0]
    unknown = judged([Told("new", failed("of_a_later_rosgrade"))]).html()
    assert "The ideas behind it" not in unknown


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_of_an_idea_is_accessible(look, tmp_path: Path, monkeypatch, scheme):
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(app, ["explain", "executors", "--html"]).exit_code == 0
    html = Path("executors.html").read_text(encoding="utf-8")
    found = look(html, 390, color_scheme=scheme)
    assert Axe().run(found.page).response["violations"] == []
    assert found.complaints == [] and found.requests == []
    assert not found.page.evaluate("document.documentElement.scrollWidth > innerWidth")
