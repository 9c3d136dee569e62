"""The review of a class over HTTP, as its pages use it: nothing is lost, nothing else is served."""

from __future__ import annotations

import csv
import html
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import quote

import pytest

from grader.assignment.load import load_assignment
from grader.batch.ledger import Ledger
from grader.gradebook.adjusting import ClassAdjustments
from grader.gradebook.class_files import all_standing, read_class
from grader.gradebook.class_regrading import bring_up_to_date
from grader.grading.files import RESULT_FILE
from grader.report.files import folder_name
from grader.report.model.result import read_result
from grader.report.text.explanation import headline
from grader.review.store import ReviewStore
from grader.server.review import ReviewServer
from tests.server.conftest import Answer, Client
from tests.server.make_class import NODE, STUDENTS, YAML, hand_in_again, writing

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
        ({"do": "score", "item": "readme", "points": "many", "note": ""}, 422),
        ({"do": "comment", "text": ""}, 422),
        ({"do": "comment", "text": "x", "line": -1}, 422),
        ({"do": "comment", "text": "x", "index": 7}, 422),
        ({"do": "uncomment", "index": 0}, 422),
        ({"do": "uncomment", "index": -1}, 422),
        ({"do": "delete everything"}, 422),
        ({}, 422),
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


def end(out: Path, key: str, check: str, status: str = "error", points: float = 0.0) -> None:
    """Have a check end otherwise, as after a run: an error as on a machine that is too busy."""
    file = out / "submissions" / key / RESULT_FILE
    result = json.loads(file.read_text(encoding="utf-8"))
    for one in result["checks"]:
        if one["id"] == check:
            one |= {"status": status, "points": points}
    graded = all(one["status"] != "error" for one in result["checks"])
    score = sum(one["points"] for one in result["checks"]) if graded else None
    result |= {"graded": graded, "score": score}
    file.write_text(json.dumps(result), encoding="utf-8")


def test_a_click_grades_without_a_check_that_could_not_be_judged(out: Path, client: Client) -> None:
    end(out, "ana", "print")
    text = client.get(page("ana")).text
    assert "5 of 6 points so far, 1 open" in text and "Give 1 point and grade without this" in text
    assert "Run it again" in text
    assert change(client, "ana", do="settle").status == 200
    row = next(row for row in read_class(out) if row.id == "ana")
    assert row.result is not None and row.result.graded and not row.result.open
    assert (row.result.score, row.result.known_score) == (5.0, 6.0)
    assert headline(row.result) == "2 of 3 checks passed; 1 check could not be judged."
    assert "and grade without" not in client.get(page("ana")).text
    # It is judged in the end: these points were only in place of it.
    judged = row.result.model_copy(
        update={
            "checks": tuple(
                one.model_copy(update={"status": "passed"}) for one in row.result.checks
            )
        }
    )
    assert ClassAdjustments(Ledger(out))(judged).known_score == 5.0
    assert change(client, "ana", do="take", index=0).status == 200
    assert "1 open" in client.get(page("ana")).text


def test_points_by_hand_for_a_check_that_could_not_be_judged_count_until_it_is_judged(
    out: Path, client: Client
) -> None:
    end(out, "ana", "print")
    # A deduction is about something else: it is no judgement of the check.
    change(client, "ana", do="give", points="-0.5", reason="shouts", check="print")
    row = next(row for row in read_class(out) if row.id == "ana")
    assert row.result is not None and not row.result.graded and row.result.open
    change(client, "ana", do="give", points="1", reason="seen by hand", check="print")
    row = next(row for row in read_class(out) if row.id == "ana")
    assert row.result is not None and row.result.graded and not row.result.open
    assert row.result.known_score == 5 - 0.5 + 1
    end(out, "ana", "print", status="passed", points=1.0)
    row = next(row for row in read_class(out) if row.id == "ana")
    assert row.result is not None and row.result.known_score == 6 - 0.5


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


def scores(out: Path) -> dict[str, float | None]:
    return {row.id: row.score for row in read_class(out)}


def test_comments_and_points_stay_with_the_attempt_that_they_were_written_about(
    out: Path, client: Client
) -> None:
    for item in ("readme", "oral"):
        change(client, "ana", do="score", item=item, points=1, note="")
    change(client, "ana", do="give", points="0.5", reason="a good question", check="")
    change(client, "ana", do="comment", text="Why here?", file=NODE, line=6)
    assert scores(out)["ana"] == 6 + 2.5
    before = hand_in_again(out, "ana", documented=1)
    text = client.get(page("ana")).text
    assert scores(out)["ana"] is None and "waits of 2" in text
    assert 'class="comments"' not in text
    earlier = text.partition("On an earlier attempt")[2]
    assert "Why here?" in earlier and "readme: 1 (AK)" in earlier and "+0.5: a good" in earlier
    for item in ("readme", "oral"):
        change(client, "ana", do="score", item=item, points=2, note="")
    change(client, "ana", do="comment", text="Better", file=NODE, line=1)
    with writing(out) as ledger:
        bring_up_to_date(all_standing(ledger), ledger)
    now, old = (read_result(out / "submissions" / key / RESULT_FILE) for key in ("ana", before))
    assert (now.final_score, old.final_score) == (1 + 4, 6 + 2.5)
    assert [(one.text, one.earlier) for one in now.comments] == [
        ("Better", False),
        ("Why here?", True),
    ]
    assert [one.text for one in old.comments] == ["Why here?"]
    report = (out / "submissions" / "ana" / "report.html").read_text(encoding="utf-8")
    assert f"{NODE}:6 of an earlier attempt" in report


def count_the_best(out: Path) -> None:
    """Give the class the rule that the best attempt counts."""
    rules = "attempts: {counts: best}\nassignments: {lesson: {due: 2026-10-12 23:59}}\n"
    course = out.parent / "course.yaml"
    course.write_text(f"title: A course\ntime_zone: UTC\n{rules}", encoding="utf-8")
    with writing(out) as ledger:
        now = ledger.read()
        used = load_assignment(out.parent / "lesson")
        ledger.write(now.entries, now.assignment, used.sha256, now.location, str(course))


def test_the_attempt_that_counts_is_the_one_that_a_person_scores(out: Path, client: Client) -> None:
    before = hand_in_again(out, "ana", documented=1)
    count_the_best(out)
    assert "of the attempt that counts" in client.get(page("ana")).text
    for item in ("readme", "oral"):
        assert change(client, "ana", do="score", item=item, points=1, note="").status == 200
    assert scores(out)["ana"] == 6 + 2
    review = ReviewStore(out).student("ana").content
    assert review.of("ana").manual and not review.of("again-ana").manual
    assert client.get(page(before)).text.count("Attempt ") == 2
    change(client, before, do="comment", text="The first")
    assert ReviewStore(out).student("ana").content.of("ana").comments[0].text == "The first"


def test_points_for_one_student_count_with_the_attempt_that_counts(
    out: Path, client: Client
) -> None:
    change(client, "ana", do="give", points="0.5", reason="of then", check="")
    hand_in_again(out, "ana", documented=1)
    count_the_best(out)
    for item in ("readme", "oral"):
        change(client, "ana", do="score", item=item, points=2, note="")
    assert scores(out)["ana"] == 10 + 0.5
    assert change(client, "ana", do="give", points="2", reason="now", check="").status == 200
    assert scores(out)["ana"] == 10 + 2.5
    text = client.get(page("ana")).text
    assert "+0.5: of then" in text and "+2: now" in text
    assert change(client, "ana", do="take", index=0).status == 200
    assert scores(out)["ana"] == 10 + 2
    row = next(row for row in read_class(out) if row.id == "ana")
    assert row.result and "it has 6 of 6 points" in row.result.adjustments[-1].reason


def test_an_attempt_with_points_in_place_of_a_check_stays_graded_where_another_one_counts(
    out: Path, client: Client
) -> None:
    hand_in_again(out, "ana", documented=1)
    count_the_best(out)
    end(out, "ana", "print")
    assert change(client, "ana", do="settle").status == 200
    for item in ("readme", "oral"):
        change(client, "ana", do="score", item=item, points=2, note="")
    row = next(row for row in read_class(out) if row.id == "ana")
    assert row.score == 10 and row.result and row.result.graded and row.result.settled == {"print"}


def test_what_is_sent_about_an_attempt_never_lands_at_the_next_one(
    out: Path, client: Client
) -> None:
    sent = {"version": version(client, "ana"), "attempt": "ana", "do": "comment", "text": "Why?"}
    hand_in_again(out, "ana", documented=2)
    answer = client.post(f"{page('ana')}review", sent)
    assert answer.status == 409 and "handed in again" in answer.text
    assert not ReviewStore(out).file("ana").exists()


def test_one_student_gets_points_with_a_reason_until_they_are_removed(
    out: Path, client: Client
) -> None:
    answer = change(client, "ben", do="give", points="1.4", reason="right, but odd", check="docs")
    assert answer.status == 200 and "+1.4 for docs: right, but odd" in answer.text
    for item in ("readme", "oral"):
        change(client, "ben", do="score", item=item, points=0, note="")
    assert scores(out)["ben"] == 2.4
    row = next(row for row in read_class(out) if row.id == "ben")
    assert row.result and row.result.adjustments[-1].by == "AK"
    change(client, "ben", do="take", index=0)
    assert scores(out)["ben"] == 1
    for wrong in ({"points": "nan", "reason": "x"}, {"points": 1, "reason": ""}):
        assert change(client, "ben", do="give", **wrong).status == 422


def test_a_cause_is_split_by_hand_and_then_forgiven_for_a_part(out: Path, client: Client) -> None:
    whole = cluster(client)
    split = {**whole, "do": "split", "students": ["ben"], "name": "a generated file"}
    assert client.post("/clusters", split).status == 200
    text = client.get("/clusters").text
    assert "2 students" in text and "a generated file: " in text
    named = {**whole, "cause": "a generated file", "do": "forgive", "share": 1, "reason": ""}
    assert client.post("/clusters", named).status == 200
    lines = {row.id: row.result.adjustments for row in read_class(out) if row.result}
    assert [one.kind for one in lines["ben"]] == ["manual", "manual", "forgiven"]
    assert [one.kind for one in lines["cai"]] == ["manual", "manual"]
    back = {**named, "do": "split", "students": ["ben"], "name": " ", "was": 1}
    assert client.post("/clusters", back).status == 200
    assert "3 students" in client.get("/clusters").text


def run_again(client: Client, key: str) -> Answer:
    """Click, and ask as the page does until it has ended."""
    assert client.post(f"{page(key)}again", {}).status == 200
    while (answer := client.get(f"{page(key)}again")).status == 202:
        pass
    return answer


def test_a_click_runs_a_submission_again(tmp_path: Path) -> None:
    lesson, bot = tmp_path / "lesson", tmp_path / "class" / "ana" / "bot"
    for folder in (lesson, bot):
        folder.mkdir(parents=True)
    (lesson / "assignment.yaml").write_text(
        "rosgrade: 1\nid: lesson\ntitle: Bot\npackages: [{name: bot}]\nchecks:\n"
        "  - {id: found, uses: package.found, with: {package: bot}, points: 1}\n"
    )
    (bot / "package.xml").write_text("<package format='3'><name>bott</name></package>")
    out = tmp_path / "out"
    command = [sys.executable, "-m", "grader", "batch", str(lesson), str(tmp_path / "class")]
    subprocess.run([*command, "--out", str(out), "-q"], check=True, capture_output=True)
    first = read_result(out / "submissions" / "ana" / "result.json")
    server = ReviewServer(out, "AK")
    try:
        client = Client(server).open()
        assert run_again(client, "ana").status == 200
        shutil.rmtree(tmp_path / "class")
        gone, again = run_again(client, "ana"), run_again(client, "ana")
    finally:
        server.close()
    assert read_result(out / "submissions" / "ana" / "result.json").started > first.started
    for answer in (gone, again):
        assert answer.status == 422 and "class" in answer.text and "Traceback" not in answer.text
