"""How a path of a submission is written where people, JSON or a report will read it."""

from __future__ import annotations


def shown(path: str) -> str:
    """Make a path printable: no control characters, no text direction tricks, valid Unicode.

    Args:
        path: A path as the file system gave it, undecodable bytes as surrogates.
    """
    if path.isprintable():
        return path
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode("ascii")
        for char in path
    )


def join(folder: str, name: str) -> str:
    """Join two relative paths, ``.`` being the submission itself."""
    return name if folder == "." else f"{folder}/{name}"


def parents(path: str) -> list[str]:
    """The folders above a relative path, the nearest first, without the submission itself."""
    parts = path.split("/")
    return ["/".join(parts[:count]) for count in range(len(parts) - 1, 0, -1)]


def is_within(path: str, folder: str) -> bool:
    """Whether a relative path lies in a folder, or is it; ``.`` holds everything."""
    return folder in (".", path) or path.startswith(f"{folder}/")
