"""The report page that follows a watched submission.

The report itself is served as it was written, with its own policy that forbids requests. It is
shown in a frame of an outer page, which asks this server for changes and reloads the frame.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from grader.server.local import LocalServer

_NOT_YET = "The first report comes soon."


@dataclass(frozen=True)
class PageState:
    """What the page shows around the report."""

    version: int = 0
    title: str = "rosgrade watch"
    text: str = "grading"


class ReportPage(LocalServer):
    """Serves a report while it lasts."""

    def __init__(self, report: Path, port: int = 0) -> None:
        """Begin to serve a report that need not be there yet; port 0 takes a free one."""
        self.state = PageState()
        self._report = report
        routes = [
            Route("/", self._outer_page),
            Route("/report.html", self._read_report),
            Route("/state", self._state),
        ]
        super().__init__(Starlette(routes=routes), port)

    def show(self, text: str, title: str, *, is_new: bool = False) -> None:
        """Show a text and a title on every open page."""
        self.state = PageState(self.state.version + is_new, title, text)

    def _outer_page(self, _: Request) -> Response:
        from grader.report.html.page import render_page

        policy = "; connect-src 'self'; frame-src 'self'"
        return HTMLResponse(render_page("watch.html.j2", ("watch.css",), "watch.js", policy))

    def _read_report(self, _: Request) -> Response:
        try:
            return HTMLResponse(self._report.read_bytes())
        except OSError:
            return PlainTextResponse(_NOT_YET)

    def _state(self, _: Request) -> Response:
        return JSONResponse(asdict(self.state))
