"""What students are given: messages, comments in Canvas, files for their repositories."""

from __future__ import annotations

import csv
import io
import mailbox
import re
import tarfile
import zipfile
from contextlib import closing
from dataclasses import replace
from email import message_from_bytes, policy
from email.message import EmailMessage
from pathlib import Path

import pytest

from grader.batch.ledger import Entry, Ledger
from grader.grading.files import RESULT_FILE
from grader.report.formats.canvas_comments import carrier, upload_zip
from grader.report.model.result import result_json
from grader.report.model.result_model import AdjustmentPart
from grader.review.adjust import adjusted
from grader.review.model import ClassReview, Comment, ManualScore, StudentReview
from grader.review.store import ReviewStore
from tests.cli.conftest import Rosgrade
from tests.report.sample import full_points, lost_points, not_graded

EMAILS = {
    "ana": ("López, Ana =x", "ana@example.org"),
    "ben": ("Ben\u202e, Boll", "ben@example.org"),
    "cy": ("Cy Dee", ""),
    "dora": ("Dora", "dora@example.org"),
    "eve": ("Eve", "eve@example.org, all@example.org"),
    "flo": ("Flo", "flo@example.org"),
    "hal": ("Hal", "hal@example.org"),
    "ivy": ("Ivy", "ivy@example.org"),
}
README = AdjustmentPart(kind="manual", item="readme", title="README", points=None, max_points=2)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A class: Ana and Ivy have a hidden check, Ivy no report without it."""
    made = {"ana": lost_points, "dora": not_graded, "ivy": lost_points}
    store, entries = ReviewStore(tmp_path / "out"), []
    with Ledger(tmp_path / "out").opened() as ledger:
        for key, (name, email) in EMAILS.items():
            result = made.get(key, full_points)().result
            submission = result.submission.model_copy(update={"id": key, "sha256": key})
            result = result.model_copy(update={"submission": submission})
            review = StudentReview(key=key)
            if key in ("ana", "flo"):
                result = result.model_copy(update={"adjustments": (README,)})
            if key == "ana":
                manual = {"readme": ManualScore(points=1.5, by="LP", note="too short")}
                comment = Comment(
                    text="Well done,\nbut:\nFrom here on", by="LP", file="a.py", line=7
                )
                review = StudentReview(key=key, manual=manual, comments=(comment,))
                result = adjusted(result, review, ClassReview())
            if key == "hal":
                review = StudentReview(key=key, comments=(Comment(text="New", by="LP"),))
            if review != StudentReview(key=key):
                store.save(review, "")
            folder = ledger.partial(key)
            (folder / RESULT_FILE).write_text(result_json(result))
            (folder / "report.html").write_text(f"whole report of {key}")
            if key == "ana":
                (folder / "student-report.html").write_text("copy for ana")
            ledger.put(key, folder)
            entries.append(Entry(key, name, sha256=key, email=email))
        ledger.write([*entries, Entry("gil", problem="handed in nothing")], "lesson", "f" * 64)
    return tmp_path / "out"


def messages(file: Path) -> list[EmailMessage]:
    """What a mail program finds in a mailbox."""
    with closing(mailbox.mbox(file, create=False)) as box:
        return [
            message_from_bytes(box.get_bytes(key), _class=EmailMessage, policy=policy.default)
            for key in box.iterkeys()
        ]


def named(stderr: str) -> list[str]:
    """The beginnings of the errors."""
    lines = re.split("^rosgrade: error: ", stderr, flags=re.MULTILINE)[1:]
    return [re.sub(r"(?<=up to date).*|\n$", "", line, flags=re.DOTALL) for line in lines]


def test_each_student_gets_a_message_with_the_report_and_who_gets_none_is_named(
    rosgrade: Rosgrade, out: Path, tmp_path: Path
) -> None:
    ended = rosgrade("export", "mail", out, "--out", "post", "--from", "prof@example.org")
    assert ended.returncode == 1
    assert "2 messages; nothing was sent" in ended.stdout
    assert named(ended.stderr) == [
        "dora: not graded",
        "flo: waits for a person (README)",
        "gil: handed in nothing",
        "hal: its report is not up to date",
        "ivy: its report is not up to date",
        "cy: has no usable address: in the roster's column `email`",
        "eve: has no usable address: eve@example.org, all@example.org",
    ]
    ana, ben = messages(tmp_path / "post" / "mail.mbox")
    assert str(ana["to"]) == "Ana =x López <ana@example.org>"
    assert "\u202e" not in str(ben["to"]) and ben["to"].addresses[0].addr_spec == "ben@example.org"
    assert ana["from"] == "prof@example.org" and ana["subject"] == "Your result: timed_publisher"
    (report,) = ana.iter_attachments()
    assert (report.get_filename(), report.get_content_type()) == ("report.html", "text/html")
    assert report.get_content().strip() == "copy for ana"
    body = ana.get_body(("plain",)).get_content()
    assert "Hello Ana =x López,\n\ntimed_publisher: 3.52 of 8 points" in body
    assert "  README: 1.5 of 2 points, by LP: too short\n" in body
    assert "It publishes every 300 ms (1.02 / 3 points)\n  expected: a period of 300 ms" in body
    assert "  try next: " in body and "LP (a.py:7):\nWell done,\nbut:" in body
    assert "ends after SIGINT" not in body


def test_the_table_for_mail_merge_has_no_formula_and_says_which_report(
    rosgrade: Rosgrade, out: Path, tmp_path: Path
) -> None:
    rosgrade("export", "mail", out, "--subject", "=1+1\nBcc: x@y")
    with (tmp_path / "mail" / "mail.csv").open(encoding="utf-8", newline="") as stream:
        ana, ben = csv.DictReader(stream)
    assert list(ana) == ["email", "name", "subject", "body", "report"]
    assert ana["subject"] == "'=1+1 ⏎ Bcc: x@y"
    assert Path(ana["report"]).read_text() == "copy for ana"
    assert Path(ben["report"]).read_text() == "whole report of ben"
    first, _ = messages(tmp_path / "mail" / "mail.mbox")
    assert first["bcc"] is None and first["from"] is None


def test_a_sender_who_is_no_address_is_refused(rosgrade: Rosgrade, out: Path) -> None:
    ended = rosgrade("export", "mail", out, "--from", "Prof")
    assert ended.returncode == 2 and "--from Prof: is no address" in ended.stderr


def test_the_files_for_a_repository_hold_the_students_copy(
    rosgrade: Rosgrade, out: Path, tmp_path: Path
) -> None:
    ended = rosgrade("export", "feedback", out, "--out", "files")
    assert ended.returncode == 1 and "gil: handed in nothing" in ended.stderr
    folder = tmp_path / "files" / "ana" / "rosgrade-feedback"
    assert (folder / "report.html").read_text() == "copy for ana"
    readme = (folder / "README.md").read_text()
    assert "It publishes every 300 ms" in readme and "ends after SIGINT" not in readme


def canvas(place: Path) -> Path:
    file = place / "gradebook.csv"
    file.write_text(
        "Student,ID,SIS Login ID,Section,lesson (7)\n    Points Possible,,,,6\n"
        "Ana,90211,ana,S,\nBen,90212,ben,S,\nGil,90213,gil,S,\n"
    )
    return file


def test_comments_to_upload_are_called_as_canvas_called_the_downloads(
    rosgrade: Rosgrade, out: Path, tmp_path: Path
) -> None:
    name = "lopezana_LATE_90211_555_ws-1.zip"
    ledger = Ledger(out)
    entries = {entry.key: entry for entry in ledger.read().entries}
    entries["ana"] = replace(entries["ana"], source=f"/gone/{name}")
    ledger.write(entries.values(), "lesson", "f" * 64)
    ended = rosgrade("export", "canvas", out, "--canvas", canvas(tmp_path), "--comments", "c.zip")
    assert "1 comment for" in ended.stdout and "ben: no comment" in ended.stderr
    with zipfile.ZipFile(tmp_path / "c.zip") as outer:
        assert outer.namelist() == [name]
        with zipfile.ZipFile(io.BytesIO(outer.read(name))) as inner:
            assert inner.read("report.html") == b"copy for ana"
            assert b"It publishes every 300 ms" in inner.read("feedback.txt")


@pytest.mark.parametrize(
    ("names", "best"),
    [
        (["lopezana_90211_555_ws.zip"], 0),
        (["lopezana_LATE_90211_555_my_ws-2.ZIP"], 0),
        (["l_1_1_report.pdf", "l_1_2_ws.tar.gz"], 1),
        (["l_1_1_report.pdf", "l_1_2_bot_pub.py", "l_1_3_package.xml"], 1),
        (["l_1_1_report.pdf"], 0),
        (["ana.zip", ""], None),
    ],
)
def test_a_comment_takes_the_file_from_canvas_that_holds_it_best(
    names: list[str], best: int | None
) -> None:
    assert carrier(names) == ("" if best is None else names[best])


@pytest.mark.parametrize("name", ["l_1_2_ws.tar.gz", "l_1_2_ws.TXZ", "l_1_2_ws.tar"])
def test_a_comment_on_a_tar_is_a_tar(name: str) -> None:
    made = upload_zip({name: (full_points().result, b"<html>")})
    with (
        zipfile.ZipFile(io.BytesIO(made)) as outer,
        tarfile.open(fileobj=io.BytesIO(outer.read(name))) as inner,
    ):
        assert inner.getnames() == ["feedback.txt", "report.html"]


def test_a_comment_on_a_single_file_is_the_text_or_the_page() -> None:
    made = upload_zip(
        {name: (full_points().result, b"<html>") for name in ("a_1_2_n.py", "b_2_3_n.html")}
    )
    with zipfile.ZipFile(io.BytesIO(made)) as outer:
        assert outer.read("a_1_2_n.py").startswith(b"timed_publisher: 3 of")
        assert outer.read("b_2_3_n.html") == b"<html>"
