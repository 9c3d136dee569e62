"""Pages that explain one idea of ROS each, with a picture: where a failed check leads.

They are ``docs/concepts/*.md``. The site has them, a report carries those that it needs, and
``rosgrade explain`` shows one. A check and a cause name theirs by the name of the file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from markupsafe import Markup

from grader.machine import resources

FOLDER = resources.root() / "docs" / "concepts"
STYLE, SCRIPT = "../docs/concepts/concepts.css", "../docs/concepts/concepts.js"
"""Assets, from the folder of the templates."""
_PICTURE = re.compile(r'<img (?=[^>]*alt="([^"]*)")[^>]*src="(?:[^"]*/)?(\w+\.svg)"[^>]*>')
_PICTURE_LINE = re.compile(r"^!\[([^\]]*)\].*$", re.MULTILINE)
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https:)[^)]*\)")


@dataclass(frozen=True)
class Concept:
    """One page: ``text`` is Markdown below the title, without links to other pages."""

    name: str
    title: str
    text: str

    @property
    def plain(self) -> str:
        """The page for a terminal: a picture is described, HTML is left out."""
        text = _PICTURE_LINE.sub(r"*\1*", re.sub("\n<div.*</div>\n", "", self.text))
        return f"# {self.title}\n\n{text}"

    @property
    def html(self) -> Markup:
        """The text as HTML, with the picture in it."""
        # Imported late: only a report with a failed check needs it.
        from markdown_it import MarkdownIt

        return Markup(with_pictures(MarkdownIt("commonmark").enable("table").render(self.text)))


def with_pictures(html: str) -> str:
    """Put SVG files of the folder into the HTML, so that they take the colours of the page."""

    def inlined(found: re.Match[str]) -> str:
        drawn = (FOLDER / found[2]).read_text(encoding="utf-8")
        return drawn.replace("<svg ", f'<svg role="img" aria-label="{found[1]}" ', 1)

    return _PICTURE.sub(inlined, html)


@cache
def concepts() -> dict[str, Concept]:
    """All pages by their names; `index` is the list of them."""
    found = {}
    for file in sorted(FOLDER.glob("*.md")):
        title, _, text = file.read_text(encoding="utf-8").partition("\n")
        text = _LINK.sub(r"\1", text).strip()
        found[file.stem] = Concept(file.stem, title.removeprefix("# "), text)
    return found
