"""The output of a build, with the student's own line first."""

from __future__ import annotations

from dataclasses import dataclass

from grader.submission.record import BuildRecord

CONTEXT = 6
"""Lines shown around the student's own."""
MOST_SHOWN = 3
"""Places in the log that are shown before the whole of it."""


@dataclass(frozen=True)
class BuildLog:
    """A build log for people.

    Attributes:
        first: The lines around the student's own mistake, with the place marked.
    """

    first: tuple[tuple[str, bool], ...]
    whole: str


def arrange(build: BuildRecord) -> BuildLog:
    """Find the lines of a log that tell of the student's own mistake.

    The first line that names the file (and the line, if one is known) or repeats the message,
    with what stands around it; nothing where the log tells nothing of it.
    """
    lines = build.log.splitlines()
    culprit = build.culprit
    if culprit is None:
        return BuildLog((), build.log)
    file = culprit.file.rpartition("/")[2]
    place = (f":{culprit.line}", f"line {culprit.line}") if culprit.line else ("",)
    named = [i for i, text in enumerate(lines) if file in text and any(p in text for p in place)]
    said = [i for i, text in enumerate(lines) if culprit.message and culprit.message in text]
    hits = sorted({*named[:MOST_SHOWN], *said[:1]})
    if not hits:
        return BuildLog((), build.log)
    begin, end = max(0, hits[0] - 2), min(len(lines), hits[-1] + CONTEXT)
    end = min(end, begin + 4 * CONTEXT)
    return BuildLog(tuple((lines[i], i in hits) for i in range(begin, end)), build.log)
