"""The page that follows a watched submission, asked as a browser would."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.server.watch import ReportPage
from tests.server.conftest import Client


@pytest.fixture
def page(tmp_path: Path) -> Iterator[ReportPage]:
    made = ReportPage(tmp_path / "report.html")
    yield made
    made.close()


@pytest.fixture
def client(page: ReportPage) -> Client:
    return Client(page).open()


def test_the_report_is_served_as_it_was_written(client: Client, tmp_path: Path) -> None:
    assert client.get("/report.html").body == b"The first report comes soon."
    (tmp_path / "report.html").write_text("<p>8.5 of 10", encoding="utf-8")
    response = client.get("/report.html")
    assert response.body == b"<p>8.5 of 10"
    assert response.headers["Content-Type"] == "text/html; charset=utf-8"


def test_the_page_around_it_may_only_talk_to_this_server(client: Client) -> None:
    html = client.get("/").text
    assert "default-src &#39;none&#39;" in html and "connect-src &#39;self&#39;" in html
    assert "unsafe" not in html
    assert '<iframe src="report.html"' in html


def test_every_new_grade_is_shown(page: ReportPage, client: Client) -> None:
    page.show(text="8.5 of 10 points", title="a < b", is_new=True)
    state = client.get("/state").json
    assert (state["version"], state["text"], state["title"]) == (1, "8.5 of 10 points", "a < b")
    page.show(text="grading the saved files", is_old=True)
    state = client.get("/state").json
    assert (state["version"], state["is_old"]) == (1, True)


def test_what_it_does_and_what_is_known_already_is_shown(page: ReportPage, client: Client) -> None:
    page.show_phase("", "building bot_publisher")
    assert client.get("/state").json["phases"] == {"": "building bot_publisher"}
    page.show_phase("run", "recording")
    page.show_phase("stop", "recorded")
    page.show(early=("period passes now",))
    state = client.get("/state").json
    assert state["phases"] == {"run": "recording", "stop": "recorded"}
    assert state["early"] == ["period passes now"]


def test_the_end_ends_the_server(tmp_path: Path) -> None:
    page = ReportPage(tmp_path / "report.html")
    client = Client(page).open()
    page.close()
    with pytest.raises(OSError):
        client.get("/")


@pytest.mark.parametrize("path", ["/../pyproject.toml", "/recordings/run.mcap"])
def test_nothing_else_is_served(client: Client, path: str) -> None:
    assert client.get(path).status == 404
