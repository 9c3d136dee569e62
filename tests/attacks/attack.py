"""A hostile submission, or an honest one beside it, and what must come of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from tests.attacks.submissions import write_compiled_submission, write_submission

ALIVE = frozenset({"alive", "messages"})
HOLDER = "the process that holds their sandbox"


@dataclass(frozen=True)
class Attack:
    """A submission and what must come of it.

    Attributes:
        lost: Checks that fail; others pass or are skipped because of them.
        maybe: Checks that may fail besides.
        named: Texts that its report or its result hold.
        compiled: Whether it is in C++.
    """

    attack: str = ""
    at_import: str = ""
    at_build: str = ""
    name: str = "bot_publisher"
    files: dict[str, str] = field(default_factory=dict)
    lost: frozenset[str] = frozenset()
    maybe: frozenset[str] = frozenset()
    named: tuple[str, ...] = ()
    compiled: bool = False

    def write(self, folder: Path) -> None:
        """Make the package."""
        write = write_compiled_submission if self.compiled else write_submission
        write(
            folder,
            attack=self.attack,
            at_import=self.at_import,
            at_build=self.at_build,
            name=self.name,
            files=self.files,
        )
