"""Reading an HTML report and its drawings as a browser would, strictly."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from xml.etree import ElementTree

VOID = {"meta", "link", "img", "br", "hr", "input", "base", "source"}


class Page(HTMLParser):
    """The elements of a page.

    Attributes:
        elements: Tag and attributes of each start tag, in order.
        text: All text between the tags, style sheets and scripts left aside.
        problems: Tags that are not closed or not opened.
    """

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.problems: list[str] = []
        self._open: list[str] = []
        self._text: list[str] = []
        self.feed(html)
        self.close()
        self.problems += [f"<{tag}> is not closed" for tag in self._open]

    @property
    def text(self) -> str:
        return "".join(self._text)

    @property
    def tags(self) -> set[str]:
        return {tag for tag, _ in self.elements}

    def all(self, tag: str, **attributes: str) -> list[dict[str, str | None]]:
        wanted = {name.rstrip("_").replace("_", "-"): value for name, value in attributes.items()}
        return [
            found
            for name, found in self.elements
            if name == tag and wanted.items() <= found.items()
        ]

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if not self._open or self._open[-1] != tag:
            self.problems.append(f"</{tag}> where {self._open[-1:]} is open")
        else:
            self._open.pop()
        if tag not in ("span", "code", "strong"):
            self._text.append(" ")

    def handle_data(self, data):
        if not {"style", "script"} & set(self._open):
            self._text.append(data)


def parsed(svg):
    return ElementTree.fromstring(str(svg))


def of_class(svg, name):
    return [item for item in parsed(svg).iter() if name in (item.get("class") or "").split()]


def marks(svg, name):
    """How many dots, strokes or crosses the paths of a class draw."""
    return sum(path.get("d").count("M") for path in of_class(svg, name))


def words(svg):
    return " ".join(item.text or "" for item in parsed(svg).iter("text"))


def description(svg):
    return next(item.text for item in parsed(svg).iter() if item.tag.endswith("desc"))


def is_finite(svg):
    """Whether every number of a drawing is one."""
    return not re.search(r"nan|inf", re.sub(r">[^<]*<", "><", str(svg).lower()))
