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
    ranked: list[tuple[int, int, Question]] = []
    for rule in _RULES:
        # The first questions of all rules come before the second ones.
        questions = sorted(rule(work), key=lambda question: -question.weight)
        ranked += [(turn, -one.weight, one) for turn, one in enumerate(questions)]
    chosen: list[Question] = []
    for _, _, question in sorted(ranked, key=lambda item: item[:2]):
        # Two questions about one line are one.
        if not any(set(question.evidence[:1]) & set(other.evidence) for other in chosen):
            chosen.append(question)
    return chosen[:QUESTIONS]


def pause(work: Work) -> Iterator[Question]:
    """Nothing was published for much longer than usual."""
    for recording, messages in work.published():
        gaps_ns = [
            (after.stamp_ns - before.stamp_ns, before.stamp_ns)
            for before, after in pairwise(messages)
        ]
        (longest_ns, began_ns), usual_ns = max(gaps_ns), median(gap_ns for gap_ns, _ in gaps_ns)
        stolen_ns = NS * recording.stolen_s(began_ns, began_ns + longest_ns)
        if longest_ns - stolen_ns > _SPECIAL * usual_ns:
            text = (
                f"{_at(recording, began_ns)}, {code(messages[0].topic)} falls silent for "
                f"{longest_ns / NS:.2g} s, though a message usually follows after "
                f"{usual_ns / NS:.2g} s. Why?"
            )
            yield Question(text, work.evidence(r"\bpublish\("), 4)


def jump(work: Work) -> Iterator[Question]:
    """A published number changes at once."""
    for recording, messages in work.published():
        rows = [dict(_numbers(message.value)) for message in messages]
        for field in rows[0]:
            values = [row.get(field, 0.0) for row in rows]
            changes = [abs(after - before) for before, after in pairwise(values)]
            largest = max(changes)
            if largest <= _SPECIAL * median(changes):
                continue
            index = changes.index(largest) + 1
            message = messages[index]
            text = (
                f"{_at(recording, message.stamp_ns)}, {code(field)} on {code(message.topic)} goes "
                f"from {values[index - 1]:.3g} to {values[index]:.3g}. "
                "Which line does that, and what made it do so just then?"
            )
            evidence = work.evidence(rf"\b{re.escape(field)}\s*=[^=]")
            poses = (pose for pose in recording.truth if pose.time_ns >= message.stamp_ns)
            pose = next(poses, None)
            if pose is not None:
                robot = pose.robot or "the robot"
                evidence += (f"{robot} was at ({pose.x_m:.2f}, {pose.y_m:.2f}) m",)
            yield Question(text, evidence, 4)


def timer(work: Work) -> Iterator[Question]:
    """Another period of a timer."""
    declared = next(filter(None, map(timers, work.recordings)), ())
    facts = [f"a timer calls {code(one.callback)} every {one.period_s:g} s" for one in declared]
    for place in work.places(r"\bcreate_(?:wall_)?timer\b"):
        text = (
            f"{place.short} creates a timer. What would the report show if its period were three "
            "times as long?"
        )
        yield Question(text, (str(place), *facts), _weight(1, place, work))


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
        yield Question(text, (str(place), *ends), _weight(0, place, work))


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
            yield Question(text, (str(place),), _weight(weight, place, work))


_RULES = (pause, jump, timer, queue, line)


def _weight(weight: int, place: Place, work: Work) -> int:
    """The weight of a question about a line, which is more where few others have the line."""
    return weight + 2 if work.is_rare(place) else weight


def _at(recording: Recording, time_ns: int) -> str:
    return f"In {code(recording.scenario)}, {recording.since_launch_s(time_ns):.1f} s after launch"


def _numbers(value: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    """The numbers in a message by their paths, without stamps."""
    for name, inside in value.items():
        if isinstance(inside, Mapping) and name not in ("header", "stamp"):
            yield from _numbers(inside, f"{prefix}{name}.")
        elif isinstance(inside, int | float) and not isinstance(inside, bool):
            yield prefix + name, float(inside)
