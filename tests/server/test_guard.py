"""Who is answered: only a browser with the token, and to change something only an own page."""

from __future__ import annotations

import re
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from grader.server.local import LocalServer
from tests.server.conftest import Client


@pytest.fixture(scope="module")
def server() -> Iterator[LocalServer]:
    def answer(_: Request) -> PlainTextResponse:
        return PlainTextResponse("grades")

    made = LocalServer(Starlette(routes=[Route("/", answer, methods=["GET", "POST"])]))
    yield made
    made.close()


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/anything"])
def test_nobody_reads_without_the_token(server: LocalServer, path: str) -> None:
    response = Client(server).get(path)
    assert response.status == 403
    assert b"grades" not in response.body


def test_the_token_becomes_a_cookie_that_no_script_and_no_other_site_can_use(
    server: LocalServer,
) -> None:
    client = Client(server).open()
    assert "HttpOnly" in client.cookie and "SameSite=lax" in client.cookie
    assert client.get("/").body == b"grades"


def test_a_browser_is_led_in_by_a_file_that_only_its_user_can_read_and_only_once(
    server: LocalServer, tmp_path: Path
) -> None:
    file = Path(server.door(tmp_path).removeprefix("file://"))
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    token = re.findall(r"token=([\w-]+)", file.read_text())[0]
    assert token not in server.url
    assert Client(server).get(f"/?token={token}").status == 303
    assert Client(server).get(f"/?token={token}").status == 403


def test_who_asks_for_another_host_is_refused_even_with_the_token(server: LocalServer) -> None:
    assert Client(server).open().get("/", Host="attacker.example").status == 403


@pytest.mark.parametrize("origin", ["http://127.0.0.1:1", "null", "https://attacker.example"])
def test_another_page_of_the_same_browser_changes_nothing(server: LocalServer, origin: str) -> None:
    client = Client(server).open()
    assert client.post("/", {}, Origin=origin).status == 403
    assert client.post("/", {}).body == b"grades"


def test_nothing_is_written_without_the_token(server: LocalServer) -> None:
    assert Client(server).post("/", {}).status == 403


def test_no_answer_is_kept_framed_or_guessed_at(server: LocalServer) -> None:
    headers = Client(server).open().get("/").headers
    assert headers["Cache-Control"] == "no-store"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Content-Security-Policy"] == "frame-ancestors 'self'"
    assert "Access-Control-Allow-Origin" not in headers


def test_too_much_at_once_is_refused(server: LocalServer) -> None:
    assert Client(server).open().post("/", "x" * 1_100_000).status == 413


def test_only_this_machine_is_listened_to(server: LocalServer) -> None:
    assert server.host.startswith("127.0.0.1:")
