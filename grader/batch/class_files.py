"""The files about a whole class: the gradebook and the overview."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path

from grader.batch.batch import Done
from grader.batch.files import REPORT_FILE
from grader.batch.ledger import Entry, Ledger
from grader.checks.finding import Status
from grader.checks.wording import listing
from grader.report.clean import one_line
from grader.report.files import write_whole
from grader.report.gradebook import cell, plain_csv
from grader.report.overview import OverviewRow, render_overview
from grader.report.result_model import Result

GRADES_FILE = "grades.csv"
OVERVIEW_FILE = "index.html"
_MOST_TWINS = 5
_LONGEST_WHY = 200


def notes(done: Sequence[Done]) -> dict[str, str]:
    """What an instructor should know of each row, in a few words; empty for an ordinary one.

    Args:
        done: Every row.

    Returns:
        By key.
    """
    same = _same(done)
    return {item.entry.key: _note(item, same.get(_original(item.entry), ())) for item in done}


def copies(done: Sequence[Done]) -> int:
    """How many submissions are the same as another one; what a team shares is one.

    Args:
        done: Every row.
    """
    return sum(len({_hand(entry) for entry in same}) - 1 for same in _same(done).values())


def _same(done: Sequence[Done]) -> dict[str, list[Entry]]:
    """Rows with the same submission, by the key of the one that was graded for all of them."""
    originals = {item.entry.same_as for item in done}
    same: dict[str, list[Entry]] = {key: [] for key in originals if key}
    for item in done:
        if _original(item.entry) in same:
            same[_original(item.entry)].append(item.entry)
    return same


def _original(entry: Entry) -> str:
    return entry.same_as or entry.key


def _hand(entry: Entry) -> str:
    """Who handed it in: a team did so once."""
    return entry.team or entry.key


def _note(done: Done, same: Sequence[Entry]) -> str:
    """What to say of a row.

    Args:
        done: The row.
        same: All rows that have the same submission, itself and its team among them; or none.
    """
    parts = [done.entry.fault or done.entry.problem]
    others = [entry.key for entry in same if _hand(entry) != _hand(done.entry)]
    if others:
        # A class of 500 that handed in the starter package needs no 500 names on each row.
        twins = others[:_MOST_TWINS]
        left = len(others) - len(twins)
        named = [*twins, f"{left} {'other' if left == 1 else 'others'}"] if left else twins
        parts.append(f"the same submission as {listing(named)}")
    if done.result is not None and done.result.submission.problem:
        parts.append(done.result.submission.problem)
    if done.result is not None and not done.result.graded:
        parts.append(f"not graded: {_why_not_graded(done.result)}")
    return "; ".join(part for part in parts if part)


def _why_not_graded(result: Result) -> str:
    """What went wrong on our side, as much of it as a row can hold."""
    why = next((one_line(c.observed) for c in result.checks if c.status is Status.ERROR), "")
    return f"{why[: _LONGEST_WHY - 1]}…" if len(why) > _LONGEST_WHY else why


def grades_csv(done: Sequence[Done]) -> str:
    """The gradebook: a row for everybody, graded or not.

    Returns:
        The columns of :func:`grader.report.gradebook.plain_csv`, with name, late and note.
    """
    results = [item.result for item in done if item.result is not None]
    rows = list(csv.reader(io.StringIO(plain_csv(results)))) if results else [["submission"]]
    header, *graded = rows
    by_key = {row[0]: row for row in graded}
    said = notes(done)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([header[0], "name", "late", *header[1:], "note"])
    for item in done:
        entry = item.entry
        row = by_key.get(cell(entry.key)) if item.result is not None else None
        rest = row[1:] if row else [""] * (len(header) - 1)
        late = "yes" if entry.late else ""
        writer.writerow([cell(entry.key), cell(entry.name), late, *rest, cell(said[entry.key])])
    return stream.getvalue()


def write_class(done: Sequence[Done], ledger: Ledger) -> Path:
    """Write the gradebook and the overview.

    Args:
        done: Every row.
        ledger: Where to.

    Returns:
        The overview.
    """
    rows = sorted(done, key=lambda item: item.entry.key)
    write_whole(ledger.out / GRADES_FILE, grades_csv(rows))
    overview = ledger.out / OVERVIEW_FILE
    said = notes(rows)
    shown = [
        OverviewRow(
            id=item.entry.key,
            name=item.entry.name,
            note=said[item.entry.key],
            late=item.entry.late,
            report=os.path.relpath(ledger.folder(item.entry.key) / REPORT_FILE, ledger.out)
            if item.result is not None
            else None,
            result=item.result,
        )
        for item in rows
    ]
    write_whole(overview, render_overview(shown))
    return overview
