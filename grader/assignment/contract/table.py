"""The table "What to build" of a handout, made from the contract."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from grader.assignment.contract.model import Connection, Contract, Declared, Program, Publication
from grader.assignment.contract.spot import ANY, period_of, rate_words
from grader.assignment.model import Assignment
from grader.findings.fields import each_field, wanted_words
from grader.findings.words import code, codes, listing, value_text
from grader.spec.document import Place

MARKER = "<!-- contract -->"
_HEAD = "| what | value |\n| --- | --- |"


@dataclass(frozen=True)
class Row:
    """One row of the table, with the facts of a part of the contract that it tells."""

    label: str
    text: str
    place: Place
    facts: tuple[str, ...]

    def __str__(self) -> str:
        """The row in Markdown, without its outer bars."""
        return f"{self.label} | {self.text}"


def with_table(text: str, assignment: Assignment) -> str:
    """A handout with the table in place of its marker; what follows may be more of its rows."""
    if assignment.contract is None or MARKER not in text:
        return text
    lines = "\n".join(f"| {row} |" for row in rows(assignment.contract))
    variables = assignment.variables.values()
    free = dict.fromkeys(one.whole(str(one.example)) for one in variables if one.is_free)
    examples = ", ".join(code(name) for name in free if code(name) in lines)
    table = f"{_HEAD}\n{lines}"
    if examples:
        table = f"These names are examples, and yours to choose: {examples}.\n\n{table}"
    return text.replace(MARKER, table)


def rows(contract: Contract) -> Iterator[Row]:
    """The rows: packages, their programs and interfaces, and what the nodes do."""
    for package, one in contract.packages.items():
        place: Place = ("contract", "packages", package)
        yield Row("package", f"`{package}`", place, ("package", "builds", "dependencies"))
        for name in one.interfaces:
            facts = ("definition", "fields", "constants", "generated", "manifest")
            yield Row("defines", f"`{package}/{name}`", (*place, "interfaces", name), facts)
        for executable, program in one.executables.items():
            yield from _program(executable, program, (*place, "executables", executable))


def _program(executable: str, program: Program, place: Place) -> Iterator[Row]:
    yield Row("executable", f"`{executable}`", place, ("executable", "starts"))
    if program.node != ANY:
        yield Row("node", f"`{program.node}`", place, ("node",))
    for topic, subscription in program.subscribes.items():
        facts = ("subscribes", "subscribed_type", "subscribed_qos", "subscribed_depth")
        text = _connection(topic, subscription)
        yield Row("subscribes", text, (*place, "subscribes", topic), facts)
    for topic, publication in program.publishes.items():
        facts = ("topic", "type", "qos", "depth")
        text = _connection(topic, publication)
        yield Row("publishes", text, (*place, "publishes", topic), facts)
    for topic, publication in program.publishes.items():
        on = f" on `{topic}`" if len(program.publishes) > 1 else ""
        yield from _messages(publication, on, (*place, "publishes", topic))
    for key, label, fact in (
        ("serves", "offers the service", "service"),
        ("actions", "offers the action", "action"),
        ("calls", "calls the service", "calls"),
        ("sends_goals", "sends goals to", "sends_goals"),
    ):
        for name, server in getattr(program, key).items():
            yield Row(label, f"`{name}`, type `{server.type}`", (*place, key, name), (fact,))
    for name, parameter in program.parameters.items():
        text = ", ".join((f"`{name}`", *_declared(parameter)))
        yield Row("parameter", text, (*place, "parameters", name), ("parameter",))
    if program.leaves_alone not in ((), "robot"):
        yield Row("does not publish on", codes(program.leaves_alone), place, ("untouched",))
    if program.does_not_subscribe:
        topics = codes(program.does_not_subscribe)
        yield Row("does not subscribe to", topics, place, ("not_subscribed",))
    if program.alive:
        ends = f", and ends within {program.ends} of it" if program.ends else ""
        yield Row("runs", f"until Ctrl+C{ends}", place, ("alive", "ends"))
    if program.responsive:
        limits = [
            f"{text} {program.responsive[key]}"
            for key, text in {"within": "within", "typically": "as a rule within"}.items()
            if key in program.responsive
        ]
        answers = ", ".join(limits) or "while its callbacks run"
        yield Row("answers services", answers, place, ("responsive",))


def _messages(publication: Publication, on: str, place: Place) -> Iterator[Row]:
    """What is in the messages of a topic, and how often they come."""
    if publication.value:
        fields = [f"`{name}` {wanted_words(one)}" for name, one in each_field(publication.value)]
        rest = "" if "rest" in publication.value else "; all other fields keep their default"
        yield Row(f"message{on}", f"{listing(fields)}{rest}", place, ("sent", "values"))
    if publication.count:
        times = "once" if publication.count == 1 else f"{publication.count} times"
        yield Row(f"how often{on}", f"exactly {times}", place, ("once",))
    if publication.period is not None:
        by_timer = ", from the callback of a timer" if publication.timer else ""
        often = f"every {period_of(publication)['period']}{by_timer}"
        yield Row(f"how often{on}", often, place, ("period", "timer"))
    if publication.rate:
        yield Row(f"how often{on}", rate_words(publication), place, ("rate",))


def _declared(part: Declared) -> Iterator[str]:
    if part.type:
        yield part.type
    if part.default is not None:
        yield f"default `{_written(part.default)}`"
    if part.range:
        yield f"from {_written(part.range[0])} to {_written(part.range[1])}"
    if part.read_only:
        yield "read-only"
    if part.described:
        yield "with a description"


def _connection(topic: str, part: Connection) -> str:
    facts = [f"`{topic}`", f"type `{part.type}`"]
    if part.qos:
        facts.append(" and ".join(value.replace("_", " ") for value in part.qos.values()))
    if part.depth:
        facts.append(f"queue size {part.depth}")
    return ", ".join(facts)


def _written(value: Any) -> str:
    """A value as YAML has it; a text without quotes."""
    return value if isinstance(value, str) else value_text(value)
