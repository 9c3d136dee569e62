"""Message definitions as MCAP's ``ros2msg`` schemas want them.

A schema is the text of the message's ``.msg`` file followed by those of every message that
it contains. Source: https://mcap.dev/spec/registry, "ros2msg".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

_SEPARATOR = "=" * 80
_FIELD = re.compile(r"^\s*((?:[A-Za-z]\w*/)*[A-Za-z]\w*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]\w*")
_PRIMITIVES = frozenset(
    {"bool", "byte", "char", "float32", "float64", "string", "wstring"}
    | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
)


def definition_finder(prefixes: Iterable[Path]) -> Callable[[str], str]:
    """Make a function that reads ``.msg`` files from install prefixes.

    Returns:
        A function from ``package/msg/Name`` (or ``srv``, ``action``) to the file's text; KeyError
        if there is none.
    """
    folders = tuple(prefixes)

    def find(interface: str) -> str:
        for prefix in folders:
            kind = interface.split("/")[1]
            file = prefix / "share" / f"{interface}.{kind}"
            if file.is_file():
                return file.read_text(encoding="utf-8")
        raise KeyError(interface)

    return find


def concatenated_definition(interface: str, find: Callable[[str], str]) -> str:
    """Definition of a message with all that it contains.

    Raises:
        KeyError: A definition is missing.
    """
    main = find(interface)
    parts = [main]
    seen = {interface}
    queue = _contained(interface, main)
    while queue:
        name = queue.pop(0)
        if name in seen:
            continue
        seen.add(name)
        text = find(name)
        package, _, short = name.split("/")
        parts.append(f"{_SEPARATOR}\nMSG: {package}/{short}\n{text}")
        queue.extend(_contained(name, text))
    return "\n".join(parts)


def _contained(interface: str, text: str) -> list[str]:
    package = interface.split("/", maxsplit=1)[0]
    names = []
    for line in text.splitlines():
        match = _FIELD.match(line.split("#")[0])
        if not match or match[1] in _PRIMITIVES:
            continue
        parts = match[1].split("/")
        names.append(f"{parts[0] if len(parts) > 1 else package}/msg/{parts[-1]}")
    return names
