"""The documentation site builds strictly and loads nothing from other sites."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from grader.assignment.contract.table import rows
from grader.assignment.load import list_assignments, load_assignment
from grader.machine import resources

ROOT = resources.root()
# The site takes five seconds of a processor, which others may hold.
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")


class Loaded(HTMLParser):
    """Addresses that a browser loads by itself: everything but links to click on."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag != "a":
            self.addresses += [value for name, value in attrs if name in ("src", "href") and value]


class Tables(HTMLParser):
    """The rows of all tables of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.inside = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "tr":
            self.rows.append([])
        if tag == "td":
            self.rows[-1].append("")
        self.inside = tag == "td" or (self.inside and tag == "code")

    def handle_endtag(self, tag: str) -> None:
        self.inside = self.inside and tag != "td"

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=1200,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return folder


def test_every_page_of_docs_is_in_the_site(site: Path) -> None:
    pages = [
        page.relative_to(ROOT / "docs")
        for page in (ROOT / "docs").rglob("*.md")
        if "reference" not in page.parts
    ]
    assert len(pages) > 10
    for page in pages:
        is_index = page.name in ("index.md", "README.md")
        place = page.parent if is_index else page.with_suffix("")
        assert (site / place / "index.html").is_file(), page


def test_a_handout_shows_the_table_that_its_contract_makes(site: Path) -> None:
    examples = sorted((ROOT / "docs" / "examples").glob("*/assignment.yaml"))
    assert examples
    for file in examples:
        assignment = load_assignment(file.parent).assignment
        contract = assignment.contract
        if not assignment.packages:
            continue
        assert contract, file
        page = (site / "examples" / file.parent.name / "index.html").read_text(encoding="utf-8")
        shown = [" | ".join(row) for row in Tables(page).rows]
        assert not [row for row in rows(contract) if str(row).replace("`", "") not in shown], file


def test_pages_load_nothing_from_other_hosts(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert pages
    for page in pages:
        loaded = Loaded(page.read_text(encoding="utf-8")).addresses
        assert loaded
        assert not [address for address in loaded if re.match(r"(https?:)?//", address)], page
    for style in site.rglob("*.css"):
        text = style.read_text(encoding="utf-8")
        assert not re.findall(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//[^)]*", text), style


def test_links_of_the_readme_lead_to_files() -> None:
    links = LINK.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    inside = [link for link in links if "://" not in link]
    assert inside
    assert not [link for link in inside if not (ROOT / link).exists()]


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_every_assignment_is_named(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert not [name for name in list_assignments() if f"`{name}`" not in text]
