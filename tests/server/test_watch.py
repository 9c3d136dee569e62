"""The page that follows a watched submission, asked as a browser would."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.findings.finding import Finding
from grader.grading.files import RESULT_FILE
from grader.report.files import write_whole
from grader.report.model.result import read_result, result_json
from grader.server.watch import ReportPage
from tests.grade.sample import Told
from tests.report.sample import judged
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


@pytest.fixture
def result_file(tmp_path: Path) -> Path:
    """A result whose check has two hints behind the first, of an assignment that counts them."""
    sample = judged([Told("topic", Finding.failed("a", "b"), hint=["one", "two", "three"])])
    file = tmp_path / RESULT_FILE
    counting = sample.result.model_copy(update={"hints_opened": {}})
    write_whole(file, result_json(counting))
    return file


def test_a_hint_that_is_opened_is_counted_beside_the_report(
    page: ReportPage, client: Client, result_file: Path
) -> None:
    before = read_result(result_file)
    page.show_hints(before)
    assert client.get("/state").json["hints"] == 0
    for number in (1, 2, 1):
        assert client.post("/hints", {"check": "topic", "number": number}).status == 200
    after = read_result(result_file)
    assert after.hints_opened == {"topic": 2}
    assert after.model_copy(update={"hints_opened": {}}) == before
    assert client.get("/state").json["hints"] == 2


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        ({"check": "topic", "number": 3}, 404),
        ({"check": "topic", "number": 0}, 404),
        ({"check": "topic", "number": "1"}, 404),
        ({"check": "other", "number": 1}, 404),
        ({"check": ["topic"], "number": 1}, 422),
        ({"number": 1}, 422),
        ([], 422),
    ],
)
def test_a_hint_that_is_not_there_is_not_counted(
    client: Client, result_file: Path, sent: object, status: int
) -> None:
    assert client.post("/hints", sent).status == status
    assert read_result(result_file).hints_opened == {}


def test_nothing_is_counted_where_the_author_does_not_want_it(
    page: ReportPage, client: Client, result_file: Path
) -> None:
    silent = read_result(result_file).model_copy(update={"hints_opened": None})
    write_whole(result_file, result_json(silent))
    page.show_hints(silent)
    assert client.get("/state").json["hints"] is None
    assert client.post("/hints", {"check": "topic", "number": 1}).status == 404
    assert read_result(result_file) == silent


def test_hints_are_counted_for_nobody_without_the_token(
    page: ReportPage, result_file: Path
) -> None:
    assert Client(page).post("/hints", {"check": "topic", "number": 1}).status == 403
    another = Client(page).open()
    sent = {"check": "topic", "number": 1}
    assert another.post("/hints", sent, Origin="http://attacker.example").status == 403
    assert read_result(result_file).hints_opened == {}


def test_a_result_that_was_deleted_is_a_refusal_and_no_crash(client: Client) -> None:
    answer = client.post("/hints", {"check": "topic", "number": 1})
    assert answer.status == 422 and "cannot be read" in answer.text
