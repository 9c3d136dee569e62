"""Messages to students: what a mail program reads is what was written, and nothing else."""

from __future__ import annotations

import csv
import io
import mailbox
from contextlib import closing
from email import message_from_bytes, policy
from email.message import EmailMessage
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from grader.report.formats.mail import Letter, address, mail_csv, write_mbox

HEADERS = ["To", "Date", "Subject", "MIME-Version", "Content-Type"]


def written(place: Path, *letters: Letter) -> list[EmailMessage]:
    write_mbox(place / "mail.mbox", letters, None)
    with closing(mailbox.mbox(place / "mail.mbox", create=False)) as box:
        return [
            message_from_bytes(box.get_bytes(key), _class=EmailMessage, policy=policy.default)
            for key in box.iterkeys()
        ]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("mail") / "report.html"
    file.write_bytes("<p>naïve\nFrom here\n".encode())
    return file


@given(st.text(max_size=200), st.text(max_size=200), st.text(max_size=2000))
@example("x\r\nBcc: all@example.org", "x\nBcc: all@example.org", "x\n\nFrom me\n.\n")
@example('"Ana" <b@example.org>, c', "=?utf-8?q?x?=", "é" * 1500)
@settings(max_examples=50, deadline=None)
def test_no_text_adds_a_header_a_recipient_or_a_message(
    report: Path, name: str, subject: str, body: str
) -> None:
    to = address("ana@example.org", name)
    if to is None:
        return
    (message,) = written(report.parent, Letter(to, subject, body, report))
    assert [header for header in message if not header.startswith("Content-T")] == HEADERS[:-1]
    assert [one.addr_spec for one in message["to"].addresses] == ["ana@example.org"]
    assert message.get_body(("plain",)) is not None
    (attached,) = message.iter_attachments()
    assert attached.get_content() == report.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "email",
    [
        "",
        "ana",
        "@example.org",
        "a@b, c@d",
        "a@b\nBcc: c@d",
        "a@b c",
        "ána@example.org",
        "a@",
        "<a@b>",
    ],
)
def test_what_is_no_address_gets_no_message(email: str) -> None:
    assert address(email, "Ana") is None


@given(st.lists(st.text(max_size=50), min_size=3, max_size=3))
@example(["=cmd|' /C calc'!A0", "+1", "@x"])
def test_no_cell_is_a_formula(texts: list[str]) -> None:
    name, subject, body = texts
    to = address("ana@example.org", name)
    if to is None:
        return
    text = mail_csv([Letter(to, subject, f"Hello,\n{body}", Path("/=x/report.html"))])
    (row,) = csv.DictReader(io.StringIO(text))
    assert not any(value.lstrip().startswith(tuple("=+-@")) for value in row.values())
