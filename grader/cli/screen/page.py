"""The report page that follows a watched submission: a small server for this machine only.

The report itself is served as it was written, with its own policy that forbids requests. It is
shown in a frame of a page of ours, which is told of each new report and loads the frame again.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

ADDRESS = "127.0.0.1"
_ALIVE_S = 15.0
"""How often a silent connection is tried, so that a closed tab does not keep its thread."""
_NOT_YET = b"The first report comes soon."


@dataclass(frozen=True)
class PageState:
    """What the page shows around the report."""

    version: int = 0
    title: str = "rosgrade watch"
    told: str = "grading"


class ReportPage:
    """Serves a report while it lasts."""

    def __init__(self, report: Path, port: int = 0) -> None:
        """Begin to serve.

        Args:
            report: The report's file; it need not be there yet.
            port: Of this machine; 0 takes a free one.
        """
        self._report = report
        self._state = PageState()
        self._open = True
        self._changed = threading.Condition()
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

    def tell(self, told: str, title: str, *, is_new: bool = False) -> None:
        """Let every open page show something."""
        with self._changed:
            self._state = PageState(self._state.version + is_new, title, told)
            self._changed.notify_all()

    def states(self) -> Iterator[PageState | None]:
        """What to show: now, and at every change; None where nothing happens for a while."""
        shown: PageState | None = None
        while True:
            with self._changed:
                self._changed.wait_for(partial(self._has_news, shown), timeout=_ALIVE_S)
                if not self._open:
                    return
                is_new, shown = self._state is not shown, self._state
            yield shown if is_new else None

    def _has_news(self, shown: PageState | None) -> bool:
        return self._state is not shown or not self._open

    def read_report(self) -> bytes | None:
        """The report as it is, or None where there is none yet."""
        try:
            return self._report.read_bytes()
        except OSError:
            return None

    def close(self) -> None:
        """End it and every connection."""
        with self._changed:
            self._open = False
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    def __init__(self, page: ReportPage, *arguments: object) -> None:
        self._page = page
        super().__init__(*arguments)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Answer."""
        # Another site's name may be made to lead here; the browser still says whom it asks.
        if self.headers.get("Host") != self._page.host:
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"")
        elif self.path == "/":
            self._answer(HTTPStatus.OK, "text/html", _outer_page())
        elif self.path == "/report.html":
            report = self._page.read_report()
            kind = "text/plain" if report is None else "text/html"
            self._answer(HTTPStatus.OK, kind, report or _NOT_YET)
        elif self.path == "/events":
            self._tell_events()
        else:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"")

    def log_message(self, *_: object) -> None:
        """Say nothing: the terminal is for the grade."""

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self._send_common_headers()
        self.wfile.write(body)

    def _tell_events(self) -> None:
        """Tell every state as it comes (server-sent events of the HTML standard)."""
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream")
        self._send_common_headers()
        try:
            for state in self._page.states():
                line = ": nothing new" if state is None else f"data: {json.dumps(asdict(state))}"
                self.wfile.write(f"{line}\n\n".encode())
        except OSError:
            # The tab was closed.
            return

    def _send_common_headers(self) -> None:
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Content-Security-Policy", "frame-ancestors 'self'")
        self.end_headers()


def _outer_page() -> bytes:
    from grader.report.html.page import render_page

    policy = "; connect-src 'self'; frame-src 'self'"
    return render_page("watch.html.j2", ("watch.css",), "watch.js", policy).encode()
