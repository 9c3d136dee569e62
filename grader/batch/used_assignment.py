"""The assignment that a class is graded with: loaded again, and refused where it has changed."""

from __future__ import annotations

import shlex
from pathlib import Path

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.batch.ledger import Ledger
from grader.errors import UsageError
from grader.grading.regrading import stored_assignment


def load_used(
    ledger: Ledger, named: str | None = None, command: str = "regrade"
) -> LoadedAssignment:
    """The assignment that a class is graded with, or another one that is named."""
    used = ledger.read()
    words = (command, str(ledger.out))
    return load_assignment(named or stored_assignment(used.assignment, used.location, *words))


def in_use(ledger: Ledger, named: LoadedAssignment) -> LoadedAssignment:
    """The version that a class is graded with by now, where the one that is named was used before.

    Such as after `rosgrade regrade OUT CHANGED`, or after *Apply* in a review.
    """
    try:
        used = ledger.read()
    except UsageError:
        # There is no batch yet, or its file is damaged.
        return named
    if used.assignment != named.assignment.id or named.sha256 not in used.before:
        return named
    now = load_used(ledger)
    return now if now.sha256 == used.sha256 else named


def regrade_command(path: Path, loaded: LoadedAssignment) -> str:
    """The command that judges something again with an assignment."""
    name = loaded.location or loaded.assignment.id
    return f"`{shlex.join(['rosgrade', 'regrade', str(path), name])}`"


def refuse_changed(path: Path, sha256: str, loaded: LoadedAssignment) -> None:
    """Refuse to write a result again with another version of the assignment."""
    if loaded.sha256 != sha256:
        raise UsageError(
            f"{path}: the assignment has changed since this was graded. "
            f"{regrade_command(path, loaded)} judges again with the new assignment"
        )
