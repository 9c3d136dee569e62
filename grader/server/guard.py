"""Who may ask the server: only a browser that opened the page's address, and no other page.

A port of the loopback can be reached by every user of the machine and by every page that a browser
shows. So each request needs the token of the address, the right name of the host, and, to change
something, to come from a page of this server. https://owasp.org/www-community/attacks/csrf
"""

from __future__ import annotations

import secrets
from typing import TYPE_CHECKING

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

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
