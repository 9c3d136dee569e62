"""The pages of ``rosgrade review``."""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route

from grader.errors import RosgradeError, UsageError
from grader.findings.finding import Status
from grader.gradebook.class_files import INSTRUCTOR_FOLDER
from grader.gradebook.edited_assignment import load_before, new_place, with_text
from grader.report.files import folder_name
from grader.report.html.overview import render_overview
from grader.report.html.page import environment, render_page
from grader.report.html.source_code import ShownSource, code_lines
from grader.report.model.class_row import ClassRow
from grader.report.model.excerpt import places
from grader.server.background import Background
from grader.server.changes import change_cluster, change_student
from grader.server.local import PROBLEMS, LocalServer, posted
from grader.server.reviewed_class import ReviewedClass, ReviewedRow

MOST_CLUSTERS = 60
MOST_OF_BANK = 30
_SANDBOX = "sandbox allow-scripts allow-downloads allow-popups"
_FRAMED = {"Content-Security-Policy": f"frame-ancestors 'self'; {_SANDBOX}"}
_REPORTS = ("report.html", "student-report.html")


class ReviewServer(LocalServer):
    """Serves the review of a class; ``by`` are the initials of who reviews."""

    def __init__(self, out: Path, by: str, port: int = 0) -> None:
        """Begin to serve, and bring the files of the class up to date; port 0 takes a free one.

        Raises:
            UsageError: There is no class in the folder, or the port is taken.
        """
        self._class = ReviewedClass(out, by)
        self._scratch = tempfile.TemporaryDirectory(prefix="rosgrade-review-")
        routes = [
            Route("/", self._overview),
            Route("/clusters", self._clusters),
            Route("/clusters", posted(self._change_cluster), methods=["POST"]),
            Route("/clusters/example", self._example),
            Route("/regrade", self._regrading),
            Route("/regrade", posted(self._regrade), methods=["POST"]),
            Route("/s/{name}/", self._submission),
            Route("/s/{name}/source", self._source),
            Route("/s/{name}/review", posted(self._change), methods=["POST"]),
            Route("/s/{name}/again", self._again),
            Route("/s/{name}/again", posted(self._run_again), methods=["POST"]),
            Route("/s/{name}/{file:path}", self._report_file),
            Route(f"/{INSTRUCTOR_FOLDER}/{{file}}", self._instructor_file),
        ]
        super().__init__(Starlette(routes=routes, exception_handlers=PROBLEMS), port)
        self._background = Background(self._class)

    def close(self) -> None:
        """Stop, when all that was changed is in the reports."""
        super().close()
        self._background.close()
        self._scratch.cleanup()

    def _overview(self, _: Request) -> Response:
        rows = self._class.rows()
        names = {row.row.id: row.name for row in rows}

        def link(row: ClassRow) -> str:
            return f"s/{quote(names[row.id])}/"

        links = {"Causes of failures": "clusters", "Regrade with a changed check": "regrade"}
        first = next((row.row for row in rows if row.row.waits_for), None)
        if first is not None:
            links = {"Begin with the first that waits": f"{link(first)}?waiting", **links}
        causes = self._class.clusters()
        vanished = self._class.store.vanished({row.entry.review_key for row in rows})
        pages = sorted(file.name for file in (self._class.out / INSTRUCTOR_FOLDER).glob("*.html"))
        class_rows = [row.row for row in rows]
        return HTMLResponse(render_overview(class_rows, causes, vanished, pages, link, links))

    def _submission(self, request: Request) -> Response:
        row, rows = self._class.find(request.path_params["name"])
        only_waiting = "waiting" in request.query_params
        index = [other.row.id for other in rows].index(row.attempts[-1])

        def is_listed(other: ReviewedRow) -> bool:
            return bool(other.row.waits_for) or not only_waiting

        return _page(
            "review",
            row=row,
            number=index + 1,
            count=len(rows),
            before=next(filter(is_listed, reversed(rows[:index])), None),
            after=next(filter(is_listed, rows[index + 1 :]), None),
            only_waiting=only_waiting,
            waiting=len([other for other in rows if other.row.waits_for]),
            source=self._class.source(row),
            link=lambda other: f"../{quote(other.name)}/",
            attempts=[f"../{quote(folder_name(key))}/" for key in row.attempts],
            shown=row.attempts.index(row.row.id),
            panel=Markup(self._panel(row)),
            problem=self._background.problem,
        )

    def _panel(self, row: ReviewedRow, saved: str = "") -> str:
        adjustments = row.row.result.adjustments if row.row.result is not None else ()
        try:
            levels = {one.id: one.levels for one in self._class.loaded.assignment.manual}
        except RosgradeError:
            # The assignment is not there any more: any number of points can be given.
            levels = {}
        whole = self._class.ledger.whole_result(row.row.id)
        return _part(
            "review_panel.html.j2",
            row=row,
            result=row.row.result,
            items=[one for one in adjustments if one.kind == "manual" and one.item],
            others=[one for one in adjustments if one.kind not in ("manual", "given")],
            counts=row.counts,
            levels=levels,
            bank=self._class.store.of_class().content.bank[:MOST_OF_BANK],
            findings=[check for check in row.row.judged if check.status is not Status.PASSED],
            places={one.id: one.evidence.places for one in (whole.checks if whole else ())},
            saved=saved,
        )

    def _source(self, request: Request) -> Response:
        row, _ = self._class.find(request.path_params["name"])
        path = request.query_params.get("file", "")
        text = self._class.source(row).files.get(path)
        if text is None:
            raise UsageError(f"{path}: was not kept")
        return HTMLResponse(_part("review_code.html.j2", lines=code_lines(path, text)))

    def _change(self, request: Request, sent: Any) -> Response:
        row, _ = self._class.find(request.path_params["name"])
        change_student(self._class, row, sent)
        self._background.refresh()
        row, _ = self._class.find(row.name)
        return HTMLResponse(self._panel(row, time.strftime("saved %H:%M:%S")))

    def _run_again(self, request: Request, _: Any) -> Response:
        row, _ = self._class.find(request.path_params["name"])
        self._background.run_again(row.row.id)
        return PlainTextResponse("begun")

    def _again(self, request: Request) -> Response:
        """How far it is: 202 while it runs, and why where it could not be run."""
        row, _ = self._class.find(request.path_params["name"])
        again = self._background.again.get(row.row.id)
        if again is None or again.running:
            return PlainTextResponse("", 202 if again else 200)
        del self._background.again[row.row.id]
        return PlainTextResponse(again.problem, 422 if again.problem else 200)

    def _report_file(self, request: Request) -> Response:
        """The report, and the recordings that it links to; nothing else of the folder."""
        row, _ = self._class.find(request.path_params["name"])
        folder, name = self._class.ledger.folder(row.row.id), request.path_params["file"]
        if name in _REPORTS and (folder / name).is_file():
            return FileResponse(folder / name, headers=_FRAMED)
        recordings = {f"recordings/{one.name}": one for one in folder.glob("recordings/*")}
        if name not in recordings:
            return PlainTextResponse("There is no such file.", 404)
        return FileResponse(recordings[name], filename=recordings[name].name)

    def _instructor_file(self, request: Request) -> Response:
        pages = (self._class.out / INSTRUCTOR_FOLDER).glob("*.html")
        file = {page.name: page for page in pages}.get(request.path_params["file"])
        if file is None:
            return PlainTextResponse("There is no such page.", 404)
        return FileResponse(file, headers=_FRAMED)

    def _clusters(self, _: Request) -> Response:
        clusters = self._class.clusters()
        return _page(
            "review_clusters",
            clusters=clusters[:MOST_CLUSTERS],
            left=len(clusters) - MOST_CLUSTERS,
            rows={row.row.id: row for row in self._class.rows()},
            quote=quote,
        )

    def _example(self, request: Request) -> Response:
        """Two students of a cluster, each with the check, and the lines of source around it."""
        examples = []
        for name in request.query_params.getlist("name")[:2]:
            row, _ = self._class.find(name)
            result = self._class.ledger.whole_result(row.row.id)
            checks = {check.id: check for check in (result.checks if result else ())}
            check = checks.get(request.query_params.get("check", ""))
            if check is None:
                continue
            source = ShownSource(self._class.source(row).files, None)
            excerpts = ((one, source.show(one, "example")[1]) for one in places(check))
            place, lines = next((excerpt for excerpt in excerpts if excerpt[1]), (None, []))
            examples.append((row, check, place, lines))
        return HTMLResponse(_part("review_example.html.j2", examples=examples))

    def _change_cluster(self, _: Request, sent: Any) -> Response:
        change_cluster(self._class, sent)
        self._background.refresh()
        return PlainTextResponse("saved")

    def _regrading(self, request: Request) -> Response:
        # A copy, so that all of the page shows one moment of it.
        judging, loaded = replace(self._background.judging), self._class.loaded
        check = request.query_params.get("check") or judging.check
        back = load_before(self._class.ledger)
        return _page(
            "review_regrade",
            check=check,
            text=loaded.file.read_text(encoding="utf-8"),
            judging=judging,
            changed=judging.changed,
            back=back,
            loaded=loaded,
        )

    def _regrade(self, _: Request, sent: Any) -> Response:
        """Begin to judge the class: ``preview``, ``apply`` or ``back``."""
        ledger, check, do = self._class.ledger, str(sent["check"]), sent["do"]
        if self._background.judging.running:
            raise UsageError("The class is being judged. Wait until that has ended.")
        if do == "back":
            new = load_before(ledger)
        else:
            is_preview = do == "preview"
            place = Path(tempfile.mkdtemp(dir=self._scratch.name)) if is_preview else None
            new = with_text(self._class.loaded, str(sent["text"]), place or new_place(ledger))
        if new is None:
            raise UsageError("There is no assignment to go back to.")
        self._background.judge(do.capitalize(), check, new, write=do != "preview")
        return PlainTextResponse("judging")


def _page(name: str, **values: Any) -> Response:
    policy = "; connect-src 'self'; frame-src 'self'"
    styles = ("report.css", "review.css")
    return HTMLResponse(
        render_page(f"{name}.html.j2", styles, f"{name}.js", policy=policy, **values)
    )


def _part(template: str, **values: Any) -> str:
    return environment().get_template(template).render(values)
