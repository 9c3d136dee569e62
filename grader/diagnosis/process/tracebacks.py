"""What a failure makes a program in Python print: a traceback, or an assertion of C code."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

from grader.diagnosis.process.failure import Failure, Frame

_HEADER = "Traceback (most recent call last):"
_LINKS = (
    "During handling of the above exception, another exception occurred:",
    "The above exception was the direct cause of the following exception:",
)
_IGNORED = "Exception ignored in"
FRAME = re.compile(r'\s+File "(?P<file>[^"]+)", line (?P<line>\d{1,7})(?:, in (?P<where>.+))?')
_RAISED = re.compile(r"(?P<type>[A-Za-z_][A-Za-z0-9_.]{0,200})(?:: (?P<message>.*))?")
_ASSERTED = re.compile(r".+: Assertion (?P<message>.+ failed\.)")


def parse_failures(lines: Sequence[str]) -> tuple[Failure, ...]:
    """Find every traceback in the output of one process."""
    failures: list[Failure] = []
    linked = ignored = False
    index = 0
    while index < len(lines):
        text = lines[index].strip()
        # What Python cannot parse is printed without a header.
        if text == _HEADER or FRAME.fullmatch(lines[index]):
            start = index + 1 if text == _HEADER else index
            failure, index = _parse_one(lines, start)
            if failure is not None:
                failures.append(replace(failure, linked=linked, ignored=ignored))
                linked = ignored = False
            continue
        linked = linked or text in _LINKS
        ignored = ignored or lines[index].startswith(_IGNORED)
        index += 1
    return tuple(failures)


def _parse_one(lines: Sequence[str], index: int) -> tuple[Failure | None, int]:
    """Read frames from ``index`` on, then the exception's line; return where to go on."""
    frames: list[Frame] = []
    while index < len(lines):
        line = lines[index]
        match = FRAME.fullmatch(line)
        if match:
            frames.append(Frame(match["file"], int(match["line"]), match["where"] or ""))
        elif line[:1].isspace():
            # Below the line of code there may be carets, which are of no use here.
            if frames and not frames[-1].source:
                frames[-1] = replace(frames[-1], source=line.strip())
        else:
            break
        index += 1
    if index == len(lines) or not frames:
        return None, index
    raised = _RAISED.fullmatch(lines[index].rstrip())
    if raised is None:
        return None, index
    class_name = raised["type"].rpartition(".")[2]
    return Failure(class_name, raised["message"] or "", tuple(frames)), index + 1


def parse_assertions(lines: Iterable[str]) -> tuple[Failure, ...]:
    """The assertions that failed in C code, such as that which converts a message.

    They end the process without a traceback.
    """
    asserted = filter(None, map(_ASSERTED.fullmatch, lines))
    return tuple(Failure("Assertion", match["message"], ()) for match in asserted)
