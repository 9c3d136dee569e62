"""Files written whole or not at all."""

from __future__ import annotations

import secrets
from pathlib import Path

from grader.errors import UsageError


def write_whole(file: Path, content: str | bytes) -> None:
    """Write a file under a temporary name beside it, then move it into place.

    A reader sees the old file or the new one, never half of it. Missing folders are made;
    text is written as UTF-8.

    Args:
        file: Where to.
        content: All of it.

    Raises:
        UsageError: It cannot be written there.
    """
    data = content.encode() if isinstance(content, str) else content
    draft = file.with_name(f".{file.name}.{secrets.token_hex(4)}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            # "x" and not mkstemp: the file gets the permissions that the user's umask gives.
            with draft.open("xb") as stream:
                stream.write(data)
            draft.replace(file)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise UsageError(f"{file} cannot be written: {error.strerror}") from error
