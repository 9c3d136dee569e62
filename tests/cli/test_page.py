"""The page that follows a watched submission, asked as a browser would."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.cli.screen.page import ReportPage


@pytest.fixture
def page(tmp_path: Path) -> Iterator[ReportPage]:
    made = ReportPage(tmp_path / "report.html")
    yield made
    made.close()


def get(page: ReportPage, path: str, host: str | None = None) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(page.host, timeout=20)
    connection.request("GET", path, headers={"Host": host or page.host})
    return connection.getresponse()


def next_state(response: http.client.HTTPResponse) -> dict[str, object]:
    line = response.readline().decode()
    assert response.readline() == b"\n"
    assert line.startswith("data: ")
    found: dict[str, object] = json.loads(line.removeprefix("data: "))
    return found


def test_the_report_is_served_as_it_was_written(page: ReportPage, tmp_path: Path) -> None:
    assert get(page, "/report.html").read() == b"The first report comes soon."
    (tmp_path / "report.html").write_text("<p>8.5 of 10", encoding="utf-8")
    response = get(page, "/report.html")
    assert response.read() == b"<p>8.5 of 10"
    assert response.headers["Content-Type"] == "text/html; charset=utf-8"
    assert response.headers["Cache-Control"] == "no-store"


def test_the_page_around_it_may_only_talk_to_this_server(page: ReportPage) -> None:
    html = get(page, "/").read().decode()
    assert "default-src &#39;none&#39;" in html and "connect-src &#39;self&#39;" in html
    assert "unsafe" not in html
    assert '<iframe src="report.html"' in html


def test_every_new_grade_is_told_as_it_comes(page: ReportPage) -> None:
    events = get(page, "/events")
    assert events.headers["Content-Type"] == "text/event-stream"
    assert next_state(events)["version"] == 0
    page.tell("8.5 of 10 points", "a < b", is_new=True)
    assert next_state(events) == {"version": 1, "told": "8.5 of 10 points", "title": "a < b"}
    page.tell("grading what was saved", "…")
    assert next_state(events)["version"] == 1


def test_the_end_ends_every_connection(tmp_path: Path) -> None:
    page = ReportPage(tmp_path / "report.html")
    events = get(page, "/events")
    next_state(events)
    page.close()
    assert events.read() == b""
    with pytest.raises(ConnectionError):
        get(page, "/")


@pytest.mark.parametrize("path", ["/", "/report.html", "/events"])
def test_who_asks_for_another_host_is_refused(page: ReportPage, path: str) -> None:
    assert get(page, path, host="attacker.example").status == 403


@pytest.mark.parametrize("path", ["/../pyproject.toml", "/recordings/run.mcap", "/report.html/"])
def test_nothing_else_is_served(page: ReportPage, path: str) -> None:
    response = get(page, path)
    assert (response.status, response.read()) == (404, b"")
