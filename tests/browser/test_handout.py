"""The handout and the page that follows a watched submission, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from grader.assignment.load import load_assignment
from grader.findings.finding import Finding
from grader.grading.files import RESULT_FILE
from grader.report.html.handout import make_handout, render_handout
from grader.report.model.result import read_result, result_json
from grader.server.watch import ReportPage
from tests.grade.sample import Told
from tests.report.sample import full_points, judged, lost_points

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1280, "dark")])
def test_a_handout_is_accessible_quiet_and_fits(look, width, scheme):
    html = render_handout(make_handout(load_assignment("timed_publisher")))
    found = look(html, width, color_scheme=scheme)
    found.keep(f"handout-{width}-{scheme}")
    assert Axe().run(found.page).response["violations"] == []
    assert found.complaints == [] and found.requests == []
    wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth"
    assert not found.page.evaluate(wide)
    box = found.page.locator("article").bounding_box()
    assert box["width"] > 0.6 * width
    assert abs(box["x"] + box["width"] / 2 - width / 2) < 0.02 * width


@pytest.fixture
def watched(chromium: Browser, tmp_path: Path) -> Iterator[tuple[ReportPage, Page]]:
    """The page around ``report.html`` in the test's folder, which nothing may complain about."""
    served = ReportPage(tmp_path / "report.html")
    context = chromium.new_context()
    complaints: list[str] = []
    try:
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        yield served, page
        assert complaints == []
    finally:
        served.close()
        context.close()


def test_the_page_of_a_watched_submission_follows_by_itself(
    watched: tuple[ReportPage, Page], tmp_path: Path
) -> None:
    def write(sample):
        (tmp_path / "report.html").write_text(sample.html(), encoding="utf-8")

    write(lost_points())
    served, page = watched
    page.goto(served.url)
    frame = page.frame_locator("iframe")
    expect(frame.locator(".score .value")).to_have_text("3.02")
    # So that the keys of the replay work before anybody clicks.
    assert page.evaluate("document.activeElement.tagName") == "IFRAME"
    expect(page.get_by_role("status")).to_have_text("grading")
    write(full_points())
    served.show(text="3 of 3 points", title="3 of 3 points: Publish", is_new=True)
    expect(frame.locator(".score .value")).to_have_text("3")
    expect(page.get_by_role("status")).to_have_text("3 of 3 points")
    expect(page).to_have_title("3 of 3 points: Publish")
    old = "document.querySelector('main').classList.contains('is-old')"
    served.show_grade("1 of 3 points", "1 of 3", "", (1.0, 3.0))
    served.show_grade("Not graded", "not graded", "", (None, 3.0))
    served.begin("… Publish")
    served.show_phase("listen", "recording")
    served.show(early=("period passes now",))
    expect(page.locator("#phases li")).to_have_text(["listen: recording"])
    expect(page.locator("#early li")).to_have_text(["period passes now"])
    assert page.evaluate(old)
    assert Axe().run(page).response["violations"] == []
    changed = "period: failed → passed, +2"
    served.show_grade("3 of 3 points", "3 of 3", changed, (3.0, 3.0))
    expect(page.get_by_text(f"Since your last save: {changed}")).to_be_visible()
    expect(page.get_by_role("img")).to_have_attribute(
        "aria-label", "Scores since watching began, of 3 points: 1, not graded, 3"
    )
    assert not page.evaluate(old) and not page.locator("#phases").is_visible()
    assert Axe().run(page).response["violations"] == []


@pytest.mark.parametrize("counts", [True, False])
def test_hints_open_one_by_one_and_count_only_where_the_page_says_so(
    watched: tuple[ReportPage, Page], tmp_path: Path, counts: bool
) -> None:
    sample = judged([Told("topic", Finding.failed("a", "b"), hint=["one", "two", "three"])])
    result = sample.result.model_copy(update={"hints_opened": {} if counts else None})
    (tmp_path / "report.html").write_text(sample.html(), encoding="utf-8")
    file = tmp_path / RESULT_FILE
    file.write_text(result_json(result), encoding="utf-8")
    served, page = watched
    page.goto(served.url)
    served.show_hints(result)
    served.show(is_new=True, text="0 of 1 points")
    said = page.locator("#hints")
    frame = page.frame_locator("iframe")
    steps = frame.locator("summary", has_text="Another hint")
    expect(page.get_by_role("status")).to_have_text("0 of 1 points")
    expect(steps.nth(1)).not_to_be_visible()
    steps.first.focus()
    page.keyboard.press("Enter")
    expect(frame.get_by_text("two", exact=True)).to_be_visible()
    if not counts:
        expect(said).to_be_hidden()
        assert read_result(file).hints_opened is None
        return
    expect(said).to_have_text("Your course counts the further hints that you open here: 1 so far.")
    assert read_result(file).hints_opened == {"topic": 1}
    steps.nth(1).click()
    expect(said).to_contain_text("2 so far")
    assert Axe().run(page).response["violations"] == []
    # The next save shows the report anew; what was opened stays counted.
    served.show(is_new=True, text="graded again")
    expect(page.get_by_role("status")).to_have_text("graded again")
    expect(frame.get_by_text("two", exact=True)).not_to_be_visible()
    steps.first.click()
    expect(frame.get_by_text("two", exact=True)).to_be_visible()
    expect(said).to_contain_text("2 so far")
    assert read_result(file).hints_opened == {"topic": 2}
