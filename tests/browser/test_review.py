"""The review of a class in a real browser: by keyboard, with nothing lost, for every eye."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from grader.review.store import ReviewStore
from grader.server.review import ReviewServer
from tests.browser.conftest import keep
from tests.browser.test_report import EACH_WIDTH_AND_SCHEME, violations
from tests.server.make_class import NODE, hand_in_again, make_class

pytestmark = pytest.mark.slow
SAVED = re.compile(r"saved \d\d:\d\d:\d\d")
Opened = Callable[..., Page]
expect.set_options(timeout=20_000)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return make_class(tmp_path)


@pytest.fixture
def visit(chromium: Browser, out: Path) -> Iterator[Opened]:
    """Open a page of the review, with the token; complaints of the console fail the test."""
    server = ReviewServer(out, "AK")
    complaints: list[str] = []
    contexts = []

    def opened(path: str = "", width: int = 1280, **options: object) -> Page:
        viewport = {"width": width, "height": 900}
        context = chromium.new_context(viewport=viewport, **options)  # type: ignore[arg-type]
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(20_000)
        page.on("console", lambda told: complaints.append(told.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(server.url)
        page.goto(f"http://{server.host}/{path}")
        return page

    yield opened
    for context in contexts:
        context.close()
    server.close()
    assert [one for one in complaints if "status of 4" not in one] == []


def saved(page: Page) -> None:
    expect(page.locator("#saved")).to_have_text(SAVED)


@pytest.mark.parametrize(("width", "scheme"), EACH_WIDTH_AND_SCHEME)
@pytest.mark.parametrize(
    "path", ["", "s/ben/", "s/ben/#source", "clusters#cause-1", "regrade?check=docs"]
)
def test_every_page_is_accessible_and_fits(
    visit: Opened, path: str, width: int, scheme: str
) -> None:
    page = visit(path, width, color_scheme=scheme)
    if path.endswith("#source"):
        page.keyboard.press("s")
        expect(page.locator(".code .note.is-finding").first).to_be_visible()
    name = re.sub(r"\W+", "-", path).strip("-") or "class"
    keep(page, f"review-{name}-{width}-{scheme}")
    assert violations(page) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_an_item_is_scored_by_a_key_and_the_next_one_is_marked(visit: Opened, out: Path) -> None:
    page = visit("s/ben/")
    expect(page.locator(".item.is-current")).to_contain_text("README")
    page.keyboard.press("2")
    saved(page)
    expect(page.locator("#readme-2")).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".item.is-current")).to_contain_text("Oral")
    page.keyboard.press("4")
    expect(page.locator("#oral-points")).to_have_value("4.0")
    scores = ReviewStore(out).student("ben").content.manual
    assert {name: one.points for name, one in scores.items()} == {"readme": 1, "oral": 4}
    page.keyboard.press("0")
    expect(page.locator("#oral-points")).to_have_value("")
    page.keyboard.press("u")
    expect(page.locator("#oral-points")).to_have_value("4.0")


def test_a_comment_at_a_line_survives_a_reload_and_stands_in_the_source(visit: Opened) -> None:
    page = visit("s/ben/")
    page.keyboard.press("s")
    expect(page.locator("#L1 .line")).to_be_focused()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("c")
    expect(page.locator("#where")).to_contain_text(f"at {NODE}:3")
    page.keyboard.type("Use the logger.")
    page.keyboard.press("Control+Enter")
    saved(page)
    expect(page.locator("#text")).to_have_value("")
    page.reload()
    page.keyboard.press("s")
    expect(page.locator("#L3 .note").first).to_have_text("Use the logger.")
    # It is in the bank from now on.
    page.keyboard.press("b")
    page.keyboard.press("1")
    expect(page.locator("#text")).to_have_value("Use the logger.")


def test_the_whole_class_is_walked_through_by_keys(visit: Opened) -> None:
    page = visit("s/ben/")
    for key, name in (("n", "cai"), ("p", "ben"), ("j", "cai"), ("k", "ben"), ("k", "ana")):
        page.keyboard.press(key)
        expect(page.locator("h1")).to_have_text(name)
    page.keyboard.press("?")
    expect(page.locator("dialog")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("dialog")).to_be_hidden()


def test_keys_work_from_within_the_report_too(visit: Opened) -> None:
    page = visit("s/ben/")
    page.frame_locator("iframe").locator("h1").click()
    page.keyboard.press("n")
    expect(page.locator(".bar h1")).to_have_text("cai")


def test_only_those_that_wait_are_walked_through_if_asked(visit: Opened) -> None:
    page = visit("s/ben/")
    for key in "25":
        page.keyboard.press(key)
    expect(page.locator("#oral-points")).to_have_value("5.0")
    page.goto(page.url.replace("ben", "ana"))
    page.get_by_label("only those that wait").check()
    page.wait_for_url("**/ana/?waiting")
    page.keyboard.press("n")
    expect(page.locator("h1")).to_have_text("cai")
    assert page.url.endswith("?waiting")


def test_what_is_typed_outlives_a_conflict_and_a_reload(visit: Opened, out: Path) -> None:
    first, second = visit("s/ben/"), visit("s/ben/")
    first.keyboard.press("1")
    saved(first)
    second.locator("#text").fill("A long thought")
    second.get_by_role("button", name="Save comment").click()
    expect(second.get_by_role("alert")).to_contain_text("changed meanwhile")
    expect(second.locator("#text")).to_have_value("A long thought")
    second.get_by_role("button", name="Load what is there now").click()
    expect(second.locator("#readme-1")).to_have_attribute("aria-pressed", "true")
    expect(second.locator("#text")).to_have_value("A long thought")
    second.get_by_role("button", name="Save comment").click()
    saved(second)
    review = ReviewStore(out).student("ben").content
    assert review.comments[0].text == "A long thought" and "readme" in review.manual


def test_a_finding_leads_to_its_line(visit: Opened) -> None:
    page = visit("s/ben/")
    page.get_by_role("button", name=f"{NODE}:6").click()
    expect(page.locator("#L6")).to_have_class("is-marked")
    expect(page.locator("#L6 .note")).to_contain_text("stop()")
    expect(page.locator("#L3 mark")).to_have_text("U+202E")


def test_a_cause_is_forgiven_with_a_click(visit: Opened, out: Path) -> None:
    page = visit("clusters#cause-1")
    page.locator("#cause-1").get_by_label("Why").fill("the handout was unclear")
    page.locator("#cause-1").get_by_role("button", name="Forgive").click()
    expect(page.locator("#cause-1 summary")).to_contain_text("forgiven 100 %")
    (forgiven,) = ReviewStore(out).of_class().content.forgiven
    assert (forgiven.reason, forgiven.by) == ("the handout was unclear", "AK")


def test_a_changed_check_is_previewed_applied_and_taken_back(visit: Opened) -> None:
    page = visit("regrade?check=docs")
    text = page.locator("#text")
    assert text.evaluate("it => it.value.slice(it.selectionStart).startsWith('id: docs')")
    text.fill(text.input_value().replace("[function]", "oops"))
    page.get_by_role("button", name="Preview").click()
    expect(page.get_by_role("alert")).to_contain_text("assignment.yaml:10")
    text.fill(text.input_value().replace("oops", "[module]"))
    page.get_by_role("button", name="Preview").click()
    expect(page.get_by_text("3 students gain 12 points")).to_be_visible()
    expect(text).to_have_value(re.compile(r"of: \[module\]"))
    page.get_by_role("button", name="Apply").click()
    page.get_by_role("button", name="Back").click()
    expect(page.get_by_text("3 lose 12")).to_be_visible()
    expect(page.get_by_role("button", name="Back")).to_be_hidden()


def test_a_draft_keeps_its_line(visit: Opened, out: Path) -> None:
    page = visit("s/ben/")
    page.keyboard.press("s")
    page.locator("#L6 .line").click()
    page.keyboard.type("Why here?")
    page.reload()
    expect(page.locator("#where")).to_contain_text(f"at {NODE}:6")
    page.keyboard.press("Tab")
    page.get_by_role("button", name="Save comment").click()
    saved(page)
    (comment,) = ReviewStore(out).student("ben").content.of("ben").comments
    assert (comment.text, comment.line) == ("Why here?", 6)


def test_points_for_one_student_and_a_cause_of_one_are_a_few_clicks(
    visit: Opened, out: Path
) -> None:
    page = visit("s/ben/")
    give = page.locator("#give")
    give.get_by_label("Points").fill("1.4")
    give.get_by_label("Why").fill("a good question")
    give.get_by_role("button", name="Give").click()
    expect(page.locator(".given")).to_contain_text("+1.4: a good question (AK)")
    expect(give.get_by_label("Why")).to_have_value("")
    causes = visit("clusters#cause-1")
    causes.locator("#cause-1").get_by_role("checkbox", name="cai").check()
    causes.locator("#cause-1").get_by_label("Another cause").fill("a generated file")
    causes.locator("#cause-1").get_by_role("button", name="Split").click()
    expect(causes.locator("summary", has_text="a generated file")).to_contain_text("1 student")
    review = ReviewStore(out).student("cai").content.of("cai")
    assert review.causes == {"docs": "a generated file"}


def test_the_page_of_a_new_attempt_shows_what_was_written_about_the_one_before_as_such(
    visit: Opened, out: Path
) -> None:
    page = visit("s/ana/")
    page.keyboard.press("s")
    page.locator("#L6 .line").click()
    page.keyboard.type("Why here?")
    page.keyboard.press("Control+Enter")
    saved(page)
    hand_in_again(out, "ana", documented=1)
    page.reload()
    expect(page.locator(".earlier")).to_contain_text("Why here?")
    page.keyboard.press("s")
    expect(page.locator("#L6 .note.is-finding")).to_be_visible()
    expect(page.locator("#L6 .note", has_text="Why here?")).to_have_count(0)
    assert violations(page) == []
    page.get_by_role("link", name="Attempt 1").click()
    page.wait_for_url(re.compile("attempt"))
    page.keyboard.press("s")
    expect(page.locator("#L6 .note")).to_have_text("Why here?")
