"""What a compiled program leaves on stderr when a failure ends it.

The C++ runtime names the exception that nothing caught, the C library what it found broken, the
loader what it lacks. After that the tracer writes the signal and the student's functions.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from grader.diagnosis.process.failure import Failure, Frame

# How each begins; what has no name of its own ends the program by SIGABRT.
_BEGINNINGS = (
    re.compile(r"terminate called after throwing an instance of '(?P<type>.+)'"),
    re.compile(
        r"(?P<message>terminate called without an active exception|pure virtual method called"
        r"|(?:free|malloc|calloc|realloc|malloc_consolidate|m(?:un|re)map_chunk)\(\): .+"
        r"|double free or corruption.*|corrupted (?:size|double).+|\*\*\* .+ detected \*\*\*.*)"
    ),
    re.compile(
        r"\S+: (?P<type>error while loading shared libraries|symbol lookup error): (?P<message>.+)"
    ),
    re.compile(r"rosgrade: (?P<type>SIG[A-Z]+) \((?P<message>.+)\) in .+"),
)
_WHAT = "  what():  "
# Without debugging information the place is ??:?
_FRAME = re.compile(r"rosgrade:   #\d+ (?P<where>.+) at (?P<file>\S.*):(?P<line>\d{1,7}|\?)")
# Names of the standard library have a version; throw_with_nested() makes a class of its own.
_NOISE = re.compile(r"__cxx11::|^std::_Nested_exception<(.+)>$")


def parse_crashes(lines: Iterable[str]) -> tuple[Failure, ...]:
    """Find what ended compiled programs in the output of one process."""
    failures: list[Failure] = []
    for line in lines:
        match = next(filter(None, (pattern.fullmatch(line) for pattern in _BEGINNINGS)), None)
        if match is not None:
            groups = match.groupdict()
            type_ = _NOISE.sub(r"\1", groups.get("type", "SIGABRT"))
            # That it aborts is no news after what made it abort.
            if type_ != "SIGABRT" or not failures:
                failures.append(Failure(type_, groups.get("message", ""), (), compiled=True))
        elif failures:
            failures[-1] = _with(failures[-1], line)
    return tuple(failures)


def _with(failure: Failure, line: str) -> Failure:
    """A failure with what a line after its first one says of it."""
    frame = _FRAME.fullmatch(line)
    if frame:
        # The tracer begins with the deepest.
        line_number = 0 if frame["line"] == "?" else int(frame["line"])
        before = Frame(frame["file"], line_number, frame["where"])
        return replace(failure, frames=(before, *failure.frames))
    if line.startswith(_WHAT) and not failure.message:
        what = line.removeprefix(_WHAT).strip()
        return replace(failure, message="" if failure.type.endswith(what) else what)
    if failure.message.endswith(":"):
        # rclcpp writes a name that it refuses on a line of its own.
        return replace(failure, message=f"{failure.message} {line.strip()}")
    return failure
