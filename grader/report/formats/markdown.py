"""Write Markdown for a pull request comment.

GitHub-flavoured; also for a job summary and a release.

What a student chose is text and never markup: no heading, image, link, table, HTML, mention or
reference to an issue can be made from it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from grader.findings.finding import Status
from grader.report.audience import Audience, written_for
from grader.report.model.excerpt import places
from grader.report.model.result_model import CheckPart, Result
from grader.report.text import additions, explanation
from grader.report.text.words import cut
from grader.spec.safe_text import one_line

# Within a word an underscore is no markup; names would be hard to read with it escaped.
_MARKUP = re.compile(r"[\\`*\[\]~|$]|(?<![^\W_])_|_(?![^\W_])")
# GitHub makes links of bare addresses; escaped they show the same, and can be copied.
_ADDRESS = re.compile(r":(?=//)|(?<=www)\.", re.IGNORECASE)
_HTML = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
_CALL = re.compile(r"@(?=\w)|#(?=\d)|\bGH-(?=\d)", re.IGNORECASE)
COMMENT_BYTES = 65_536
"""Longest comment: GitHub refuses more characters, and none has less than a byte."""
_LOG_LINES = 12
_LINE_CHARACTERS = 500
_CELL_BAR = "\\|"
_MORE = "… the rest is in the report.\n"


@written_for(Audience.STUDENT)
def render(result: Result) -> str:
    """The whole file, short enough for a comment."""
    return render_markdown(result, COMMENT_BYTES)


def render_markdown(result: Result, most_bytes: int | None = None) -> str:
    """Render a result.

    Args:
        most_bytes: As UTF-8; what comes last is left out.
    """
    title = f"## {literal(result.assignment.id)}: {explanation.score(result)}"
    head = [title, "", explanation.headline(result), *first_to_fix(result), ""]
    parts = (*added(result), *notes(result), *_explanations(result))
    blocks = ["\n".join(head), _table(result), *parts]
    whole = "\n".join(blocks)
    if most_bytes is None or len(whole.encode()) <= most_bytes:
        return whole
    left_bytes = most_bytes - len(_MORE.encode())
    kept: list[str] = []
    for block in blocks:
        left_bytes -= len(block.encode()) + 1
        if left_bytes < 0:
            break
        kept.append(block)
    return "\n".join([*kept, _MORE]) if kept else ""


def prose(text: str, *, cell: bool = False) -> str:
    """Text of a finding in one line; only what stands between backticks is markup, as code."""
    parts = one_line(text).split("`")
    if len(parts) % 2 == 0:
        parts[-2:] = [f"{parts[-2]}`{parts[-1]}"]
    return "".join(
        f"`{part.replace('|', _CELL_BAR) if cell else part}`"
        if index % 2 and part.strip()
        else literal(part)
        for index, part in enumerate(parts)
    )


def literal(text: str) -> str:
    """Text in one line that shows as it is."""
    escaped = _MARKUP.sub(lambda match: f"\\{match[0]}", one_line(text)).translate(_HTML)
    escaped = _ADDRESS.sub(lambda match: f"\\{match[0]}", escaped)
    # An invisible word joiner, so that no user is mentioned and no issue is linked.
    return _CALL.sub(lambda match: f"{match[0]}\N{WORD JOINER}", escaped)


def fence(text: str) -> str:
    """Lines as a block of code, with any content."""
    longest = max((len(run) for run in re.findall(r"`+", text)), default=0)
    marks = "`" * max(3, longest + 1)
    return f"{marks}text\n{text}\n{marks}"


def explained(check: CheckPart, result: Result) -> str:
    """What a check says, as a list."""
    lines: list[str] = []
    for row in explanation.explain(check, result):
        if row.name == "printed":
            printed = [cut(line, _LINE_CHARACTERS) for line in row.text.splitlines()[-_LOG_LINES:]]
            lines += ["", fence("\n".join(printed)), ""]
        else:
            lines.append(f"- **{row.name}:** {prose(row.text)}")
    return "\n".join(lines).strip("\n")


def first_to_fix(result: Result) -> list[str]:
    """What to correct first, and where; no lines where nothing failed."""
    first = next((check for check in result.checks if check.id == result.first_to_fix), None)
    if first is None:
        return []
    where = "".join(f" ({literal(explanation.spot(one))})" for one in places(first)[:1])
    return ["", f"**Fix this first:** {prose(first.title)}{where}"]


def _table(result: Result) -> str:
    lines = ["| | check | points |", "| --- | --- | ---: |"]
    for check in result.checks:
        words = explanation.status_words(check)
        title = prose(check.title, cell=True)
        lines.append(f"| {words.symbol} {words.word} | {title} | {explanation.points(check)} |")
    return "\n".join([*lines, ""])


def added(result: Result) -> Iterator[str]:
    """What persons and the rules of the course add, as a block."""
    lines = [
        *(f"- **points:** {literal(additions.line(one))}" for one in result.adjustments),
        *(f"- **comment:** {literal(additions.comment_line(one))}" for one in result.comments),
    ]
    if lines:
        yield "\n".join(["**In addition to the checks**", "", *lines, ""])


def notes(result: Result) -> Iterator[str]:
    """Limits of the sandbox that were reached and what else is worth knowing, a block for each."""
    for kind in explanation.notes_of_runs(result):
        yield "\n".join([f"**{kind.title}**", "", *(f"- {prose(one)}" for one in kind.lines), ""])


def _explanations(result: Result) -> Iterator[str]:
    for check in (*result.of(Status.FAILED), *result.of(Status.ERROR)):
        yield f"### {explanation.status_words(check).symbol} {prose(explanation.heading(check))}\n"
        yield f"{explained(check, result)}\n"
