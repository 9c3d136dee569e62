"""The report page that follows a watched submission: a small server for this machine only.

The report itself is served as it was written, with its own policy that forbids requests. It is
shown in a frame of an outer page, which asks this server for changes and reloads the frame.
"""

from __future__ import annotations

import json
import threading
from dataclasses import asdict, dataclass
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

ADDRESS = "127.0.0.1"
_NOT_YET = b"The first report comes soon."


@dataclass(frozen=True)
class PageState:
    """What the page shows around the report."""

    version: int = 0
    title: str = "rosgrade watch"
    text: str = "grading"


class ReportPage:
    """Serves a report while it lasts."""

    def __init__(self, report: Path, port: int = 0) -> None:
        """Begin to serve a report that need not be there yet; port 0 takes a free one."""
        self.state = PageState()
        self._report = report
        self._server = ThreadingHTTPServer((ADDRESS, port), partial(_Handler, self))
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True, name="page")
        self._thread.start()

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{self.host}/"

    @property
    def host(self) -> str:
        """Address and port, as a browser names them in its requests."""
        return f"{ADDRESS}:{self._server.server_address[1]}"

    def show(self, text: str, title: str, *, is_new: bool = False) -> None:
        """Show a text and a title on every open page."""
        self.state = PageState(self.state.version + is_new, title, text)

    def read_report(self) -> bytes | None:
        """The report as it is, or None where there is none yet."""
        try:
            return self._report.read_bytes()
        except OSError:
            return None

    def close(self) -> None:
        """Stop the server."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Handler(BaseHTTPRequestHandler):
    def __init__(self, page: ReportPage, *arguments: object) -> None:
        self._page = page
        super().__init__(*arguments)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Answer a request of the browser."""
        # Another site's name may be made to lead here; the browser still says whom it asks.
        if self.headers.get("Host") != self._page.host:
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"")
        elif self.path == "/":
            self._answer(HTTPStatus.OK, "text/html", _outer_page())
        elif self.path == "/report.html":
            report = self._page.read_report()
            kind = "text/plain" if report is None else "text/html"
            self._answer(HTTPStatus.OK, kind, report or _NOT_YET)
        elif self.path == "/state":
            state = json.dumps(asdict(self._page.state)).encode()
            self._answer(HTTPStatus.OK, "application/json", state)
        else:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"")

    def log_message(self, *_: object) -> None:
        """Say nothing: the terminal is for the grade."""

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Content-Security-Policy", "frame-ancestors 'self'")
        self.end_headers()
        self.wfile.write(body)


def _outer_page() -> bytes:
    from grader.report.html.page import render_page

    policy = "; connect-src 'self'; frame-src 'self'"
    return render_page("watch.html.j2", ("watch.css",), "watch.js", policy).encode()
