"""The nearest of some names to a mistyped one: every "did you mean" comes from here."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: str, candidates: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Find the candidate that is most like ``name``."""
    matches = get_close_matches(name, sorted(set(candidates)), n=1, cutoff=cutoff)
    return matches[0] if matches else None


def meant(name: str, candidates: Iterable[str]) -> str | None:
    """What is probably meant by a name that is not there: the only candidate, or the nearest."""
    found = set(candidates)
    return found.pop() if len(found) == 1 else nearest(name, found)


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """Make the sentence to append to an error, or nothing when no name is near."""
    match = nearest(name, candidates)
    return f" Did you mean {match!r}?" if match else ""


def nearest_or_all(name: str, candidates: Iterable[str], words: str = "There are") -> str:
    """Make the sentence to append to an error: the nearest name, or else all of them."""
    names = list(candidates)
    return did_you_mean(name, names) or f" {words}: {', '.join(names) or 'none'}."
