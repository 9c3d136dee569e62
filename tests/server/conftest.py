"""A browser of a few lines: it asks as one would, and keeps the cookie."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from email.message import Message
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from grader.server.local import LocalServer
from grader.server.review import ReviewServer
from tests.server.make_class import make_class


@dataclass(frozen=True)
class Answer:
    """What a server answered."""

    status: int
    headers: Message
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode()

    @property
    def json(self):
        return json.loads(self.body)


@dataclass
class Client:
    """Asks a server; ``open`` gives the cookie for all later requests."""

    server: LocalServer
    cookie: str = ""

    def open(self) -> Client:
        path = urlsplit(self.server.url)
        answer = self.get(f"{path.path}?{path.query}")
        assert (answer.status, answer.headers["Location"]) == (303, "/")
        self.cookie = answer.headers["Set-Cookie"]
        return self

    def get(self, path: str, **headers: str) -> Answer:
        return self.ask("GET", path, None, headers)

    def post(self, path: str, body: object, **headers: str) -> Answer:
        own = {"Origin": f"http://{self.server.host}", "Content-Type": "application/json"}
        return self.ask("POST", path, json.dumps(body), own | headers)

    def ask(self, method: str, path: str, body: str | None, headers: dict[str, str]) -> Answer:
        cookie = {"Cookie": self.cookie.partition(";")[0]} if self.cookie else {}
        with closing(http.client.HTTPConnection(self.server.host, timeout=20)) as connection:
            connection.request(method, path, body, cookie | headers)
            answer = connection.getresponse()
            return Answer(answer.status, answer.headers, answer.read())


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return make_class(tmp_path)


@pytest.fixture
def review(out: Path) -> Iterator[ReviewServer]:
    server = ReviewServer(out, "AK")
    yield server
    server.close()


@pytest.fixture
def client(review: ReviewServer) -> Client:
    return Client(review).open()
