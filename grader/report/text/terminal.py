"""The grade in a terminal: a table, every lost point explained, the score last.

Nothing is said by colour alone, and nothing of a student's is parsed as markup: every text is
cleaned and wrapped in a :class:`rich.text.Text`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from grader.checks.finding import Status
from grader.checks.wording import listing
from grader.grade.model import CheckResult, Grade, ScenarioFinding
from grader.recording.model import Recording
from grader.report.model.changes import Change, changes
from grader.report.model.remarks import remarks
from grader.report.text import words
from grader.safe_text import clean, one_line

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


NO_RECORDINGS: Mapping[str, Recording] = {}


def print_grade(
    console: Console, grade: Grade, recordings: Mapping[str, Recording] = NO_RECORDINGS
) -> None:
    """Print a grade.

    Args:
        console: Where to; its width, colours and encoding are respected.
    """
    console.print(_heading(console, grade))
    console.print()
    console.print(_table(console, grade))
    for result in (*grade.of(Status.FAILED), *grade.of(Status.ERROR)):
        console.print()
        _explain(console, grade, result)
    _tell_runs(console, recordings)
    console.print()
    _conclude(console, grade)


def print_changes(
    console: Console,
    before: Grade,
    after: Grade,
    recordings: Mapping[str, Recording] = NO_RECORDINGS,
) -> None:
    """Print what changed since an earlier grade, and what to fix now.

    Args:
        console: Where to; its width, colours and encoding are respected.
    """
    changed = changes(before, after)
    if changed:
        console.print(_changes_table(console, changed))
    else:
        console.print("No check changed.")
    first = after.first_to_fix()
    explained = (first,) if first is not None else after.of(Status.ERROR)[:1]
    for result in explained:
        console.print()
        _explain(console, after, result)
    _tell_runs(console, recordings)
    console.print()
    _conclude(console, after, before)


def _changes_table(console: Console, changed: Sequence[Change]) -> Table:
    table = Table.grid(padding=(0, 2, 0, 0), expand=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    table.add_column(no_wrap=True, justify="right")
    for change in changed:
        before = change.before
        table.add_row(
            _status(console, change.after.status),
            Text(f"was {words.STATUS[before.status].word}" if before else "new", "dim"),
            Text(_line(console, change.after.title)),
            Text(_points(change.after), "bold"),
        )
    return table


def _heading(console: Console, grade: Grade) -> Text:
    return Text.assemble(
        (_line(console, grade.assignment.title), "bold"),
        ("   ", ""),
        (_line(console, grade.submission.id), "dim"),
    )


def _table(console: Console, grade: Grade) -> Table:
    wide = console.width >= _WIDE
    # Whatever is left over is the last column's, and it takes nothing from the others.
    table = Table.grid(padding=(0, 2, 0, 0), expand=wide)
    table.add_column(no_wrap=True)
    longest = max(cell_len(_line(console, result.title)) for result in grade.results)
    if wide:
        table.add_column(overflow="fold", width=min(longest, _TITLE))
    else:
        table.add_column(overflow="fold", min_width=min(longest, 10))
    table.add_column(no_wrap=True, justify="right")
    if wide:
        table.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    for result in grade.results:
        row: list[RenderableType] = [
            _status(console, result.status),
            Text(_line(console, result.title)),
            Text(_points(result), "" if result.status is Status.PASSED else "bold"),
        ]
        if wide:
            row.append(Text(_line(console, _short(grade, result)), "dim", overflow="ellipsis"))
        table.add_row(*row)
    return table


def _status(console: Console, status: Status) -> Text:
    said = words.STATUS[status]
    symbol = said.ascii if console.options.ascii_only else said.symbol
    return Text(f"{symbol} {said.word}", _STYLE[status])


def _points(result: CheckResult) -> str:
    earned = "?" if result.status is Status.ERROR else words.number(result.points)
    return f"{earned} / {words.number(result.max_points)}"


def _short(grade: Grade, result: CheckResult) -> str:
    """What fits into the table's last column."""
    if result.waits_for:
        return "waits for " + ", ".join(grade.result(root).title for root in result.waits_for)
    return result.decisive.finding.observed


def _explain(console: Console, grade: Grade, result: CheckResult) -> None:
    """Say why points were lost, or why there is no verdict."""
    console.print(
        Text.assemble(_status(console, result.status), "  ", (_line(console, result.title), "bold"))
    )
    same_advice: dict[tuple[str, ...], list[ScenarioFinding]] = {}
    for item in result.findings:
        if item.finding.status is result.status:
            advice = tuple(words.advice(result, item.finding))
            same_advice.setdefault(advice, []).append(item)
    for advice, items in same_advice.items():
        for name, text in (*_seen(result, items), *_advised(advice), *_evidence(items)):
            console.print(_hanging(console, name, text))
    if points := words.points_waiting(result.id, grade.results):
        console.print(_hanging(console, "waiting", points))


def _hanging(console: Console, name: str, text: str) -> Text:
    """A name, and beside it a text in as many lines as it needs."""
    width = max(10, min(console.width, _READABLE) - _INDENT)
    lines = Text(_block(console, text)).wrap(console, width, overflow="fold")
    for line in lines:
        line.rstrip()
    margin = Text(f"\n{' ' * _INDENT}")
    return Text.assemble((f"  {name:<8}  ", "dim"), margin.join(lines))


def _seen(result: CheckResult, items: Sequence[ScenarioFinding]) -> Iterator[tuple[str, str]]:
    """What was expected and observed in each scenario; what is the same is said once."""
    scenarios: dict[tuple[str, str], list[str]] = {}
    for item in items:
        key = (item.finding.expected, item.finding.observed)
        scenarios.setdefault(key, []).append(item.scenario or "")
    before = ""
    for (expected, observed), names in scenarios.items():
        if len(result.findings) > 1 and names[0]:
            yield "scenario", listing(names)
        if expected != before:
            yield "expected", expected
        yield "observed", observed
        before = expected


def _advised(advice: Sequence[str]) -> Iterator[tuple[str, str]]:
    for number, text in enumerate(advice):
        yield words.ADVICE[min(number, 1)], text


def _evidence(items: Sequence[ScenarioFinding]) -> Iterator[tuple[str, str]]:
    """Places of all scenarios, and what the first of them printed."""
    for place in dict.fromkeys(str(p) for item in items for p in item.finding.evidence.places):
        yield "where", one_line(place)
    log = next((item.finding.evidence.log for item in items if item.finding.evidence.log), ())
    if log:
        # Marks under a part of the line above mean nothing where that line is wrapped.
        lines = [line for line in log if line.strip(" ^~")]
        yield "printed", "\n".join(lines[-_LOG_LINES:])


def _tell_runs(console: Console, recordings: Mapping[str, Recording]) -> None:
    """Say which limits of the sandbox were reached, when, and what else is worth knowing."""
    reached = [
        f"{words.limit_reached(breach)} (scenario {run.scenario}, "
        f"{run.since_launch_s(breach.time_ns):.1f} s after launch)"
        for run in recordings.values()
        for breach in run.breaches
    ]
    found: dict[str, list[str]] = {}
    for run in recordings.values():
        for remark in remarks(run):
            found.setdefault(remark, []).append(run.scenario)
    remarked = [
        f"{remark} (scenario{'s' if len(names) > 1 else ''} {listing(names)})"
        for remark, names in found.items()
    ]
    for title, label, texts in (
        (words.LIMITS_REACHED, "reached", reached),
        (words.WORTH_KNOWING, "remark", remarked),
    ):
        if texts:
            console.print()
            console.print(Text(title, "bold"))
            for text in texts:
                console.print(_hanging(console, label, text))


def _conclude(console: Console, grade: Grade, before: Grade | None = None) -> None:
    first = grade.first_to_fix()
    if first is not None:
        place = words.first_place(first)
        where = f" ({_line(console, place)})" if place else ""
        text = f"{_line(console, first.title)}{where}. {words.waiting(grade, first)}".rstrip()
        console.print(Text.assemble(("Fix this first: ", "bold"), text))
    if grade.graded:
        score = f"{words.number(grade.score)} of {words.number(grade.max_score)} points"
        style = "bold green" if grade.full_points else "bold"
        if before is not None and before.graded and before.score != grade.score:
            score = f"{score}, before {words.number(before.score)}"
        console.print(Text(f"Score: {score}", style))
        if grade.withheld.checks:
            console.print(Text(words.headline(grade)))
    else:
        console.print(Text(f"Not graded. {words.headline(grade)}", "bold magenta"))


def _line(console: Console, text: str) -> str:
    return _encodable(console, one_line(text))


def _block(console: Console, text: str) -> str:
    return _encodable(console, clean(text).expandtabs(4))


def _encodable(console: Console, text: str) -> str:
    """What the terminal's encoding has no character for is written as an escape."""
    return text.encode(console.encoding, "backslashreplace").decode(console.encoding)
