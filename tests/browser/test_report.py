"""The report in a real browser: seen, scrubbed, printed, spoken, and inert."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest
from axe_playwright_python.sync_playwright import Axe

from tests.report.gallery import gallery, reference
from tests.report.sample import everywhere, lost_points, not_built, not_graded

SAMPLES = {
    "gallery": gallery,
    "lost_points": lost_points,
    "not_built": not_built,
    "not_graded": not_graded,
}
VIEWS = [
    *(("gallery", width, scheme) for width in (390, 1280) for scheme in ("light", "dark")),
    ("gallery", 1600, "light"),
    ("lost_points", 390, "light"),
    ("not_built", 1280, "dark"),
    ("not_graded", 390, "dark"),
]
pytestmark = pytest.mark.slow


def html_of(make):
    return make().html(reference())


def violations(page):
    """What axe-core has against a page, with the elements."""
    found = Axe().run(page).response["violations"]
    return [
        f"{rule['id']}: {node['html'][:200]} {node['failureSummary']}"
        for rule in found
        for node in rule["nodes"]
    ]


@pytest.fixture(scope="module")
def pages():
    return {name: html_of(make) for name, make in SAMPLES.items()}


@pytest.mark.parametrize(("name", "width", "scheme"), VIEWS)
def test_a_report_is_accessible_quiet_and_fits(look, pages, name, width, scheme):
    found = look(pages[name], width, color_scheme=scheme)
    found.page.evaluate("for (const d of document.querySelectorAll('details')) d.open = true")
    found.page.wait_for_function(
        "() => [...document.querySelectorAll('.replay')].every((root) => !root.hidden)"
    )
    found.keep(f"report-{name}-{width}-{scheme}", full_page=True)
    assert violations(found.page) == []
    assert found.complaints == [] and found.requests == []
    assert found.page.evaluate("document.documentElement.scrollWidth") <= width


def test_all_is_there_without_javascript(look, pages):
    found = look(pages["gallery"], java_script_enabled=False)
    page = found.page
    assert page.get_by_role("heading", name="Fix this first").is_visible()
    assert page.get_by_text("Path of the robot in the scenario drive").count()
    page.locator("#check-speed summary").click()
    assert page.locator("#check-speed .observed").is_visible()
    assert page.locator(".replay").is_hidden()
    assert found.complaints == []


class TestReplay:
    def test_it_shows_submission_and_reference_at_the_time_of_the_slider(self, look, pages):
        page = look(pages["gallery"]).page
        sides = page.locator(".replay .side")
        assert sides.count() == 2
        robot = sides.nth(0).locator("svg.plan")
        before = robot.get_attribute("aria-label")
        slider = page.locator(".replay input")
        slider.focus()
        for _ in range(20):
            page.keyboard.press("ArrowRight")
        time = f"{float(slider.input_value()):.1f} s after launch"
        assert slider.get_attribute("aria-valuetext") == time
        assert robot.get_attribute("aria-label") != before
        assert "heading 0°" in robot.get_attribute("aria-label")
        assert sides.nth(0).locator(".beams").get_attribute("d").count("L") > 5

    def test_the_goal_is_drawn_and_named_on_both_sides(self, look):
        sample = gallery()
        goal = {"goal": ["0.4", "-0.2", "90 deg"], "position": "8 cm"}
        assignment = sample.grade.assignment
        checks = tuple(
            spec.model_copy(update={"with_": goal}) if spec.id == "stops" else spec
            for spec in assignment.checks
        )
        grade = replace(sample.grade, assignment=assignment.model_copy(update={"checks": checks}))
        found = look(replace(sample, grade=grade).html(reference()))
        sides = found.page.locator(".replay .side")
        for number in range(2):
            side = sides.nth(number)
            circle = side.locator("svg.plan circle.target")
            place = [circle.get_attribute(name) for name in ("cx", "cy", "r")]
            assert place == ["0.4", "-0.2", "0.08"]
            name, plan = side.locator("svg.plan text"), side.locator("svg.plan")
            assert name.text_content() == "goal"
            inner, outer = name.bounding_box(), plan.bounding_box()
            assert 6 < inner["height"] < 40
            assert outer["x"] <= inner["x"] and outer["y"] <= inner["y"]
            assert inner["y"] < circle.bounding_box()["y"] + 2
            assert (
                "m from the goal (dashed: within 8 cm)" in side.locator(".readout").text_content()
            )
        found.page.locator(".replay").evaluate("(root) => root.scrollIntoView()")
        found.keep("replay-goal")
        assert found.complaints == []

    def test_at_the_end_one_has_touched_the_wall_and_the_other_has_stopped(self, look, pages):
        found = look(pages["gallery"])
        page = found.page
        page.locator(".replay input").focus()
        page.keyboard.press("End")
        mine, theirs = page.locator(".replay .readout").all_text_contents()
        assert "It touches something." in mine and "Commanded 0.10 m/s" in mine
        assert "Commanded 0.00 m/s" in theirs and "true 0.00 m/s" in theirs
        said = page.locator(".replay .said-so-far").first.text_content()
        assert said.count("Front is clear") == 1
        page.locator(".replay").scroll_into_view_if_needed()
        found.keep("replay")
        assert found.complaints == []

    def test_a_time_in_a_finding_leads_to_that_time(self, look, pages):
        page = look(pages["gallery"]).page
        link = page.locator("#check-touch a.time")
        time_s = float(link.get_attribute("data-time"))
        link.click()
        assert abs(float(page.locator(".replay input").input_value()) - time_s) < 0.06
        assert page.evaluate("document.activeElement.type") == "range"

    def test_it_plays_and_pauses(self, look, pages):
        page = look(pages["gallery"]).page
        button = page.get_by_role("button", name="Play")
        slider = page.locator(".replay input")
        begin = float(slider.input_value())
        button.click()
        page.wait_for_function(
            "(begin) => Number(document.querySelector('.replay input').value) > begin + 0.3",
            arg=begin,
        )
        page.get_by_role("button", name="Pause").click()
        assert page.get_by_role("button", name="Play").is_visible()

    def test_who_asked_for_less_motion_gets_stills(self, look, pages):
        page = look(pages["gallery"], reduced_motion="reduce").page
        begin = page.locator(".replay input").input_value()
        page.evaluate(
            """() => {
              window.seen = [];
              const output = document.querySelector('.replay output');
              new MutationObserver(() => seen.push(output.textContent))
                .observe(output, { childList: true, characterData: true, subtree: true });
            }"""
        )
        page.get_by_role("button", name="Play").click()
        page.wait_for_function("() => window.seen.length >= 2")
        page.get_by_role("button", name="Pause").click()
        first, second = map(float, page.evaluate("seen.slice(0, 2).map(parseFloat)"))
        assert first - float(begin) >= 0.4 and second - first >= 0.4


def test_a_link_to_a_check_opens_it(look, pages):
    found = look(pages["gallery"])
    page = found.page
    page.evaluate("location.hash = '#check-speed'")
    page.wait_for_function("() => document.getElementById('check-speed').open")
    assert page.locator("#check-speed .observed").is_visible()


def test_everything_can_be_reached_by_the_keyboard(look, pages):
    page = look(pages["gallery"]).page
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the checks"
    reached = set()
    for _ in range(80):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.tagName + document.activeElement.type"))
    assert {"SUMMARYundefined", "INPUTrange", "BUTTONbutton"} <= reached


def test_the_whole_report_is_printed(look, pages, tmp_path):
    found = look(pages["gallery"], color_scheme="dark")
    data = found.page.pdf(path=tmp_path / "report.pdf", format="A4")
    assert data.startswith(b"%PDF-") and len(data) > 20_000
    found.page.emulate_media(media="print")
    assert found.page.locator(".replay").is_hidden()
    assert found.page.locator(".contents").is_hidden()
    # Paper is white, also where the screen is dark.
    ink = found.page.evaluate("() => getComputedStyle(document.body).color")
    assert ink == "rgb(26, 32, 43)"


ATTACKS = [
    "<script>window.hacked = 1</script>",
    '"><img src=x onerror="window.hacked = 1">',
    "</script><script>window.hacked = 1</script>",
    "<!--<script>",
    "<svg onload=window.hacked=1>",
    "javascript:window.hacked=1",
    "</style><style>*{display:none}</style>",
]


@pytest.mark.parametrize("attack", ATTACKS)
def test_hostile_text_is_shown_and_never_runs(look, attack):
    found = look(html_of(lambda: everywhere(attack)))
    assert found.page.evaluate("window.hacked") is None
    assert found.page.locator("h1").text_content() == attack
    assert found.page.locator("h1").is_visible()
    assert found.complaints == [] and found.requests == []


def test_the_policy_stops_a_script_that_got_in_all_the_same(look, pages):
    html = pages["lost_points"].replace("<main", "<script>window.hacked = 1</script><main")
    found = look(html)
    assert found.page.evaluate("window.hacked") is None
    assert any("Content Security Policy" in text for text in found.complaints)


def test_a_hostile_log_line_in_a_replay_is_text(look):
    sample = gallery()
    run = sample.recordings["drive"]
    attack = "</script><img src=x onerror=window.hacked=1>"
    log = tuple(replace(entry, text=attack) for entry in run.log)
    recordings = {**sample.recordings, "drive": replace(run, log=log)}
    html = replace(sample, recordings=recordings).html()
    found = look(html)
    found.page.locator(".replay input").focus()
    found.page.keyboard.press("End")
    assert attack in found.page.locator(".replay .said-so-far").first.text_content()
    assert found.page.evaluate("window.hacked") is None and found.requests == []
    data = re.search(r'<script type="application/json" id="data-drive">(.*?)</script>', html)
    assert json.loads(data[1])["student"]["log"][0][1] == attack
