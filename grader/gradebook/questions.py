"""Questions that only who wrote a program can answer at once, and the rules that make them.

They are for oral exams. A rule is a function from the work of a student, which is the program and
its recordings, to questions about it, or to none. None of them guesses: each question names a
moment of a recording or a line of the source.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import PurePosixPath
from statistics import median
from typing import Any

from grader.findings.words import code
from grader.measure.declarations import timers
from grader.recording.model import NS, Kind, Message, Recording

_FEWEST = 5
"""Messages before something about one of them can be special."""
_MOST_LINES = 4
_LONGEST = 160
_PROGRAMS = (".py", ".c", ".cc", ".cpp", ".cxx", ".h", ".hh", ".hpp", ".hxx")
_USUAL = re.compile(r"(^|/)(setup\.py|conftest\.py|tests?/.*|launch/.*|.*\.launch\.py)$")
_COMMENTS = ("#", "//", "*", '"""')
_OWN_TOPICS = ("/rosout", "/parameter_events")


@dataclass(frozen=True)
class Place:
    """A line of a program, in which a pattern was found."""

    match: re.Match[str]
    file: str
    line: int
    text: str

    @property
    def short(self) -> str:
        """Write ``node.py:18``."""
        return code(f"{PurePosixPath(self.file).name}:{self.line}")

    def __str__(self) -> str:
        """Write the whole path and the line, for the examiner."""
        return f"{code(f'{self.file}:{self.line}')} is {code(self.text)}"


@dataclass(frozen=True)
class Work:
    """What a student handed in and what it did; ``usual`` are lines that many others have too."""

    recordings: Sequence[Recording]
    files: Mapping[str, str]
    usual: Collection[str] = ()

    def is_rare(self, place: Place) -> bool:
        """Whether few others have the same line."""
        return place.text not in self.usual

    def places(self, pattern: str) -> Iterator[Place]:
        """Lines of the student's programs, without indents and comments, with a pattern."""
        for file, text in self.files.items():
            if file.endswith(_PROGRAMS) and not _USUAL.search(file):
                for number, line in enumerate(text.split("\n"), 1):
                    written = line.strip()[:_LONGEST]
                    match = re.search(pattern, written)
                    if match and not written.startswith(_COMMENTS):
                        yield Place(match, file, number, written)

    def evidence(self, pattern: str) -> tuple[str, ...]:
        """The first lines with a pattern, for the examiner."""
        return tuple(map(str, islice(self.places(pattern), _MOST_LINES)))

    def published(self) -> Iterator[tuple[Recording, tuple[Message, ...]]]:
        """What the student's nodes published, by recording and topic, where there is enough."""
        for recording in self.recordings:
            ends = recording.student_endpoints(Kind.PUBLISHER)
            for topic in sorted({end.topic for end in ends}.difference(_OWN_TOPICS)):
                if len(recording.on(topic)) > _FEWEST:
                    yield recording, recording.on(topic)


QUESTIONS = 3
_SPECIAL = 4.0
"""How many times as much as usual."""


@dataclass(frozen=True)
class Question:
    """A question.

    Attributes:
        evidence: Times and lines that a good answer agrees with, for the examiner.
        weight: How special it is to this submission; the most special is asked first.
    """

    text: str
    evidence: tuple[str, ...]
    weight: int


def ask(work: Work) -> list[Question]:
    """The most special questions about a work, of different rules if possible; always the same."""
    found = [sorted(rule(work), key=lambda one: -one.weight) for rule in _RULES]
    ranked = [(turn, -one.weight, one) for asked in found for turn, one in enumerate(asked)]
    chosen: list[Question] = []
    for *_, one in sorted(ranked, key=lambda item: item[:2]):
        # Two questions about one line are one.
        if not any(set(one.evidence[:1]) & set(other.evidence) for other in chosen):
            chosen.append(one)
    return chosen[:QUESTIONS]


def pause(work: Work) -> Iterator[Question]:
    """Nothing was published for much longer than usual."""
    for recording, messages in work.published():
        gaps = [(later.stamp_ns - one.stamp_ns, one.stamp_ns) for one, later in pairwise(messages)]
        (long, began), usual = max(gaps), median(gap for gap, _ in gaps)
        if long - NS * recording.stolen_s(began, began + long) > _SPECIAL * usual:
            text = (
                f"{_at(recording, began)}, {code(messages[0].topic)} falls silent for "
                f"{long / NS:.2g} s, though a message usually follows after {usual / NS:.2g} s. "
                "Why?"
            )
            yield Question(text, work.evidence(r"\bpublish\("), 4)


def jump(work: Work) -> Iterator[Question]:
    """A published number changes at once."""
    for recording, messages in work.published():
        rows = [dict(_numbers(message.value)) for message in messages]
        for field in rows[0]:
            values = [row.get(field, 0.0) for row in rows]
            sizes = [abs(later - one) for one, later in pairwise(values)]
            size = max(sizes)
            if size <= _SPECIAL * median(sizes):
                continue
            at = sizes.index(size) + 1
            text = (
                f"{_at(recording, messages[at].stamp_ns)}, {code(field)} on "
                f"{code(messages[at].topic)} goes from {values[at - 1]:.3g} to {values[at]:.3g}. "
                "Which line does that, and what made it do so just then?"
            )
            poses = (one for one in recording.truth if one.time_ns >= messages[at].stamp_ns)
            seen = [
                f"{one.robot or 'the robot'} was at ({one.x_m:.2f}, {one.y_m:.2f}) m"
                for one in poses
            ][:1]
            yield Question(text, (*work.evidence(rf"\b{re.escape(field)}\s*=[^=]"), *seen), 4)


def timer(work: Work) -> Iterator[Question]:
    """Another period of a timer."""
    declared = next((found for found in map(timers, work.recordings) if found), ())
    facts = [f"a timer calls {code(one.callback)} every {one.period_s:g} s" for one in declared]
    for place in work.places(r"\bcreate_(?:wall_)?timer\b"):
        text = (
            f"{place.short} creates a timer. What would the report show if its period were three "
            "times as long?"
        )
        yield Question(text, (str(place), *facts), 1 + 2 * work.is_rare(place))


def queue(work: Work) -> Iterator[Question]:
    """Another depth of a queue."""
    for place in work.places(r"\bcreate_(publisher|subscription)\b"):
        kind = place.match[1]
        ends = [
            f"{code(end.topic)} is {end.qos.reliability} and {end.qos.durability}, "
            f"{len(recording.carried(end.topic))} messages in {code(recording.scenario)}"
            for recording in work.recordings[:1]
            for end in recording.student_endpoints(Kind(kind))
            if end.topic.rpartition("/")[2] in place.text
        ]
        text = (
            f"{place.short} creates a {kind}. With what QoS? Which messages would be lost if "
            "its depth were 1, and when?"
        )
        yield Question(text, (str(place), *ends), 2 * work.is_rare(place))


def line(work: Work) -> Iterator[Question]:
    """A condition; where there is none, any line."""
    conditions = work.places(r"^(?:if|elif|while|\} else if)\b(?! __name__)")
    statement = r"^(?!(?:import|from|def|class|return|except|using)\b)\w.{9,}[^:,({\[\\]$"
    for places, asked, weight in (
        (conditions, "When in the recordings is this true, when not, and what follows?", 1),
        (work.places(statement), "What would happen without this line?", 0),
    ):
        for place in sorted(places, key=lambda one: -len(one.text)):
            text = f"{place.short} reads {code(place.text)}. {asked}"
            yield Question(text, (str(place),), weight + 2 * work.is_rare(place))


_RULES = (pause, jump, timer, queue, line)


def _at(recording: Recording, time_ns: int) -> str:
    return f"In {code(recording.scenario)}, {recording.since_launch_s(time_ns):.1f} s after launch"


def _numbers(value: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    """The numbers in a message by their paths, without stamps."""
    for name, inside in value.items():
        if isinstance(inside, Mapping) and name not in ("header", "stamp"):
            yield from _numbers(inside, f"{prefix}{name}.")
        elif isinstance(inside, int | float) and not isinstance(inside, bool):
            yield prefix + name, float(inside)
