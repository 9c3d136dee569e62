"""The class overview in a real browser: searched, filtered, sorted, quick."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.report.html.overview import MOST_SHOWN, render_overview
from grader.report.model.class_row import ClassRow
from grader.report.model.cluster import clusters
from tests.browser.test_report import EACH_WIDTH_AND_SCHEME, violations
from tests.report.classroom import classroom
from tests.report.sample import full_points, reviewed

FEW = 40
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def page_of_few():
    return render_overview(classroom(FEW))


@pytest.mark.parametrize(("width", "scheme"), EACH_WIDTH_AND_SCHEME)
def test_an_overview_is_accessible_quiet_and_fits(look, width, scheme):
    waits = full_points().result.model_copy(update=reviewed("x", waits=True))
    rows = [*classroom(FEW), ClassRow("zed", "", "zed/report.html", waits)]
    page = render_overview(rows, clusters(rows), ("student who left",))
    found = look(page, width, color_scheme=scheme)
    found.keep(f"overview-{width}-{scheme}")
    assert violations(found.page) == []
    assert found.complaints == [] and found.requests == []
    assert found.page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("width", [390, 1280])
def test_no_text_about_a_submission_or_a_check_is_cut_off(look, width):
    note = "handed in twice: a.zip too; " * 5
    rows = [replace(row, note=note) for row in classroom(FEW)]
    page = look(render_overview(rows), width).page
    for said in ("#table .note", "#table .check-name button"):
        assert page.locator(said).count()
        assert page.locator(said).evaluate_all(
            """found => found.every((one) => {
                const style = getComputedStyle(one);
                const cell = one.closest("th").getBoundingClientRect();
                const box = one.getBoundingClientRect();
                return one.scrollWidth <= one.clientWidth + 1
                    && one.scrollHeight <= one.clientHeight + 1
                    && style.textOverflow === "clip"
                    && box.left >= cell.left - 1 && box.right <= cell.right + 1;
            })"""
        )


def shown(page):
    return page.locator("#table tbody tr:not([hidden])")


def names(page):
    return [
        text.strip()
        for text in page.locator("#table tbody tr:not([hidden]) th a").all_text_contents()
    ]


def test_it_is_a_plain_table_without_javascript(look, page_of_few):
    page = look(page_of_few, java_script_enabled=False).page
    assert page.locator("#filters").is_hidden()
    assert page.locator("#table tbody tr").count() == FEW
    link = page.locator("#table tbody tr").nth(1).locator("td a").nth(1)
    assert link.get_attribute("href") == "./student%2001/report.html#check-period"
    assert link.text_content() == "failed, 1.02"


def test_search_and_filters_leave_the_rows_that_fit(look, page_of_few):
    page = look(page_of_few).page
    page.get_by_label("Search").fill("student 07")
    assert shown(page).count() == 1
    assert page.locator("#shown").text_content() == f"1 of {FEW} submissions"
    page.get_by_role("button", name="Clear").click()
    page.wait_for_function("() => document.getElementById('shown').textContent.startsWith('40 ')")
    page.get_by_label("Show").select_option("ungraded")
    assert shown(page).count() == FEW // 10
    page.get_by_label("Show").select_option("")
    page.get_by_label("Failed in").select_option(label="It publishes every 300 ms")
    assert 0 < shown(page).count() < FEW


PEOPLE = {
    "Müller, Jan": ("muller", "MUELLER", "mu\u0308ller", "jan müller"),
    "Mueller, Eva": ("müller",),
    "Mu\u0308ller, NFD": ("muller",),
    "Straße, Per": ("strasse", "STRAẞE"),
    "Núñez, Ana": ("nunez",),
    "Łukasz, Ewa": ("lukasz",),
    "Sørensen, Bo": ("soren", "soerensen"),
    "İstanbul, Can": ("istanbul",),
    "Işık, Ada": ("isik",),
    "Doğan, Efe": ("dogan",),
    "Nguyễn, An": ("nguyen",),
    "Þór, Jón": ("thor",),
    "O’Neil, Pat": ("oneil",),
    "σοφός, Νίκος": ("ΣΟΦΟΣ",),
    "Plain, Joe": ("plain",),
}


def test_search_finds_a_name_however_its_letters_are_written(look):
    rows = [replace(classroom(1)[0], id=f"k{at}", name=one) for at, one in enumerate(PEOPLE)]
    page = look(render_overview(rows)).page
    for name, spellings in PEOPLE.items():
        for typed in spellings:
            page.get_by_label("Search").fill(typed)
            page.wait_for_function("(all) => +shown.textContent.split(' ')[0] < all", arg=len(rows))
            assert name in names(page), typed
            assert name == "Plain, Joe" or "Plain, Joe" not in names(page), typed


def test_a_click_on_a_heading_sorts(look, page_of_few):
    page = look(page_of_few).page
    for order, turned in (("ascending", False), ("descending", True)):
        page.get_by_role("button", name="Score").click()
        scores = page.locator("#table tbody tr td.num").all_text_contents()
        numbers = [float(text) for text in scores if text != "–"]
        assert numbers == sorted(numbers, reverse=turned)
        assert page.locator("#table th[aria-sort]").get_attribute("aria-sort") == order
    page.get_by_role("button", name="Submission", exact=True).press("Enter")
    assert names(page) == sorted(names(page))


def test_five_hundred_submissions_are_all_there_and_can_be_searched(look):
    found = look(render_overview(classroom(500)))
    assert shown(found.page).count() == 500
    found.page.get_by_label("Search").fill("student 499")
    assert shown(found.page).count() == 1
    assert found.complaints == []


def test_of_a_very_large_class_the_first_are_shown_until_all_are_asked_for(look):
    html = render_overview(classroom(MOST_SHOWN + 20))
    page = look(html).page
    assert shown(page).count() == MOST_SHOWN
    said = page.locator("#shown")
    assert said.text_content() == "520 submissions, the first 500 are shown"
    page.get_by_label("Search").fill("student 519")
    assert names(page) == ["student 519"]
    page.get_by_label("Search").fill("")
    for _ in ("ascending", "descending"):
        page.locator("#table thead button").first.press("Enter")
    assert names(page)[0] == "student 99" and shown(page).count() == MOST_SHOWN
    page.get_by_role("button", name="Show all").click()
    assert shown(page).count() == MOST_SHOWN + 20
    assert said.text_content() == "520 submissions"
    plain = look(html, java_script_enabled=False).page
    assert plain.locator("#table tbody tr").last.is_visible()
