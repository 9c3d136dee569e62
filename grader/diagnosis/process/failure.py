"""What was raised in a program, in Python or in C++: type, message and the way there."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Frame:
    """One step of a traceback.

    Attributes:
        line: Line from 1.
        where: Function, or ``<module>``; empty for a syntax error.
        source: The line of code, or empty.
    """

    file: str
    line: int
    where: str = ""
    source: str = ""


@dataclass(frozen=True)
class Failure:
    """An exception as the interpreter printed it, or what ended a compiled program.

    Attributes:
        type: Short name of a Python class, such as ``ValueError``; of C++ the full name of the
            class or that of a signal.
        frames: The deepest is the last; of a compiled program only the student's functions.
        linked: It came of the exception before it.
        ignored: Python printed and ignored it (``Exception ignored in ...``).
        compiled: It ended a compiled program.
    """

    type: str
    message: str
    frames: tuple[Frame, ...]
    linked: bool = False
    ignored: bool = False
    compiled: bool = False

    def __str__(self) -> str:
        """Write it as Python does: ``ValueError: math domain error``."""
        return f"{self.type}: {self.message}" if self.message else self.type
