"""What questions are made from: a student's programs, line by line, and their recordings."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import PurePosixPath

from grader.findings.wording import code
from grader.recording.model import Kind, Message, Recording

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
