"""The class overview: complete, inert, the same every time."""

import re
from dataclasses import replace

import pytest

from grader.report.html.overview import render_overview
from grader.report.model.class_row import ClassRow
from tests.report.classroom import classroom
from tests.report.page import Page
from tests.report.test_html import ATTACKS, sha256


def squeezed(html):
    return " ".join(Page(html).text.split())


def test_figures_of_the_class():
    text = squeezed(render_overview(classroom(20)))
    assert "Submissions 20 Graded 18" in text
    assert "2 submissions without a grade" in text
    assert "student 09: the archive is damaged" in text
    assert re.search(r"It publishes every 300 ms \d+ \(\d+ %\)", text)
    empty = squeezed(render_overview([]))
    assert "Submissions 0" in empty and "No submission was graded." in empty


def test_median_and_mean_are_of_those_who_were_graded():
    full = classroom(1)[0]
    rows = [replace(full, id=str(i), result=full.result.model_copy(update={"score": score}))
            for i, score in enumerate((0.0, 1.0, 3.0))]  # fmt: skip
    text = squeezed(render_overview([*rows, ClassRow("x", note="empty")]))
    assert "Median 1 / 3 points" in text and "Mean 1.33 / 3 points" in text
    assert "Full points 1" in text


def test_every_cell_leads_to_its_check_in_the_report():
    found = Page(render_overview(classroom(5)))
    links = [link["href"] for link in found.all("a")]
    assert "./student%2003/report.html#check-builds" in links
    assert all(
        re.match(r"\./student%20\d\d/report\.html(#check-[a-z]+)?$|#matrix$", link)
        for link in links
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, None),
        ({"runs": 2}, "student 00 listen 2 250 ms 0 ms"),
        ({"faults": ("the disk is full",)}, "the disk is full"),
    ],
)
def test_only_what_was_run_again_is_listed_as_disturbed(changes, said):
    row = classroom(1)[0]
    (run,) = row.result.scenarios
    disturbance = run.disturbance.model_copy(update={"taken_s": 0.25})
    run = run.model_copy(update={"disturbance": disturbance, **changes})
    result = row.result.model_copy(update={"scenarios": (run,)})
    text = squeezed(render_overview([replace(row, result=result)]))
    assert said in text if said else "Disturbed runs" not in text


def test_what_cannot_be_read_counts_neither_as_a_score_nor_as_failed_checks():
    full, lost = classroom(2)
    part = lost.result.submission.model_copy(update={"problem": "a.zip: is broken"})
    broken = lost.result.model_copy(update={"submission": part, "score": 0.0})
    rows = [full, replace(lost, result=broken), ClassRow("eve", missing=True)]
    html = render_overview(rows)
    text = squeezed(html)
    assert "Submissions 3 Graded 1 Unreadable 1 Handed in nothing 1 Median 3" in text
    assert "No check failed." in text
    assert "student 01 : a.zip: is broken" in text
    states = re.findall(r'<tr data-is="([^"]*)">', html)
    assert [state.split()[0] for state in states] == ["full", "unreadable", "missing"]


def test_five_hundred_submissions_stay_small():
    # Six checks each here; with the 27 of the largest assignment four times as much.
    assert len(render_overview(classroom(500)).encode()) < 400_000


def test_only_its_own_style_and_script_may_run():
    html = render_overview(classroom(3))
    found = Page(html)
    assert found.problems == []
    (policy,) = found.all("meta", http_equiv="Content-Security-Policy")
    (style,) = re.findall(r"<style>(.*?)</style>", html, re.DOTALL)
    (script,) = re.findall(r"<script>(.*?)</script>", html, re.DOTALL)
    assert sha256(style) in policy["content"] and sha256(script) in policy["content"]
    assert "unsafe" not in policy["content"] and "style=" not in html


@pytest.mark.parametrize("attack", [*ATTACKS, "//example.org/x", "javascript:alert(1)"])
def test_hostile_names_add_nothing_and_lead_nowhere(attack):
    row = classroom(2)[1]
    rows = [ClassRow(attack, attack, attack, row.result, attack)]
    harmless = Page(render_overview([ClassRow("a", "a", "a", row.result, "a")]))
    found = Page(render_overview(rows))
    assert found.problems == []
    assert [tag for tag, _ in found.elements] == [tag for tag, _ in harmless.elements]
    for link in found.all("a"):
        assert link["href"].startswith(("#", "./")) and ":" not in link["href"]
