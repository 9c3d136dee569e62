"""``rosgrade explain``: an idea of ROS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markdown import Markdown

from grader.cli.screen.console import output_console, say
from grader.errors import UsageError
from grader.report.concepts import SCRIPT, STYLE, concepts
from grader.report.files import write_whole
from grader.report.html.page import render_page
from grader.spec.nearest_name import nearest_or_all


def explain(
    name: Annotated[str, typer.Argument(help="One idea; by default a list of all.")] = "index",
    html: Annotated[
        bool, typer.Option("--html", help="Write the page with its picture, to open in a browser.")
    ] = False,
) -> None:
    """Explain an idea of ROS, such as QoS. A failed check names the idea to read."""
    page = concepts().get(name)
    if page is None:
        known = nearest_or_all(name, concepts())
        raise UsageError(f"nothing to explain is called {name!r}.{known}")
    if html:
        styles = ("report.css", "handout.css", STYLE)
        write_whole(Path(f"{name}.html"), render_page("concept.html.j2", styles, SCRIPT, page=page))
        say(f"Page: {name}.html")
        return
    output_console().print(Markdown(page.plain, hyperlinks=False))
