"""The handout of an assignment as a page."""

import dataclasses
import re

import pytest

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.model import Level, ManualItem
from grader.errors import UsageError
from grader.report.html.handout import make_handout, render_handout
from tests.grade.sample import Told, make_loaded
from tests.report.page import Page

CHECKS = [
    Told("builds", points=1, title="It builds with `colcon build`"),
    Told("period", points=2.5, title="It is on time <always>"),
    Told("secret", points=3, title="It survives a restart", visibility="hidden"),
    Told("later", points=1, title="It is fast", visibility="after_due_date"),
]


def handout(tmp_path, text="", checks=CHECKS):
    loaded = make_loaded(checks)
    loaded = dataclasses.replace(loaded, file=tmp_path / "assignment.yaml")
    if text:
        (tmp_path / "README.md").write_text(text, encoding="utf-8")
    return make_handout(loaded)


def test_the_checks_with_their_points_and_none_that_is_hidden(tmp_path):
    html = render_handout(handout(tmp_path))
    page = Page(html)
    assert page.problems == []
    assert "It builds with colcon build" in re.sub(r"\s+", " ", page.text)
    assert "It is on time <always>" in page.text and "2.5" in page.text
    assert "restart" not in html and "fast" not in html
    assert "secret" not in html and "later" not in html
    said = "7.5 points in all: 3.5 points here, and 4 points for 2 more checks at grading."
    assert said in page.text


def test_an_assignment_that_is_hidden_altogether_still_has_a_handout(tmp_path):
    assert handout(tmp_path, checks=CHECKS[:1]).total == "1 point in all."
    page = Page(render_handout(handout(tmp_path, "# Title\n\nDo it.", CHECKS[2:3])))
    assert "Do it." in page.text
    assert "3 points in all: 0 points here, and 3 points for 1 more check at grading." in page.text


def test_points_that_a_person_gives_are_listed_with_their_levels(tmp_path):
    loaded = make_loaded(CHECKS[:1])
    levels = (Level(title="thin", points=1.0), Level(title="complete", points=2.5))
    item = ManualItem(id="readme", title="README", points=2.5, levels=levels)
    assignment = loaded.assignment.model_copy(update={"manual": (item,)})
    file = tmp_path / "assignment.yaml"
    page = Page(
        render_handout(make_handout(dataclasses.replace(loaded, assignment=assignment, file=file)))
    )
    assert "README (by a person: thin 1, complete 2.5) 2.5" in re.sub(r"\s+", " ", page.text)
    assert "1 point in all. A person gives up to 2.5 points in addition." in page.text


def test_markdown_is_rendered_below_one_heading(tmp_path):
    text = "# Title\n\nSend `/cmd_vel`.\n\n# Part\n\n| a | b |\n| - | - |\n| 1 | **2** |\n"
    page = Page(render_handout(handout(tmp_path, text)))
    assert page.problems == []
    assert len(page.all("h1")) == 1
    assert "Title" not in page.text
    assert {"table", "strong", "code"} <= page.tags


@pytest.mark.parametrize(
    "attack",
    [
        "<script>alert(1)</script>",
        "[x](javascript:alert(1))",
        '<img src="https://example.org/x.png">',
        "![x](https://example.org/x.png)",
        "<style>*{}</style>",
    ],
)
def test_html_and_scripts_in_it_are_inert(tmp_path, attack):
    page = Page(render_handout(handout(tmp_path, f"Text\n\n{attack}\n")))
    assert "script" not in page.tags and "img" not in page.tags
    assert len(page.all("style")) == 1
    assert not any((a["href"] or "").startswith("javascript") for a in page.all("a"))


@pytest.mark.parametrize("name", list_assignments())
def test_the_handout_of_every_assignment_is_well_formed(name):
    page = Page(render_handout(make_handout(load_assignment(name))))
    assert page.problems == []
    assert len(page.all("h1")) == 1


def test_a_handout_that_is_no_text_is_named(tmp_path):
    (tmp_path / "README.md").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UsageError, match=r"README\.md cannot be read"):
        handout(tmp_path)
