"""The pages for the instructor only, in a real browser."""

from __future__ import annotations

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from grader.assignment.load import load_assignment
from grader.gradebook.instructor import write_questions, write_similarity
from grader.machine.resources import assignments
from tests.gradebook.similarity.copies import renamed
from tests.gradebook.test_instructor import NODE, OTHER, graded

pytestmark = pytest.mark.slow
WRITE = {"similarity": write_similarity, "questions": write_questions}


@pytest.mark.parametrize("page", WRITE)
@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (1280, "dark")])
def test_a_page_for_the_instructor_is_accessible_quiet_and_fits(
    look, tmp_path, page, width, scheme
):
    loaded = load_assignment(str(assignments() / "simple_publisher"))
    ledger = graded(tmp_path, {"ana": NODE, "ben": OTHER, "cai": renamed(NODE)})
    file, _ = WRITE[page](loaded, ledger)
    found = look(file.read_text(encoding="utf-8"), width, color_scheme=scheme)
    found.keep(f"{page}-{width}-{scheme}")
    assert Axe().run(found.page).response["violations"] == []
    assert found.complaints == [] and found.requests == []
    wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth"
    assert not found.page.evaluate(wide)


def test_a_passage_leads_to_the_same_one_of_the_other_student(look, tmp_path):
    loaded = load_assignment(str(assignments() / "simple_publisher"))
    file, _ = write_similarity(loaded, graded(tmp_path, {"ana": NODE, "cai": renamed(NODE)}))
    page = look(file.read_text(encoding="utf-8")).page
    page.get_by_role("link", name="Passage 1").first.press("Enter")
    expect(page.locator(".shared:target")).to_be_visible()
    assert page.locator(".side").nth(1).locator(":target").count() == 1
