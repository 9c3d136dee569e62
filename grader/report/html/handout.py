"""The handout of an assignment: what is asked for, and the checks with their points.

Whatever a student does not get to see before grading is only counted.
"""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from grader.assignment.binding import BoundCheck
from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Visibility
from grader.errors import UsageError
from grader.grade.points import total
from grader.report.html.page import render_page
from grader.report.text.words import counted_points

HANDOUT_FILE = "README.md"


@dataclass(frozen=True)
class Handout:
    """What a student is given.

    Attributes:
        text: The handout in Markdown; empty where the author wrote none.
    """

    id: str
    title: str
    text: str
    checks: tuple[BoundCheck, ...]
    hidden: int
    hidden_points: float

    @property
    def points(self) -> float:
        """What the visible checks give."""
        return total(bound.spec.points for bound in self.checks)

    @property
    def total(self) -> str:
        """What there is to be earned, in words."""
        all_points = counted_points(total((self.points, self.hidden_points)))
        if not self.hidden:
            return f"{all_points} in all."
        checks = "1 more check" if self.hidden == 1 else f"{self.hidden} more checks"
        return (
            f"{all_points} in all: {counted_points(self.points)} here, and "
            f"{counted_points(self.hidden_points)} for {checks} at grading."
        )


def make_handout(loaded: LoadedAssignment) -> Handout:
    """Collect what a student is given.

    Raises:
        UsageError: Its handout cannot be read.
    """
    visible = [b for b in loaded.checks if b.spec.visibility is Visibility.VISIBLE]
    hidden = [b for b in loaded.checks if b.spec.visibility is not Visibility.VISIBLE]
    file = loaded.folder / HANDOUT_FILE
    try:
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{file} cannot be read: {error}") from error
    return Handout(
        id=loaded.assignment.id,
        title=loaded.assignment.title,
        text=text,
        checks=tuple(visible),
        hidden=len(hidden),
        hidden_points=total(bound.spec.points for bound in hidden),
    )


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
