"""The grade in a terminal: a table, every lost point explained, the score last.

Nothing is shown by colour alone, and nothing of a student's is parsed as markup: every text is
cleaned and wrapped in a :class:`rich.text.Text`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from grader.findings.finding import Status
from grader.findings.words import counted
from grader.recording.submission import SourceError
from grader.report.model.excerpt import excerpt, places
from grader.report.model.result_model import CheckPart, Result
from grader.report.text import additions, explanation, last_save
from grader.report.text.words import NO_POINTS, number
from grader.spec.safe_text import clean, one_line, visible

_STYLE = {
    Status.PASSED: "green",
    Status.FAILED: "bold red",
    Status.SKIPPED: "dim",
    Status.ERROR: "bold magenta",
}
_WIDE = 110
"""Columns from which on the table also tells what was observed."""
_TITLE = 56
"""Columns that a title may take there before it is wrapped."""
_READABLE = 100
"""Columns beyond which lines of prose get hard to read."""
_INDENT = 12
_LOG_LINES = 8
_COLORS = {"theme": "ansi_dark", "background_color": "default"}
# A long line goes on below: its end may be what is wrong.
_LOOK: dict[str, Any] = {**_COLORS, "line_numbers": True, "word_wrap": True}


def print_grade(
    console: Console,
    title: str,
    result: Result,
    source: Mapping[str, str] = {},
) -> None:
    """Print a grade.

    Args:
        console: Where to; its width, colours and encoding are respected.
        title: Of the assignment.
        source: Texts of the submission by path.
    """
    submission = _line(console, result.submission.id)
    console.print(Text.assemble((_line(console, title), "bold"), "   ", (submission, "dim")))
    console.print()
    console.print(_table(console, result))
    for check in (*result.of(Status.FAILED), *result.of(Status.ERROR)):
        _explain(console, result, check, source)
    _conclude(console, result)


def print_changes(
    console: Console,
    before: Result,
    after: Result,
    scores: Sequence[float | None] = (),
    source: Mapping[str, str] = {},
) -> None:
    """Print in one line what changed since an earlier grade, and what to fix now.

    Args:
        console: Where to; its width, colours and encoding are respected.
        scores: Since watching began; None where there was no grade.
        source: Texts of the submission by path.
    """
    changed = last_save.what_changed(before, after)
    if console.options.ascii_only:
        changed = changed.replace("→", "->").replace("−", "-")
    elif len(scores) > 1:
        changed += f"   {last_save.bars(scores, after.known_max_score)}"
    console.print(Text.assemble(("Since your last save: ", "bold"), _line(console, changed)))
    first = [check for check in after.checks if check.id == after.first_to_fix]
    for check in first or after.of(Status.ERROR)[:1]:
        _explain(console, after, check, source)
    _conclude(console, after, before)


def _table(console: Console, result: Result) -> Table:
    wide = console.width >= _WIDE
    longest = max(cell_len(_line(console, check.title)) for check in result.checks)
    table = Table.grid(padding=(0, 2, 0, 0), expand=wide)
    table.add_column(no_wrap=True)
    table.add_column(
        overflow="fold", width=min(longest, _TITLE) if wide else None, min_width=min(longest, 10)
    )
    table.add_column(no_wrap=True, justify="right")
    if wide:
        # It gets the width that is left over, and takes none from the others.
        table.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    titles = {check.id: check.title for check in result.checks}
    told: set[tuple[str, ...]] = set()
    for check in result.checks:
        row = [
            _status(console, check),
            Text(_line(console, check.title)),
            Text(explanation.points(check), "" if check.status is Status.PASSED else "bold"),
        ]
        if wide:
            roots = ", ".join(titles[root] for root in check.waits_for)
            short = f"waits for {roots}" if roots else check.observed
            if roots and check.waits_for in told:
                short = ""  # The same cause is told once.
            told.add(check.waits_for)
            row.append(Text(_line(console, short), "dim", overflow="ellipsis"))
        table.add_row(*row)
    return table


def _status(console: Console, check: CheckPart) -> Text:
    words = explanation.status_words(check)
    symbol = words.ascii if console.options.ascii_only else words.symbol
    style = "yellow" if words is NO_POINTS else _STYLE[check.status]
    return Text(f"{symbol} {words.word}", style)


def _explain(console: Console, result: Result, check: CheckPart, source: Mapping[str, str]) -> None:
    """Say why points were lost, or why there is no verdict."""
    console.print()
    title = (_line(console, explanation.heading(check)), "bold")
    console.print(Text.assemble(_status(console, check), "  ", title))
    if same := explanation.same_as(result).get(check.id):
        console.print(_hanging(console, "observed", f"the same as “{same.title}”"))
        return
    for row in explanation.explain(check, result):
        text = row.text
        if row.name == "printed":
            # Marks under a part of the line above mean nothing where that line is wrapped.
            lines = [line for line in text.splitlines() if line.strip(" ^~")]
            text = "\n".join(lines[-_LOG_LINES:])
        console.print(_hanging(console, row.name, text))
    if check.further_hints:
        count = counted(len(check.further_hints), "more step")
        console.print(_hanging(console, "hints", f"{count} in the report"))
    for place in places(check)[:1]:
        _print_source(console, place, source)


def _print_source(console: Console, place: SourceError, source: Mapping[str, str]) -> None:
    """Print the lines around a place with their numbers, in colours; the one meant has a mark."""
    from rich.syntax import Syntax

    found = excerpt(place, source)
    if found is not None:
        code = _encodable(console, visible("\n".join(found.texts)))
        lexer = Syntax.guess_lexer(place.file, code)
        marked = set() if console.options.ascii_only else {found.line}
        shown = Syntax(code, lexer, start_line=found.first, highlight_lines=marked, **_LOOK)
        console.print(shown)


def _hanging(console: Console, name: str, text: str) -> Text:
    """A name, and beside it a text in as many lines as it needs."""
    width = max(10, min(console.width, _READABLE) - _INDENT)
    shown = _encodable(console, clean(text).expandtabs(4))
    lines = Text(shown).wrap(console, width, overflow="fold")
    for line in lines:
        line.rstrip()
    margin = Text(f"\n{' ' * _INDENT}")
    return Text.assemble((f"  {name:<8}  ", "dim"), margin.join(lines))


def _conclude(console: Console, result: Result, before: Result | None = None) -> None:
    """What is worth knowing of the runs, what to fix first, and the score."""
    for notes in explanation.notes_of_runs(result):
        console.print()
        console.print(Text(notes.title, "bold"))
        for line in notes.lines:
            console.print(_hanging(console, "note", line))
    console.print()
    for first in result.checks:
        if first.id == result.first_to_fix:
            where = "".join(f" ({explanation.spot(one)})" for one in places(first)[:1])
            text = f"“{first.title}”{where}. {explanation.waiting(result, first)}".rstrip()
            console.print(Text.assemble(("Fix this first: ", "bold"), _line(console, text)))
    if not result.graded:
        text = f"Not graded. {explanation.headline(result)} {explanation.way_on(result)}"
        console.print(Text(text, "bold magenta"))
        return
    for one in result.adjustments:
        # What waits stands beside the score.
        if one.points is not None:
            console.print(_hanging(console, "points", additions.line(one)))
    for line in map(additions.comment_line, result.comments):
        console.print(_hanging(console, "comment", line))
    text = f"Score: {explanation.score(result)}"
    full = result.final_score == result.final_max_score
    if before is not None and before.graded and before.known_score != result.known_score:
        text = f"{text}, before {number(before.known_score or 0.0)}"
    console.print(Text(text, "bold green" if full else "bold"))
    if result.withheld.checks:
        console.print(Text(explanation.headline(result)))


def _line(console: Console, text: str) -> str:
    return _encodable(console, one_line(text))


def _encodable(console: Console, text: str) -> str:
    """A text with escapes for characters that the terminal's encoding does not have."""
    return text.encode(console.encoding, "backslashreplace").decode(console.encoding)
