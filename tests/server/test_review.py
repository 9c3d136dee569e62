"""The review of a class over HTTP, as its pages use it: nothing is lost, nothing else is served."""

from __future__ import annotations

import csv
import html
import re
from pathlib import Path
from urllib.parse import quote

import pytest

from grader.report.files import folder_name
from grader.report.model.result import read_result
from grader.review.store import ReviewStore
from grader.server.review import ReviewServer
from tests.server.conftest import Answer, Client
from tests.server.make_class import NODE, STUDENTS, YAML

ODD = 'd "<b>eli</b>'


def version(client: Client, key: str) -> str:
    found = re.search(r'data-version="(\w*)"', client.get(page(key)).text)
    assert found
    return found[1]


def page(key: str) -> str:
    return f"/s/{quote(folder_name(key))}/"


def change(client: Client, key: str, **sent: object) -> Answer:
    return client.post(f"{page(key)}review", {"version": version(client, key), **sent})


def cluster(client: Client, was: float = 0) -> dict[str, object]:
    text = client.get("/clusters").text
    found = re.search(r'data-check="docs" data-cause="([^"]+)"', text)
    assert found
    return {"check": "docs", "cause": html.unescape(found[1]), "was": was}


def ended(client: Client) -> str:
    """The page of a regrade when that has ended."""
    while 'data-running="yes"' in (text := client.get("/regrade?check=docs").text):
        pass
    return text


def test_points_and_comments_are_on_the_disk_when_they_are_said_to_be_saved(
    out: Path, client: Client
) -> None:
    answer = change(client, "ben", do="score", item="readme", points=1, note="short")
    assert answer.status == 200 and re.search(r'data-saved="saved \d\d:\d\d:\d\d"', answer.text)
    assert change(client, "ben", do="comment", text="Why?", file=NODE, line=6).status == 200
    review = ReviewStore(out).student("ben").content
    assert (review.manual["readme"].points, review.manual["readme"].by) == (1, "AK")
    assert (review.comments[0].line, review.comments[0].by) == (6, "AK")


def test_what_was_written_is_in_reports_and_gradebook_when_the_server_ends(
    out: Path, review: ReviewServer, client: Client
) -> None:
    for item, points in (("readme", 2), ("oral", 4.5)):
        change(client, "ana", do="score", item=item, points=points, note="")
    change(client, "ana", do="comment", text="Well done & clear")
    review.close()
    folder = out / "submissions" / "ana"
    assert read_result(folder / "result.json").final_score == 6 + 2 + 4.5
    assert "Well done &amp; clear" in (folder / "report.html").read_text(encoding="utf-8")
    with (out / "grades.csv").open(encoding="utf-8-sig") as file:
        rows = {row["submission"]: row for row in csv.DictReader(file)}
    assert rows["ana"]["score"] == "12.5"


def test_the_second_of_two_reviewers_is_told_and_overwrites_nothing(
    out: Path, client: Client
) -> None:
    seen = version(client, "ben")
    assert change(client, "ben", do="score", item="oral", points=3, note="").status == 200
    late = {"version": seen, "do": "score", "item": "oral", "points": 1, "note": ""}
    answer = client.post(f"{page('ben')}review", late)
    assert answer.status == 409 and "changed meanwhile" in answer.text
    assert ReviewStore(out).student("ben").content.manual["oral"].points == 3


def test_a_review_file_that_is_nonsense_is_named_with_its_line_and_kept(
    out: Path, client: Client
) -> None:
    file = ReviewStore(out).file("ben")
    file.parent.mkdir(exist_ok=True)
    file.write_text("key: ben\nmanual: {readme: {points: many, by: AK}}\n", encoding="utf-8")
    assert "ben.yaml:2: manual.readme.points" in client.get(page("ben")).text
    overview = client.get("/").text
    assert "ben.yaml:2" in overview and "Class overview" in overview
    answer = change(client, "ben", do="comment", text="Why?")
    assert answer.status == 422 and "ben.yaml:2" in answer.text
    assert "many" in file.read_text(encoding="utf-8")
    assert change(client, "ana", do="comment", text="Fine").status == 200


def test_an_undo_takes_back_the_last_change(out: Path, client: Client) -> None:
    change(client, "ben", do="score", item="readme", points=1, note="")
    change(client, "ben", do="score", item="readme", points=2, note="")
    change(client, "ben", do="undo")
    assert ReviewStore(out).student("ben").content.manual["readme"].points == 1
    change(client, "ben", do="undo")
    assert not ReviewStore(out).student("ben").content.manual
    answer = change(client, "ben", do="undo")
    assert answer.status == 422 and "nothing to undo" in answer.text


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        ({"do": "score", "item": "readme", "points": 3, "note": ""}, 422),
        ({"do": "score", "item": "readme", "points": -1, "note": ""}, 422),
        ({"do": "score", "item": "another", "points": 1, "note": ""}, 422),
        ({"do": "score", "item": "readme", "points": "many", "note": ""}, 400),
        ({"do": "comment", "text": ""}, 422),
        ({"do": "comment", "text": "x", "line": -1}, 422),
        ({"do": "delete everything"}, 400),
        ({}, 400),
    ],
)
def test_nonsense_changes_nothing(out: Path, client: Client, sent: object, status: int) -> None:
    assert change(client, "ben", **dict(sent)).status == status  # type: ignore[call-overload]
    assert not ReviewStore(out).file("ben").exists()
    assert not ReviewStore(out).file(None).exists()


def test_nothing_is_changed_without_the_token(
    out: Path, review: ReviewServer, client: Client
) -> None:
    sent = {"version": "", "do": "comment", "text": "I am the instructor"}
    assert Client(review).post(f"{page('ben')}review", sent).status == 403
    assert client.post(f"{page('ben')}review", sent, Origin="http://evil.example").status == 403
    assert not ReviewStore(out).file("ben").exists()


def test_comments_are_offered_again_the_most_used_first(client: Client) -> None:
    for key, text in (("ana", "rare"), ("ana", "common"), ("ben", "common")):
        change(client, key, do="comment", text=text)
    bank = client.get(page("cai")).text.partition('id="bank"')[2]
    assert 0 < bank.index("common") < bank.index("rare")


def test_a_comment_can_be_changed_and_removed(out: Path, client: Client) -> None:
    change(client, "ben", do="comment", text="Wy?")
    change(client, "ben", do="comment", text="Why?", index=0)
    assert [one.text for one in ReviewStore(out).student("ben").content.comments] == ["Why?"]
    change(client, "ben", do="uncomment", index=0)
    assert not ReviewStore(out).student("ben").content.comments


def test_a_cause_is_one_line_with_its_students_and_an_example_of_two(client: Client) -> None:
    text = client.get("/clusters").text
    line = text[text.index('data-check="docs"') :]
    assert "3 students" in line
    found = re.search(r'data-example="([^"]+)"', line)
    assert found
    example = client.get(f"/clusters/example?check={html.unescape(found[1])}").text
    assert example.count("stop</span>():") == 2 and "cai" in example
    assert "To forgive it gives 12 points back" in line


def test_a_forgiven_cause_gives_points_back_until_that_is_taken_back(
    out: Path, client: Client
) -> None:
    forgive = {**cluster(client), "do": "forgive", "share": 0.5, "reason": "the handout"}
    assert client.post("/clusters", forgive).status == 200
    assert "2: " in client.get(page("ben")).text and "the handout" in client.get(page("ben")).text
    again = client.post("/clusters", forgive)
    assert again.status == 409
    back = {**cluster(client, 0.5), "do": "take back"}
    assert client.post("/clusters", back).status == 200
    assert not ReviewStore(out).of_class().content.forgiven


def test_one_comment_reaches_all_who_made_the_mistake_once(out: Path, client: Client) -> None:
    sent = {**cluster(client), "do": "comment", "text": "See PEP 257"}
    for _ in range(2):
        assert client.post("/clusters", sent).status == 200
    store = ReviewStore(out)
    for key, documented in STUDENTS.items():
        texts = [one.text for one in store.student(key).content.comments]
        assert texts == (["See PEP 257"] if documented == 1 else [])


def test_a_preview_shows_who_gains_what_and_writes_nothing(out: Path, client: Client) -> None:
    # Elsewhere the server may be writing reports again meanwhile.
    written = sorted((out / "submissions").glob("*/result.json"))
    before = [file.read_bytes() for file in written]
    sent = {"do": "preview", "check": "docs", "text": YAML.replace("[function]", "[module]")}
    assert client.post("/regrade", sent).status == 200
    shown = ended(client)
    assert "3 students gain 12 points, 0 lose 0" in shown and "Nothing was written" in shown
    assert [file.read_bytes() for file in written] == before
    assert not (out / "assignment").exists()


def test_a_changed_check_is_applied_and_taken_back(out: Path, client: Client) -> None:
    shown = client.get("/regrade?check=docs").text.partition("<textarea")[2].partition(">\n")[2]
    assert html.unescape(shown).startswith(f"{YAML}</textarea>")
    changed = YAML.replace("[function]", "[module]")
    sent = {"do": "apply", "check": "docs", "text": changed.replace("\n", "\r\n")}
    assert client.post("/regrade", sent).status == 200
    assert "3 students gain 12 points" in ended(client)
    result = out / "submissions" / "ben" / "result.json"
    assert read_result(result).score == 5
    used = out / "assignment" / "1" / "lesson" / "assignment.yaml"
    assert read_result(result).assignment.location == str(used.parent)
    assert used.read_text(encoding="utf-8") == changed
    assert client.post("/regrade", {"do": "back", "check": "docs", "text": ""}).status == 200
    assert "lose 12" in ended(client)
    assert read_result(result).score == 1
    assert (out.parent / "lesson" / "assignment.yaml").read_text(encoding="utf-8") == YAML


@pytest.mark.parametrize(
    ("wrong", "said"),
    [("uses: source.docstring", "assignment.yaml:9: "), ("uses: nonsense: [", "assignment.yaml:")],
)
def test_a_mistake_in_the_changed_check_is_named_with_its_line(
    out: Path, client: Client, wrong: str, said: str
) -> None:
    text = YAML.replace("uses: source.docstrings", wrong)
    answer = client.post("/regrade", {"do": "apply", "check": "docs", "text": text})
    assert answer.status == 422 and said in answer.text
    assert not list((out / "assignment").glob("*"))


def test_source_acts_on_no_browser(client: Client) -> None:
    text = client.get(f"{page(ODD)}source?file={NODE}").text
    assert "&lt;b&gt;<mark>U+001B</mark>[31m&lt;/b&gt;" in text and "\x1b" not in text
    for key in STUDENTS:
        assert "<b>eli" not in client.get(page(key)).text


@pytest.mark.parametrize(
    "path",
    [
        "result.json",
        "source/bot/node.py",
        "recordings/../result.json",
        "..%2f..%2fbatch.json",
        "recordings/",
        "earlier/",
    ],
)
def test_only_reports_and_recordings_of_a_submission_are_served(client: Client, path: str) -> None:
    assert client.get(f"{page('ben')}{path}").status == 404
    assert client.get(f"{page('ben')}report.html").status == 200
    assert client.get(f"{page('ben')}recordings/submission.json").status == 200


def test_a_file_outside_of_the_kept_source_is_not_read(client: Client) -> None:
    for path in ("../result.json", "/etc/passwd", "bot/../bot/node.py"):
        assert client.get(f"{page('ben')}source?file={path}").status == 422


def test_a_report_may_not_use_the_review_around_it(client: Client) -> None:
    policy = client.get(f"{page('ben')}report.html").headers["Content-Security-Policy"]
    assert "sandbox allow-scripts" in policy and "allow-same-origin" not in policy


def test_a_student_who_left_the_class_keeps_the_review(out: Path, client: Client) -> None:
    change(client, "ben", do="comment", text="Why?")
    file = ReviewStore(out).file("ben")
    file.with_name("gone.yaml").write_text("key: gone\nnotes: talked to\n", encoding="utf-8")
    assert "gone" in client.get("/").text
    assert file.with_name("gone.yaml").exists()
