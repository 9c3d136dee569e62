"""What the student's loggers said: from /rosout, and from the lines that they write to stderr.

A node's logger does both; each record counts once. A logger that belongs to no node, or a node
without rosout, has only its lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from grader.measure.printed import logged_text
from grader.recording.model import LogLine, Recording

LEVELS = ("DEBUG", "INFO", "WARN", "ERROR", "FATAL")
_LINE = re.compile(
    r"\[(?P<level>[A-Z]+)\] \[(?P<s>\d{1,12})\.(?P<ns>\d{9})\] \[(?P<logger>[^\]]*)\]: ?"
)


@dataclass(frozen=True)
class Logged:
    """One record of a logger.

    Attributes:
        logger: Name, such as ``bot`` or ``robot.bot``.
    """

    time_ns: int
    logger: str
    level: str
    text: str


def logged(recording: Recording) -> tuple[Logged, ...]:
    """Every record of a logger until the end of the observation, oldest first."""
    found = [
        Logged(line.time_ns, line.process, line.level, line.text)
        for line in recording.log
        if line.stream == "rosout"
    ]
    known = {(item.time_ns, item.logger) for item in found}
    for line in recording.log:
        match = _LINE.match(line.text) if line.stream != "rosout" else None
        if match is None or match["level"] not in LEVELS:
            continue
        time_ns = int(match["s"]) * 10**9 + int(match["ns"])
        if (time_ns, match["logger"]) not in known:
            text = line.text[match.end() :]
            found.append(Logged(time_ns, match["logger"], match["level"], text))
    kept = (item for item in found if item.time_ns <= recording.stop_ns)
    return tuple(sorted(kept, key=lambda item: item.time_ns))


def printed(recording: Recording) -> tuple[LogLine, ...]:
    """Lines of output that no logger wrote."""
    return tuple(
        line
        for line in recording.log
        if line.stream != "rosout" and logged_text(line.text) == line.text
    )
