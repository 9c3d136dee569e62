"""The report in a real browser: seen, scrubbed, printed, spoken, and inert."""

from __future__ import annotations

import json
import re
import zlib
from dataclasses import replace

import pytest
from axe_playwright_python.sync_playwright import Axe

from tests.report.gallery import gallery, reference
from tests.report.sample import PLACE, everywhere, lost_points, not_built, not_graded

SAMPLES = {
    "gallery": gallery,
    "lost_points": lost_points,
    "not_built": not_built,
    "not_graded": not_graded,
}
# Colours are the same at every width.
EACH_WIDTH_AND_SCHEME = ((390, "light"), (1280, "dark"))
VIEWS = [
    *((name, *view) for name in ("gallery", "lost_points") for view in EACH_WIDTH_AND_SCHEME),
    ("gallery", 1600, "light"),
    ("not_built", 1280, "dark"),
    ("not_graded", 390, "dark"),
]
# Long lines, in every colour.
NODE = 10 * (
    "    # note\n@decorator\ndef name(self):\n    return f'text' + 1.5" + 99 * " + 1" + "\n"
)
SLIDER = ".replay input[type=range]"
pytestmark = pytest.mark.slow


def html_of(make):
    return make().html(reference(), source={PLACE.file: NODE})


def with_assignment(sample, **changes):
    """A sample of which the assignment says something else."""
    loaded = sample.grade.loaded
    loaded = replace(loaded, assignment=loaded.assignment.model_copy(update=changes))
    return replace(sample, grade=replace(sample.grade, loaded=loaded))


def violations(page):
    """What axe-core has against a page, with the elements."""
    found = Axe().run(page).response["violations"]
    return [
        f"{rule['id']}: {node['html'][:200]} {node['failureSummary']}"
        for rule in found
        for node in rule["nodes"]
    ]


def png_chunks(data):
    """The chunks of a PNG, after their checksums were compared."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    found, at = [], 8
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        body = data[at + 4 : at + 8 + size]
        assert zlib.crc32(body) == int.from_bytes(data[at + 8 + size : at + 12 + size], "big")
        found.append((body[:4], body[4:]))
        at += 12 + size
    return found


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
    found.keep(f"report-{name}-{width}-{scheme}")
    assert violations(found.page) == []
    assert found.complaints == [] and found.requests == []
    assert found.page.evaluate("document.documentElement.scrollWidth") <= width


def test_all_is_there_without_javascript(look, pages):
    found = look(pages["gallery"], java_script_enabled=False)
    page = found.page
    assert page.get_by_role("heading", name="Fix this first").is_visible()
    assert page.get_by_text("Path of the robot in the scenario drive").count()
    page.locator(".fold summary", has_text="1 check passed").click()
    page.locator("#check-speed summary").click()
    assert page.locator("#check-speed .observed").is_visible()
    assert page.locator(".replay").is_hidden()
    assert found.complaints == []


class TestReplay:
    def test_it_shows_what_the_robot_saw_at_the_time_of_the_slider(self, look, pages):
        page = look(pages["gallery"]).page
        plan = page.locator(".replay svg.plan")
        before = plan.get_attribute("aria-label")
        slider = page.locator(SLIDER)
        slider.focus()
        for _ in range(20):
            page.keyboard.press("ArrowRight")
        time = f"{float(slider.input_value()):.1f} s after launch"
        assert slider.get_attribute("aria-valuetext") == time
        assert plan.get_attribute("aria-label") != before
        assert "heading 0°" in plan.get_attribute("aria-label")
        assert plan.locator(".beams").get_attribute("d").count("L") > 5

    def test_reference_and_last_attempt_are_ghosts_in_the_same_map(self, look):
        found = look(gallery().html(reference(), before=reference()))
        page = found.page
        page.locator(SLIDER).focus()
        page.keyboard.press("End")
        at = {
            role: page.locator(f".replay .plan {role} circle.robot").evaluate(
                "(robot) => robot.getBoundingClientRect().right"
            )
            for role in (".of-student", ".of-reference", ".of-before")
        }
        mine, theirs, before = at.values()
        assert mine > theirs + 5 and theirs == before
        page.get_by_label("Reference").uncheck()
        assert page.locator(".replay .plan .of-reference").is_hidden()
        assert page.locator(".replay .plan .of-before").is_visible()
        found.keep("replay-ghosts")
        assert found.complaints == []

    def test_a_moving_thing_near_the_way_is_in_sight_as_a_whole(self, look, pages):
        page = look(pages["gallery"]).page
        page.locator(SLIDER).focus()
        page.keyboard.press("End")
        plan = page.locator(".replay .plan").bounding_box()
        thing = page.locator(".replay .mover").first.bounding_box()
        assert plan["x"] <= thing["x"] and plan["y"] <= thing["y"]
        assert thing["x"] + thing["width"] <= plan["x"] + plan["width"]
        assert thing["y"] + thing["height"] <= plan["y"] + plan["height"]

    def test_the_goal_is_drawn_and_named(self, look):
        sample = gallery()
        goal = {"goal": ["0.4", "-0.2", "90 deg"], "position": "8 cm"}
        checks = tuple(
            spec.model_copy(update={"with_": goal}) if spec.id == "stops" else spec
            for spec in sample.grade.assignment.checks
        )
        found = look(with_assignment(sample, checks=checks).html(reference()))
        replay = found.page.locator(".replay")
        plan, circle = replay.locator("svg.plan"), replay.locator("svg.plan circle.target")
        place = [circle.get_attribute(name) for name in ("cx", "cy", "r")]
        assert place == ["0.4", "-0.2", "0.08"]
        name = plan.locator("text")
        assert name.text_content() == "goal"
        inner, outer = name.bounding_box(), plan.bounding_box()
        assert 6 < inner["height"] < 40
        assert outer["x"] <= inner["x"] and outer["y"] <= inner["y"]
        assert inner["y"] < circle.bounding_box()["y"] + 2
        told = replay.locator(".readout").text_content()
        assert "m from the goal (dashed: within 8 cm)" in told
        replay.evaluate("(root) => root.scrollIntoView()")
        found.keep("replay-goal")
        assert found.complaints == []

    def test_the_readout_tells_that_it_touches_the_wall_and_what_was_printed(self, look, pages):
        found = look(pages["gallery"])
        page = found.page
        page.locator(SLIDER).focus()
        page.keyboard.press("End")
        told = page.locator(".replay .readout").text_content()
        assert "It touches something." in told and "Commanded 0.10 m/s" in told
        assert page.locator(".replay .said-so-far").text_content().count("Front is clear") == 1
        assert found.complaints == []

    def test_the_speeds_have_axes_and_the_limit_of_the_robot(self, look, pages):
        page = look(pages["gallery"]).page
        chart = page.locator(".replay .chart").first
        assert chart.locator(".limit").count() == 1
        assert {"forward speed (m/s)", "0.22", "0", "2 s"} <= set(
            chart.locator("text").all_text_contents()
        )

    def test_space_and_frames_work_wherever_the_focus_is(self, look, pages):
        page = look(pages["gallery"]).page
        slider = page.locator(SLIDER)
        page.locator(".replay").scroll_into_view_if_needed()
        begin = float(slider.input_value())
        page.keyboard.press(".")
        page.keyboard.press(".")
        page.keyboard.press(",")
        assert float(slider.input_value()) == pytest.approx(begin + 0.1, abs=0.01)
        for focused in ("body", SLIDER, ".replay .step"):
            page.locator(focused).first.evaluate("(one) => one.focus()")
            page.keyboard.press("Space")
            assert page.get_by_role("button", name="Pause").is_visible(), focused
            page.keyboard.press("Space")
            assert page.get_by_role("button", name="Play").is_visible(), focused

    @pytest.mark.parametrize("clicks", [1, 5])
    def test_it_plays_at_four_times_the_speed(self, look, pages, clicks):
        page = look(pages["gallery"]).page
        page.get_by_label("Speed", exact=True).select_option("4")
        ran = page.evaluate(
            """async (clicks) => {
              const slider = document.querySelector('.replay input[type=range]');
              const [time, began] = [Number(slider.value), performance.now()];
              for (let i = 0; i < clicks; i++) document.querySelector('.replay .play').click();
              while (performance.now() - began < 400) await new Promise(requestAnimationFrame);
              return (Number(slider.value) - time) / (performance.now() - began) * 1000;
            }""",
            clicks,
        )
        assert 2.0 < ran < 5.0

    def test_it_is_saved_as_an_animation_that_other_programs_can_read(self, look, pages, tmp_path):
        found = look(pages["gallery"], 390)
        with found.page.expect_download() as download:
            found.page.get_by_role("button", name="Save as animation").click()
        assert download.value.suggested_filename == "drive.png"
        file = tmp_path / "drive.png"
        download.value.save_as(file)
        chunks = png_chunks(file.read_bytes())
        kinds = [kind for kind, _ in chunks]
        assert kinds[:3] == [b"IHDR", b"acTL", b"fcTL"] and kinds[-1] == b"IEND"
        frames = int.from_bytes(dict(chunks)[b"acTL"][:4], "big")
        assert frames == kinds.count(b"fcTL") > 50
        numbers = [data[:4] for kind, data in chunks if kind in (b"fcTL", b"fdAT")]
        assert numbers == [n.to_bytes(4, "big") for n in range(len(numbers))]
        pictures = {data[4:] for kind, data in chunks if kind == b"fdAT"}
        assert len(pictures) > 20
        assert found.complaints == []

    def test_a_time_in_a_finding_leads_to_that_time(self, look, pages):
        page = look(pages["gallery"]).page
        link = page.locator("#check-touch a.time")
        time_s = float(link.get_attribute("data-time"))
        link.click()
        assert abs(float(page.locator(SLIDER).input_value()) - time_s) < 0.06
        assert page.evaluate("document.activeElement.type") == "range"

    def test_it_plays_and_pauses(self, look, pages):
        page = look(pages["gallery"]).page
        button = page.get_by_role("button", name="Play")
        slider = page.locator(SLIDER)
        begin = float(slider.input_value())
        button.click()
        page.wait_for_function(
            "([slider, begin]) => Number(document.querySelector(slider).value) > begin + 0.3",
            arg=[SLIDER, begin],
        )
        page.get_by_role("button", name="Pause").click()
        assert page.get_by_role("button", name="Play").is_visible()

    def test_who_asked_for_less_motion_gets_stills(self, look, pages):
        page = look(pages["gallery"], reduced_motion="reduce").page
        begin = page.locator(SLIDER).input_value()
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


def test_what_failed_can_be_shown_alone(look, pages):
    page = look(pages["gallery"], java_script_enabled=False).page
    page.get_by_label("Show only what failed").check()
    assert page.locator("#check-touch").is_visible()
    assert page.locator("#check-stops").is_hidden()
    assert page.locator(".fold", has_text="1 check passed").is_hidden()


@pytest.mark.parametrize("width", [390, 1280])
def test_the_contents_name_the_section_that_is_read(look, width):
    sample = gallery()
    names = (
        "A wall is ahead of the robot on its way",
        "It publishes what to do, again and again, until the end",
    )
    scenarios = tuple(
        one.model_copy(update={"title": name})
        for one, name in zip(sample.grade.assignment.scenarios, reversed(names), strict=True)
    )
    page = look(with_assignment(sample, scenarios=scenarios).html(), width)
    page = page.page
    for name in names:
        page.get_by_role("heading", name=name, exact=True).evaluate("(one) => one.scrollIntoView()")
        page.wait_for_function(
            "(name) => document.querySelector('.contents-group[aria-current]')"
            "?.textContent === name",
            arg=name,
        )
        # It is scrolled into sight where the contents are wider than a phone.
        box = page.locator(".contents-group[aria-current]").bounding_box()
        assert box["x"] >= 0 and box["x"] < width - 60 and 0 <= box["y"] < 900


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
    found.page.locator(SLIDER).focus()
    found.page.keyboard.press("End")
    assert attack in found.page.locator(".replay .said-so-far").first.text_content()
    assert found.page.evaluate("window.hacked") is None and found.requests == []
    data = re.search(r'<script type="application/json" id="data-drive">(.*?)</script>', html)
    assert json.loads(data[1])["student"]["log"][0][1] == attack
