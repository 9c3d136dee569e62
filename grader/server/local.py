"""An HTTP server for this machine only, in a thread of its own."""

from __future__ import annotations

import os
import secrets
import socket
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import UsageError
from grader.server.guard import Guard

if TYPE_CHECKING:
    from starlette.types import ASGIApp

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
