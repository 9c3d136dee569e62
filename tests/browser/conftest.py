"""A real headless Chromium: the machine's own, kept off the network."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, sync_playwright

from grader.machine import resources

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
OFFLINE = (
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    # No name is found but that of this machine itself.
    "--host-resolver-rules=MAP * ~NOTFOUND,EXCLUDE 127.0.0.1",
)
MISSING = "no Chromium here, so no page was looked at: sudo apt install chromium"
SCREENSHOTS = resources.PACKAGE.parent / "rosgrade-report" / "screenshots"
_missing: list[str] = []
_taken: list[str] = []


def keep(page: Page, name: str) -> None:
    """Keep a picture of all of a page to look at, where ROSGRADE_SCREENSHOTS asks for it."""
    if "ROSGRADE_SCREENSHOTS" in os.environ:
        page.screenshot(path=SCREENSHOTS / f"{name}.png", full_page=True)
        _taken.append(name)


@dataclass
class Look:
    """A page, errors and warnings in its console, and what it asked for besides its own file."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def keep(self, name: str) -> None:
        keep(self.page, name)


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    found = os.environ.get("ROSGRADE_CHROMIUM") or next(
        filter(None, map(shutil.which, NAMES)), None
    )
    if found is None:
        _missing.append(MISSING)
        pytest.skip(MISSING)
    # Chromium refuses its own sandbox to root.
    arguments = [*OFFLINE, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=arguments)
        yield browser
        browser.close()


@pytest.fixture
def look(chromium: Browser, tmp_path: Path) -> Iterator[Callable[..., Look]]:
    """Open a page from a file: its HTML, the width in pixels, and options of the context."""
    contexts = []

    def opened(html: str, width: int = 1280, *, wait: str = "load", **options: object) -> Look:
        file = tmp_path / "page.html"
        file.write_text(html, encoding="utf-8")
        context = chromium.new_context(
            viewport={"width": width, "height": 900},
            **options,  # type: ignore[arg-type]
        )
        contexts.append(context)
        found = Look(context.new_page())
        own = file.as_uri()

        def requested(request: Request) -> None:
            if request.url.partition("#")[0] != own:
                found.requests.append(request.url)

        def told(message: ConsoleMessage) -> None:
            if message.type in ("error", "warning"):
                found.complaints.append(message.text)

        found.page.on("request", requested)
        found.page.on("console", told)
        found.page.on("pageerror", lambda error: found.complaints.append(str(error)))
        found.page.goto(own, wait_until=wait)  # type: ignore[arg-type]
        return found

    yield opened
    for context in contexts:
        context.close()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what could not be looked at, or where the pictures are."""
    if _missing:
        terminalreporter.write_line(_missing[0], yellow=True)
    if _taken:
        terminalreporter.write_line(f"{len(_taken)} screenshots in {SCREENSHOTS}")
