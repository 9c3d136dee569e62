"""The documentation site in a real browser: accessible, quiet, and what can be tried works."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from playwright.sync_api import Browser, Page, expect

from grader.machine import resources

pytestmark = pytest.mark.slow
REPOSITORY = "https://github.com/example/rosgrade"
# Longest page, in pixels at a width of 1280: longer ones are hard to read.
MOST_PIXELS = 16_000
NEXT = re.compile(r'<a href="([^"]+)" class="[^"]*md-footer__link--next"')
# Served with the site: the browser then compiles it once, and not on every page.
AXE = "axe.js"
FIND = """([exclude, options]) => axe.run({exclude}, options).then(({violations}) =>
    violations.map(one => `${one.id} ${one.nodes[0].html}`))"""
# Kinds of elements in the text of a page, by their names and classes: what colours follow from.
KINDS = """() => [...new Set([...document.querySelectorAll('.md-content *')].map(
    one => `${one.parentElement.tagName} ${one.tagName} ${one.getAttribute('class') ?? ''}`))]"""
# Rules about what is written on a page, also with elements that others have: their order, their
# names, whether they fit.
OF_CONTENT = (
    "document-title",
    "duplicate-id-aria",
    "empty-heading",
    "heading-order",
    "image-alt",
    "link-name",
    "list",
    "page-has-heading-one",
    "scrollable-region-focusable",
)
# Every page would read the index of the search anew.
WITHOUT_SEARCH = "window.Worker = class extends EventTarget { postMessage() {} }"
# The same on every page: looked at on these, with all that is on them.
FRAME = (".md-header", ".md-tabs", ".md-sidebar--primary", ".md-footer")
WITH_FRAME = (".", "concepts/executors", "checks/qos")


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Print nothing."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder],
        cwd=resources.root(),
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "ROSGRADE_REPOSITORY": REPOSITORY},
        timeout=600,
        check=True,
    )
    (folder / AXE).write_text(AXE_SCRIPT, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site)))
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


@pytest.fixture
def page(chromium: Browser, address: str) -> Iterator[Page]:
    context = chromium.new_context(base_url=address, reduced_motion="reduce")
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    yield context.new_page()
    context.close()


def violations(page: Page, without: Sequence[str] = (), **options: object) -> list[str]:
    """What axe finds on a page: each rule with the first element against it."""
    # Nothing that is asked for needs the sources of style sheets.
    given = {"resultTypes": ["violations"], "preload": False, **options}
    if not page.evaluate("'axe' in window"):
        page.add_script_tag(url=f"/{AXE}")
    found: list[str] = page.evaluate(FIND, [[[one] for one in without], given])
    return found


def test_every_page_is_accessible_and_none_is_endless(page: Page, site: Path, address: str) -> None:
    found, asked, complaints = [], [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.add_init_script(WITHOUT_SEARCH)
    pages = sorted(str(file.parent.relative_to(site)) for file in site.rglob("index.html"))
    assert len(pages) > 50
    seen: set[str] = set()
    for name in pages:
        page.goto(f"{name}/")
        height = page.evaluate("document.documentElement.scrollHeight")
        if height > MOST_PIXELS:
            found.append(f"{name}: {height} px")
        without = () if name in WITH_FRAME else FRAME
        # Colours and most rules are those of the kinds of elements: a page without a new kind has
        # nothing of them that was not looked at.
        kinds = set(page.evaluate(KINDS))
        if kinds <= seen and name not in WITH_FRAME:
            rules = {"runOnly": OF_CONTENT}
            found += [f"{name}: {one}" for one in violations(page, without, **rules)]
            continue
        seen |= kinds
        # The other scheme has other colours, and nothing else that is new.
        for scheme, rules in (("default", {}), ("slate", {"runOnly": ["color-contrast"]})):
            page.evaluate(f"document.body.dataset.mdColorScheme = '{scheme}'")
            found += [f"{name}, {scheme}: {one}" for one in violations(page, without, **rules)]
    page.set_viewport_size({"width": 390, "height": 900})
    for name in WITH_FRAME:
        page.goto(f"{name}/")
        found += [f"{name}, 390 px: {one}" for one in violations(page)]
        assert not page.evaluate("document.documentElement.scrollWidth > innerWidth"), name
    assert not found, "\n".join(found)
    assert not [url for url in asked if not url.startswith(address)]
    assert not complaints


def test_a_copy_button_copies_the_commands_and_nothing_else(page: Page) -> None:
    def copied(block: str) -> str:
        page.locator(".language-console", has_text=block).locator("button").first.click()
        return str(page.evaluate("navigator.clipboard.readText()"))

    page.goto("students/")
    lines = copied("rosgrade list").splitlines()
    assert [line.strip() for line in lines][:2] == [
        "rosgrade list",
        "rosgrade show timed_publisher",
    ]
    assert not [line for line in lines if "$" in line or "#" in line]
    page.goto("instructors/")
    assert copied("2 of 3 graded") == (
        "rosgrade batch timed_publisher submissions/ --roster roster.csv --out results"
    )
    page.goto("tutorial/")
    assert copied("✗ failed").splitlines()[-1] == "rosgrade check battery_monitor ana --quiet"


def test_a_part_of_a_name_is_found(page: Page) -> None:
    page.goto("students/")
    page.keyboard.press("/")
    page.keyboard.type("overshoot")
    expect(page.locator(".md-search-result")).to_contain_text("motion.overshoot")
    assert not violations(page)
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    expect(page).to_have_url(re.compile("/checks/motion/"))


def test_next_leads_through_every_page(site: Path) -> None:
    folder, seen = site, 1
    while leads := NEXT.search((folder / "index.html").read_text(encoding="utf-8")):
        folder = (folder / leads[1]).resolve()
        seen += 1
    assert seen == len(list(site.rglob("index.html")))


def test_a_page_leads_to_its_neighbours_and_to_the_code(page: Page) -> None:
    page.goto("concepts/qos/")
    assert page.get_by_role("link", name="Next:").get_attribute("href")
    assert page.get_by_role("link", name="Previous:").get_attribute("href")
    assert page.locator(f"a[href='{REPOSITORY}']").count()
    assert page.get_by_role("dialog", name="Search", include_hidden=True).count()


def test_qos_can_be_tried_with_the_keyboard(page: Page) -> None:
    page.goto("concepts/qos/")
    result = page.get_by_role("status")
    expect(result).to_contain_text("No match")
    offered = page.get_by_role("group", name="Publisher offers").get_by_label("Reliability")
    offered.focus()
    page.keyboard.press("ArrowUp")
    expect(result).to_contain_text("They match")
    requested = page.get_by_role("group", name="Subscription requests")
    requested.get_by_label("Durability").select_option("transient local")
    expect(result).to_contain_text("durability: offered volatile, requested transient local")


def test_timers_run_at_the_same_time_only_with_two_threads_and_two_groups(page: Page) -> None:
    page.goto("concepts/executors/")
    result = page.get_by_role("status")
    expect(result).to_contain_text("B starts up to 400 ms late. Callbacks never run")
    page.get_by_label("Executor").select_option("MultiThreadedExecutor, 2 threads")
    expect(result).to_contain_text("400 ms late. Callbacks never run")
    page.get_by_label("Callback groups").select_option("one for each timer")
    expect(result).to_contain_text("B starts on time. Callbacks run at the same time")
    page.get_by_label("Timer A works").press("End")
    expect(result).to_contain_text("calls are left out")


def test_an_angle_is_wrapped_to_the_short_way(page: Page) -> None:
    page.goto("concepts/angles/")
    result = page.get_by_role("status")
    expect(result).to_contain_text("−340°")
    expect(result).to_contain_text("wrapped: 20° = 0.35 rad: turn left by 20°, not right by 340°")
    page.get_by_label("The robot's yaw").press("Home")
    expect(result).to_have_text("goal − yaw = 10° = 0.17 rad: turn left by 10°.")
