"""What a handout says is checked, or the handout does not say it.

``promises/<assignment>.yaml`` is the table of one lesson, or of one example of the documentation.
Every sentence of the handout (each sentence of a paragraph or a list item, and each row of a
table; no headings, no code blocks) stands in it once, with the checks that hold it or the reason
why none is needed::

    lesson: [sent, once]  # the checks of what the lesson is about: at least 60 % of the points
    promises:
      how often | exactly once: [once]
    no_promise:
      explains:
      - A *publisher* sends *messages* on a *topic*.

A sentence stands there as in the handout, without its line breaks. ``no_promise`` is for what
demands nothing of the submission: an explanation, advice, how to try it, what the grader does.
What demands something that is not checked gets a check, or leaves the handout. To begin a table,
write ``lesson: []`` and run this test: it prints the sentences that are missing. The rows that the
contract makes are not written there: each promises what its checks hold.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Annotated

import pytest
import yaml
from annotated_types import Len
from markdown_it import MarkdownIt
from pydantic import BaseModel, ConfigDict

from grader.assignment.contract.derive import Derivation
from grader.assignment.contract.model import Contract
from grader.assignment.contract.table import rows
from grader.assignment.load import LoadedAssignment, list_assignments, load_assignment
from grader.checks.catalogue import CATALOGUE
from grader.machine import resources
from grader.report.html.handout import make_handout

TABLES = Path(__file__).with_name("promises")
EXAMPLES = {
    file.parent.name: file.parent
    for file in (resources.root() / "docs" / "examples").glob("*/assignment.yaml")
}
SHARE_OF_THE_LESSON = 0.6
_BETWEEN_SENTENCES = re.compile(r'(?:(?<=[.!?])|(?<=[.!?][)"`*])|(?<=[.!?]\*\*))\s+(?![a-z])')


class Table(BaseModel):
    """What the sentences of one handout promise, and which checks its lesson is about.

    Attributes:
        lesson: Checks of what the lesson is about.
        promises: Checks by the sentence that they hold.
        no_promise: Sentences that demand nothing, by the reason.
    """

    model_config = ConfigDict(extra="forbid")

    lesson: list[str]
    promises: dict[str, Annotated[list[str], Len(1)]] = {}
    no_promise: dict[str, list[str]] = {}

    @property
    def sentences(self) -> list[str]:
        """All sentences in it."""
        return [*self.promises, *chain.from_iterable(self.no_promise.values())]


@pytest.fixture(params=sorted(path.stem for path in TABLES.glob("*.yaml")))
def loaded(request: pytest.FixtureRequest) -> LoadedAssignment:
    return load_assignment(EXAMPLES.get(request.param, request.param))


@pytest.fixture
def table(loaded: LoadedAssignment) -> Table:
    """The table as it is written, with the rows that the contract makes and what they promise."""
    text = (TABLES / f"{loaded.assignment.id}.yaml").read_text(encoding="utf-8")
    table = Table.model_validate(yaml.safe_load(text))
    contract = loaded.assignment.contract
    made = told_by(contract) if contract else {}
    return table.model_copy(update={"promises": {**table.promises, **made}})


def told_by(contract: Contract) -> dict[str, list[str]]:
    """The checks that hold what a row of the contract's table promises, by the row."""
    found: dict[str, list[str]] = {}
    for row in rows(contract):
        for one in Derivation(contract).judged:
            if one.place == row.place and one.fact.name in row.facts:
                found.setdefault(str(row), []).append(one.id)
    return found


def sentences(markdown: str) -> Iterator[str]:
    """The sentences of a handout in its order; a row of a table is one."""
    row: list[str] | None = None
    heading = False
    for token in MarkdownIt("commonmark").enable("table").parse(markdown):
        if token.type in {"thead_open", "heading_open"}:
            heading = True
        elif token.type in {"thead_close", "heading_close"}:
            heading = False
        elif token.type == "tr_open":
            row = []
        elif token.type == "tr_close":
            if row and not heading:
                yield " | ".join(row)
            row = None
        elif token.type == "inline":
            text = " ".join(token.content.split())
            if row is not None:
                row.append(text)
            elif not heading:
                yield from _BETWEEN_SENTENCES.split(text)


def test_sentences_are_those_of_the_text() -> None:
    text = """
# Title

Send **one** command, e.g. with `...` or so. It is
*here.* Is it?

- **Like this.** Or not.

| word | meaning |
| --- | --- |
| node | `bot` |

```bash
ros2 run
```
"""
    assert list(sentences(text)) == [
        "Send **one** command, e.g. with `...` or so.",
        "It is *here.*",
        "Is it?",
        "**Like this.**",
        "Or not.",
        "node | `bot`",
    ]


def test_every_sentence_of_a_handout_has_a_check_or_needs_none(
    loaded: LoadedAssignment, table: Table
) -> None:
    said = list(sentences(make_handout(loaded).text))
    missing = [one for one in dict.fromkeys(said) if one not in table.sentences]
    rows = yaml.safe_dump(missing, allow_unicode=True, width=1000)
    assert not missing, f"sentences that do not stand in the table:\n{rows}"
    assert not set(table.sentences) - set(said), "sentences that the handout does not have"
    assert len(set(table.sentences)) == len(table.sentences), "sentences that stand there twice"


def test_every_check_holds_a_promise_of_the_handout(loaded: LoadedAssignment, table: Table) -> None:
    checks = {bound.spec.id for bound in loaded.checks}
    named = set(chain.from_iterable(table.promises.values()))
    assert not named - checks, "checks that the assignment lacks"
    assert not checks - named, "checks of which the handout says nothing"


def test_the_lesson_carries_most_of_the_points(loaded: LoadedAssignment, table: Table) -> None:
    points = {bound.spec.id: bound.spec.points for bound in loaded.checks}
    assert not set(table.lesson) - set(points), "the lesson names checks that are not there"
    share = sum(points[check] for check in table.lesson) / sum(points.values())
    assert share >= SHARE_OF_THE_LESSON, f"the lesson carries {share:.0%}"


def test_every_assignment_has_a_table() -> None:
    known = {*list_assignments(), *EXAMPLES}
    assert {path.stem for path in TABLES.glob("*.yaml")} == known


def test_every_check_is_used_by_a_lesson_or_an_example() -> None:
    """Else no right solution and no mutant tries it."""
    every = [load_assignment(EXAMPLES.get(name, name)) for name in (*list_assignments(), *EXAMPLES)]
    used = {bound.spec.uses for loaded in every for bound in loaded.checks}
    assert not set(CATALOGUE) - used
