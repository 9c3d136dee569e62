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


def test_every_new_grade_is_shown(page: ReportPage) -> None:
    page.show("8.5 of 10 points", "a < b", is_new=True)
    state = {"version": 1, "text": "8.5 of 10 points", "title": "a < b"}
    assert json.loads(get(page, "/state").read()) == state
    page.show("grading the saved files", "…")
    assert json.loads(get(page, "/state").read())["version"] == 1


def test_the_end_ends_the_server(tmp_path: Path) -> None:
    page = ReportPage(tmp_path / "report.html")
    page.close()
    with pytest.raises(ConnectionError):
        get(page, "/")


@pytest.mark.parametrize("path", ["/", "/report.html", "/state"])
def test_who_asks_for_another_host_is_refused(page: ReportPage, path: str) -> None:
    assert get(page, path, host="attacker.example").status == 403


@pytest.mark.parametrize("path", ["/../pyproject.toml", "/recordings/run.mcap", "/report.html/"])
def test_nothing_else_is_served(page: ReportPage, path: str) -> None:
    response = get(page, path)
    assert (response.status, response.read()) == (404, b"")
