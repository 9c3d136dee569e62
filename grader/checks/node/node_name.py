"""Names of nodes, fully qualified."""

from __future__ import annotations

import re

_NODE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


def node_name(name: str) -> str:
    """Qualify a node name: ``bot`` is ``/bot``.

    Raises:
        ValueError: It is not the name of a node.
    """
    full = name if name.startswith("/") else f"/{name}"
    if not _NODE.fullmatch(full):
        raise ValueError(f"{name!r} is not a node name: letters, digits, '_' and '/'")
    return full
