"""The report page that follows a watched submission.

The report itself is served as it was written, with its own policy that forbids requests. It is
shown in a frame of an outer page, which asks this server for changes and reloads the frame.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from grader.grading.files import RESULT_FILE
from grader.report.files import write_whole
from grader.report.model.result import read_result, result_json
from grader.report.model.result_model import Result
from grader.server.local import PROBLEMS, LocalServer, posted

_NOT_YET = "The first report comes soon."


@dataclass(frozen=True)
class PageState:
    """What the page shows around the report.

    Attributes:
        version: Of the report.
        is_old: A grading runs, so the report is that of an earlier save.
        phases: What is done now, by scenario; of the whole under an empty name.
        early: What is known already, while the rest runs.
        changed: By the last save, in one line.
        scores: Since watching began; None where there was no grade.
        most: Points that can be had.
        hints: How many further hints were opened; None if they are not counted.
    """

    version: int = 0
    title: str = "rosgrade watch"
    text: str = "grading"
    is_old: bool = False
    phases: Mapping[str, str] = field(default_factory=dict)
    early: tuple[str, ...] = ()
    changed: str = ""
    scores: tuple[float | None, ...] = ()
    most: float = 0.0
    hints: int | None = None


class ReportPage(LocalServer):
    """Serves a report while it lasts."""

    def __init__(self, report: Path, port: int = 0) -> None:
        """Begin to serve a report that need not be there yet; port 0 takes a free one."""
        self.state = PageState()
        self.writing = threading.Lock()
        """Held while the result is written: no hint that is opened meanwhile is lost."""
        self._report = report
        self._lock = threading.RLock()
        routes = [
            Route("/", self._outer_page),
            Route("/report.html", self._read_report),
            Route("/state", self._state),
            Route("/hints", posted(self._open_hint), methods=["POST"]),
        ]
        super().__init__(Starlette(routes=routes, exception_handlers=PROBLEMS), port)

    def show(self, *, is_new: bool = False, **changes: Any) -> None:
        """Change what every open page shows around the report, which may be a new one."""
        with self._lock:
            self.state = replace(self.state, version=self.state.version + is_new, **changes)

    def begin(self, title: str) -> None:
        """Show that a grading begins, and that the report is that of an earlier save."""
        self.show(
            text="grading the saved files",
            title=title,
            is_old=True,
            phases={},
            early=(),
            changed="",
        )

    def show_grade(
        self, text: str, title: str, changed: str, score: tuple[float | None, float]
    ) -> None:
        """Show a new report, and a score of so many points beside those before."""
        scores = (*self.state.scores, score[0])
        self.show(text=text, title=title, changed=changed, scores=scores, most=score[1])
        self.show(is_new=True, is_old=False)

    def show_phase(self, scenario: str, text: str) -> None:
        """Show what a scenario does now; the first takes the place of what was done before."""
        with self._lock:
            others = {name: one for name, one in self.state.phases.items() if name and scenario}
            self.show(phases={**others, scenario: text})

    def show_hints(self, result: Result) -> None:
        """Show how many hints were opened, if they are counted."""
        counts = result.hints_opened
        self.show(hints=None if counts is None else sum(counts.values()))

    def _outer_page(self, _: Request) -> Response:
        from grader.report.html.page import render_page

        policy = "; connect-src 'self'; frame-src 'self'"
        return HTMLResponse(render_page("watch.html.j2", ("watch.css",), "watch.js", policy=policy))

    def _read_report(self, _: Request) -> Response:
        try:
            return HTMLResponse(self._report.read_bytes())
        except OSError:
            return PlainTextResponse(_NOT_YET)

    def _open_hint(self, _: Request, sent: Any) -> Response:
        """Count a further hint that was opened, by its number from 1."""
        check, number, file = sent["check"], sent["number"], self._report.with_name(RESULT_FILE)
        with self.writing:
            result = read_result(file)
            counts = result.hints_opened
            steps = {one.id: range(1, len(one.further_hints) + 1) for one in result.checks}
            if counts is None or number not in steps.get(check, ()):
                return PlainTextResponse("There is no such hint, or hints are not counted.", 404)
            counts = {**counts, check: max(number, counts.get(check, 0))}
            result = result.model_copy(update={"hints_opened": counts})
            write_whole(file, result_json(result))
            self.show_hints(result)
        return PlainTextResponse("counted")

    def _state(self, _: Request) -> Response:
        return JSONResponse(asdict(self.state))
