"""The pages of ``rosgrade review``, and what they may change."""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route

from grader.assignment.load import LoadedAssignment
from grader.batch.edited_assignment import (
    check_lines,
    load_before,
    next_place,
    remember,
    with_check,
)
from grader.batch.ledger import Ledger
from grader.errors import RosgradeError, UsageError
from grader.review import edit
from grader.review.cluster import Cluster, clusters
from grader.review.model import Comment, Forgiven, StudentReview
from grader.review.store import ReviewConflict
from grader.server.local import LocalServer
from grader.server.refreshing import Refreshing
from grader.server.regrading import Regrading
from grader.server.review_pages import (
    render_class,
    render_clusters,
    render_code,
    render_panel,
    render_regrading,
    render_submission,
)
from grader.server.reviewed_class import ReviewedClass, ReviewedRow

_SANDBOX = "sandbox allow-scripts allow-downloads allow-popups"
_FRAMED = {"Content-Security-Policy": f"frame-ancestors 'self'; {_SANDBOX}"}
Answering = Callable[[Request, Any], Response]


class ReviewServer(LocalServer):
    """Serves the review of a class; ``by`` are the initials of who reviews."""

    def __init__(self, out: Path, by: str, port: int = 0) -> None:
        """Begin to serve, and bring the files of the class up to date; port 0 takes a free one.

        Raises:
            UsageError: There is no class in the folder.
            OSError: The port is taken.
        """
        pages = _Pages(ReviewedClass(out, by))
        routes = [
            Route("/", pages.overview),
            Route("/clusters", pages.clusters),
            Route("/clusters", _posted(pages.change_cluster), methods=["POST"]),
            Route("/regrade", pages.regrading),
            Route("/regrade", _posted(pages.regrade), methods=["POST"]),
            Route("/s/{name}/", pages.submission),
            Route("/s/{name}/source", pages.source),
            Route("/s/{name}/review", _posted(pages.change), methods=["POST"]),
            Route("/s/{name}/{file:path}", pages.report_file),
            Route("/instructor/{file}", pages.instructor_file),
        ]
        problems: dict[Any, Any] = {RosgradeError: _problem, ValidationError: _problem}
        super().__init__(Starlette(routes=routes, exception_handlers=problems), port)
        self._refreshing = pages.refreshing

    def close(self) -> None:
        """Stop, when all that was changed is in the reports."""
        super().close()
        self._refreshing.close()


def _problem(_: Request, error: Exception) -> Response:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        text = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        return PlainTextResponse(text, 422)
    return PlainTextResponse(str(error), 409 if isinstance(error, ReviewConflict) else 422)


def _posted(answer: Answering) -> Callable[[Request], Any]:
    """An endpoint that reads what a page sent, and answers in a thread: files may be slow."""

    async def endpoint(request: Request) -> Response:
        try:
            return await run_in_threadpool(answer, request, await request.json())
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, ValidationError):
                raise
            return PlainTextResponse(f"This request makes no sense: {error!r}", 400)

    return endpoint


class _Pages:
    def __init__(self, reviewed: ReviewedClass) -> None:
        self._class = reviewed
        writing = threading.Lock()
        self._job = Regrading(reviewed.ledger, writing)
        self.refreshing = Refreshing(Ledger(reviewed.out), writing)
        self._on_write = self.refreshing.poke

    def overview(self, _: Request) -> Response:
        return HTMLResponse(render_class(self._class, self._clusters()))

    def submission(self, request: Request) -> Response:
        row, rows = self._class.find(request.path_params["name"])
        waiting = "waiting" in request.query_params
        return HTMLResponse(render_submission(self._class, row, rows, only_waiting=waiting))

    def source(self, request: Request) -> Response:
        row, _ = self._class.find(request.path_params["name"])
        path = request.query_params.get("file", "")
        text = self._class.source(row).files.get(path)
        if text is None:
            raise UsageError(f"{path}: was not kept")
        return HTMLResponse(render_code(path, text))

    def report_file(self, request: Request) -> Response:
        """The report, and what it links to; nothing else of the folder."""
        row, _ = self._class.find(request.path_params["name"])
        folder, name = self._class.ledger.folder(row.row.id), request.path_params["file"]
        if name in ("report.html", "student-report.html") and (folder / name).is_file():
            return FileResponse(folder / name, headers=_FRAMED)
        recordings = {f"recordings/{one.name}": one for one in folder.glob("recordings/*")}
        if name not in recordings:
            return PlainTextResponse("There is no such file.", 404)
        return FileResponse(recordings[name], filename=recordings[name].name)

    def instructor_file(self, request: Request) -> Response:
        there = {one.name: one for one in (self._class.out / "instructor").glob("*.html")}
        file = there.get(request.path_params["file"])
        if file is None:
            return PlainTextResponse("There is no such page.", 404)
        return FileResponse(file, headers=_FRAMED)

    def change(self, request: Request, sent: Any) -> Response:
        """Change the review of one student, and answer what the page shows beside the report."""
        row, _ = self._class.find(request.path_params["name"])
        if sent["do"] == "undo":
            self._class.store.undo(row.key, sent["version"])
        else:
            review = self._class.store.student(row.key).content
            self._class.store.save(self._changed(row, review, sent), sent["version"])
            if sent["do"] == "comment" and sent.get("index") is None:
                self._count(str(sent["text"]).strip())
        self._on_write()
        row, _ = self._class.find(row.name)
        return HTMLResponse(render_panel(self._class, row, time.strftime("saved %H:%M:%S")))

    def _changed(self, row: ReviewedRow, review: StudentReview, sent: Any) -> StudentReview:
        by = self._class.by
        if sent["do"] == "score":
            adjustments = row.row.result.adjustments if row.row.result else ()
            item = next((one for one in adjustments if one.item == sent["item"]), None)
            if item is None:
                raise UsageError(f"{sent['item']}: is no item of this assignment any more")
            points = None if sent["points"] is None else float(sent["points"])
            return edit.scored(review, item, points, by, str(sent.get("note", "")))
        if sent["do"] == "comment":
            text, index = str(sent["text"]).strip(), sent.get("index")
            comment = Comment(text=text, by=by, file=sent.get("file"), line=sent.get("line"))
            return edit.commented(review, comment, index)
        if sent["do"] == "uncomment":
            return edit.uncommented(review, int(sent["index"]))
        return edit.noted(review, str(sent["notes"]))

    def _count(self, text: str) -> None:
        saved = self._class.store.of_class()
        self._class.store.save(edit.used(saved.content, text), saved.version)

    def _clusters(self) -> tuple[Cluster, ...]:
        rows = [row.row for row in self._class.rows()]
        return clusters(rows, self._class.of_class())

    def clusters(self, _: Request) -> Response:
        return HTMLResponse(render_clusters(self._class, self._clusters()))

    def change_cluster(self, _: Request, sent: Any) -> Response:
        """Forgive a cause, take that back, or comment it for all who have it."""
        named = (sent["check"], sent["cause"])
        cluster = next((one for one in self._clusters() if (one.check, one.cause) == named), None)
        if cluster is None:
            raise UsageError("Nobody fails for this cause any more. Load the page again.")
        store, by = self._class.store, self._class.by
        if sent["do"] == "comment":
            text = str(sent["text"]).strip()
            for key in dict.fromkeys(r.key for r in self._class.rows() if r.row.id in cluster.keys):
                saved = store.student(key)
                if text not in (one.text for one in saved.content.comments):
                    comment = Comment(text=text, by=by)
                    store.save(edit.commented(saved.content, comment), saved.version)
            self._count(text)
        else:
            now = None
            if sent["do"] == "forgive":
                share, reason = float(sent["share"]), str(sent["reason"])
                now = Forgiven(check=named[0], cause=named[1], share=share, reason=reason, by=by)
            store.save(edit.forgiven(store.of_class().content, *named, now), sent["version"])
        self._on_write()
        return PlainTextResponse(time.strftime("saved %H:%M:%S"))

    def regrading(self, request: Request) -> Response:
        check = request.query_params.get("check") or self._job.check
        lines = check_lines(self._class.loaded, check) if check else (0, "")
        back = load_before(self._class.ledger)
        return HTMLResponse(render_regrading(self._class, self._job, check, lines, back))

    def regrade(self, _: Request, sent: Any) -> Response:
        """Begin to judge the class: ``preview``, ``apply`` or ``back``."""
        ledger, check = self._class.ledger, str(sent.get("check", ""))

        def changed(place: Path) -> LoadedAssignment:
            return with_check(self._class.loaded, check, str(sent["text"]), place)

        if sent["do"] == "preview":
            scratch = Path(tempfile.mkdtemp(prefix="rosgrade-review-"))
            loaded = changed(scratch)
            self._job.start(
                "Preview", check, lambda: loaded, write=False, then=lambda: shutil.rmtree(scratch)
            )
            return PlainTextResponse("judging")
        if sent["do"] == "back":
            before = load_before(ledger)
            if before is None:
                raise UsageError("There is no assignment to go back to.")
            self._job.start("Back", check, lambda: before, write=True, then=self._regraded)
            return PlainTextResponse("judging")
        place = next_place(ledger)
        new = changed(place)
        remember(ledger, place)
        self._job.start("Apply", check, lambda: new, write=True, then=self._regraded)
        return PlainTextResponse("judging")

    def _regraded(self) -> None:
        self._class.__dict__.pop("loaded", None)
        self._on_write()
