"""Messages to students, as files: a mailbox, and a CSV for mail merge. Nothing is sent."""

from __future__ import annotations

import mailbox
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from email.errors import MessageError
from email.headerregistry import Address
from email.message import EmailMessage
from email.utils import localtime
from pathlib import Path
from tempfile import TemporaryDirectory

from grader.report.files import write_whole
from grader.report.formats.gradebook import cell, csv_text
from grader.spec.safe_text import clean, one_line

_COLUMNS = ("email", "name", "subject", "body", "report")


@dataclass(frozen=True)
class Letter:
    """A message; ``report`` is the file to attach."""

    to: Address
    subject: str
    body: str
    report: Path


def address(email: str, name: str = "") -> Address | None:
    """An address as mail programs take it; None where it is none."""
    try:
        found = Address(one_line(name), addr_spec=email)
    except (ValueError, IndexError, MessageError):
        return None
    return found if found.domain and email.isascii() and email.isprintable() else None


def write_mbox(file: Path, letters: Iterable[Letter], sender: Address | None) -> None:
    """Write a mailbox that mail programs open, as in RFC 4155."""
    with TemporaryDirectory(prefix="rosgrade-") as folder:
        draft = Path(folder) / "mbox"
        box = mailbox.mbox(draft)
        for letter in letters:
            box.add(_message(letter, sender))
        box.close()
        write_whole(file, draft.read_bytes())


def _message(letter: Letter, sender: Address | None) -> EmailMessage:
    message = EmailMessage()
    if sender is not None:
        message["From"] = sender
    message["To"] = letter.to
    message["Date"] = localtime()
    message["Subject"] = one_line(letter.subject)
    message.set_content(clean(letter.body))
    data = letter.report.read_bytes()
    utf8 = {"charset": "utf-8"}
    message.add_attachment(
        data, maintype="text", subtype="html", filename="report.html", params=utf8
    )
    return message


def mail_csv(letters: Sequence[Letter]) -> str:
    """The messages as CSV, a row each; no spreadsheet takes a cell for a formula."""
    rows: list[Sequence[str]] = [_COLUMNS]
    for letter in letters:
        to, report = letter.to, str(letter.report.resolve())
        short = map(cell, (to.addr_spec, to.display_name, letter.subject))
        rows.append([*short, clean(letter.body), cell(report)])
    return csv_text(rows)
