"""What the log of ``colcon build`` says of one package: whether it began, how it ended."""

from __future__ import annotations

import re
from dataclasses import dataclass

_ENDED = re.compile(r"(Failed|Aborted) +<<< (\S+)")


@dataclass(frozen=True)
class PackageLog:
    """The part of a build's log that is about one package.

    Attributes:
        started: Whether colcon says that it began to build the package.
        outcome: ``Failed``, ``Aborted`` (because another package failed), or nothing.
        lines: What the build of the package wrote; the whole log where it never began.
    """

    started: bool
    outcome: str
    lines: tuple[str, ...]

    @classmethod
    def of(cls, log: str, package: str) -> PackageLog:
        """Find a package in the log; what was built twice is read from where it last began."""
        lines = log.splitlines()
        begin = end = None
        outcome = ""
        for index, line in enumerate(lines):
            ended = _ENDED.match(line)
            if line == f"Starting >>> {package}":
                begin, end = index + 1, None
            elif ended is not None and ended[2] == package:
                outcome, end = ended[1], index
        if begin is None:
            return cls(False, outcome, tuple(lines))
        return cls(True, outcome, tuple(lines[begin:end]))

    @property
    def failed_itself(self) -> bool:
        """Whether the package began to be built, and was not ended because another one failed."""
        # The beginning of a long log is cut off, and then only the package's end is in it.
        return self.outcome == "Failed" or (self.started and self.outcome != "Aborted")
