"""The handout of an assignment: what is asked for, and the checks with their points.

Checks that a student does not see before grading are only counted.
"""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from grader.assignment.binding import BoundCheck
from grader.assignment.contract.table import with_table
from grader.assignment.load import LoadedAssignment
from grader.assignment.model import ManualItem, Visibility
from grader.errors import UsageError
from grader.findings.words import counted
from grader.grade.model import total
from grader.report.html.page import render_page
from grader.report.text.words import counted_points

HANDOUT_FILE = "README.md"


@dataclass(frozen=True)
class Handout:
    """What a student is given: Markdown, visible checks, manual items, and what they give."""

    id: str
    title: str
    text: str
    checks: tuple[BoundCheck, ...]
    manual: tuple[ManualItem, ...]
    total: str


def make_handout(loaded: LoadedAssignment) -> Handout:
    """Collect what a student is given."""
    visible = tuple(b for b in loaded.checks if b.spec.visibility is Visibility.VISIBLE)
    file = loaded.folder / HANDOUT_FILE
    try:
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{file} cannot be read: {error}") from error
    text = with_table(text, loaded.assignment)
    all_points = total((*(one.spec.points for one in loaded.checks), loaded.withheld.points))
    here = total(bound.spec.points for bound in visible)
    hidden = len(loaded.checks) - len(visible) + loaded.withheld.checks
    words = f"{counted_points(all_points)} in all"
    if hidden:
        more = counted_points(total((all_points, -here)))
        checks = counted(hidden, "more check")
        words += f": {counted_points(here)} here, and {more} for {checks} at grading"
    assignment = loaded.assignment
    words += "."
    if assignment.manual:
        more = counted_points(total(item.points for item in assignment.manual))
        words += f" A person gives up to {more} in addition."
    return Handout(assignment.id, assignment.title, text, visible, assignment.manual, total=words)


def render_handout(handout: Handout) -> str:
    """Render the page of an assignment, which has no script."""
    text = Markup(_body(handout.text))
    return render_page("handout.html.j2", ("report.css", "handout.css"), handout=handout, text=text)


def _body(text: str) -> str:
    """The author's Markdown as HTML, below the page's own heading."""
    from markdown_it import MarkdownIt

    # HTML in it is shown as text. The page may load nothing, so an image stays a link to it.
    reader = MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")
    tokens = reader.parse(text)
    if tokens and tokens[0].type == "heading_open" and tokens[0].tag == "h1":
        tokens = tokens[3:]
    for token in tokens:
        if token.tag == "h1":
            token.tag = "h2"
    return str(reader.renderer.render(tokens, reader.options, {}))
