"""An HTTP server for this machine only, in a thread of its own, and who may ask it.

Only a browser that opened the page's address may, and no other page. A port of the loopback can be
reached by every user of the machine and by every page that a browser shows. So each request needs
the token of the address, the right name of the host, and, to change something, to come from a page
of this server. https://owasp.org/www-community/attacks/csrf
"""

from __future__ import annotations

import os
import secrets
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

from grader.errors import RosgradeError, UsageError
from grader.review.store import ReviewConflict

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST_BYTES = 1024 * 1024
"""Most that a page may send at once."""
_READING = ("GET", "HEAD")
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'self'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Guard:
    """Stands before an application and lets in only who has the token."""

    def __init__(self, app: ASGIApp, host: str, token: str) -> None:
        """``host`` is address and port, as a browser names them in its requests."""
        self._app = app
        self._host = host
        self._token = token
        # A browser sends the cookies of one address to all of its ports.
        self._cookie = f"rosgrade-{host.rpartition(':')[2]}"
        self._once = ""

    def token_for_once(self) -> str:
        """A token that lets in the first who has it, instead of one given before."""
        self._once = secrets.token_urlsafe(32)
        return self._once

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or hand it on."""

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        request = Request(scope)
        await (self._refusal(request) or self._app)(scope, receive, with_headers)

    def _refusal(self, request: Request) -> Response | None:
        """What a request is answered at once, or None for one that may go on."""
        # Another site's name may be made to lead here; the browser still says whom it asks.
        if request.headers.get("Host") != self._host:
            return PlainTextResponse("This is not the address of this server.", 403)
        given = request.query_params.get("token")
        if given is not None and request.method == "GET" and self._lets_in(given):
            # The token leaves the address, so that no history and no screenshot shows it.
            answer = RedirectResponse(request.url.path, 303)
            # Not "strict": a browser that comes from a file would not send it after this answer.
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="lax")
            return answer
        if not self._is_token(request.cookies.get(self._cookie, "")):
            text = "Open the whole address that rosgrade printed: it ends with a token."
            return PlainTextResponse(text, 403)
        if request.method in _READING:
            return None
        if request.headers.get("Origin") != f"http://{self._host}":
            return PlainTextResponse("Only a page of this server may change something.", 403)
        length = request.headers.get("Content-Length", "")
        if not length.isdecimal():
            return PlainTextResponse("The length is missing.", 411)
        return PlainTextResponse("Too much at once.", 413) if int(length) > MOST_BYTES else None

    def _lets_in(self, given: str) -> bool:
        if self._once and secrets.compare_digest(given.encode(), self._once.encode()):
            self._once = ""
            return True
        return self._is_token(given)

    def _is_token(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self._token.encode())


def posted(answer: Callable[[Request, Any], Response]) -> Callable[[Request], Any]:
    """An endpoint that reads what a page sent, and answers in a thread: files may be slow."""

    async def endpoint(request: Request) -> Response:
        try:
            return await run_in_threadpool(answer, request, await request.json())
        except ValidationError:
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            return PlainTextResponse(f"This request makes no sense: {error!r}", 422)

    return endpoint


def _problem(_: Request, error: Exception) -> Response:
    text = str(error)
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        text = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    return PlainTextResponse(text, 409 if isinstance(error, ReviewConflict) else 422)


PROBLEMS: Mapping[Any, Any] = {RosgradeError: _problem, ValidationError: _problem}
"""How an application answers what cannot be done, as its ``exception_handlers``."""


ADDRESS = "127.0.0.1"


class LocalServer:
    """Serves an application on the loopback, to who knows its address."""

    def __init__(self, app: ASGIApp, port: int = 0) -> None:
        """Begin to serve; port 0 takes a free one.

        Raises:
            UsageError: The port is taken.
        """
        # Imported late: it takes a tenth of a second.
        import uvicorn

        self._token = secrets.token_urlsafe(32)
        try:
            self._socket = socket.create_server((ADDRESS, port))
        except OSError as error:
            raise UsageError(f"--port {port}: {error.strerror}") from error
        self.host = f"{ADDRESS}:{self._socket.getsockname()[1]}"
        """Address and port, as a browser names them in its requests."""
        self._guard = Guard(app, self.host, self._token)
        self._door: Path | None = None
        config = uvicorn.Config(
            self._guard,
            lifespan="off",
            ws="none",
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run, args=([self._socket],), daemon=True, name="server"
        )
        self._thread.start()

    @property
    def url(self) -> str:
        """What to open; no request without its token is answered."""
        return f"http://{self.host}/?token={self._token}"

    def door(self, folder: Path) -> str:
        """The address of a file in a folder that leads a browser to the page, once.

        Every user of the machine can read the command line of a browser, but not this file.
        """
        door = self._door = folder / "open.html"
        url = f"http://{self.host}/?token={self._guard.token_for_once()}"
        door.unlink(missing_ok=True)
        with os.fdopen(os.open(door, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(f'<!doctype html><meta http-equiv="refresh" content="0; url={url}">')
        return door.resolve().as_uri()

    def close(self) -> None:
        """Stop; requests that are being answered get a second."""
        if self._door is not None:
            self._door.unlink(missing_ok=True)
        self._server.should_exit = True
        self._thread.join()
        self._socket.close()
