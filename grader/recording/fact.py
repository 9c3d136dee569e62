"""Facts of the model as JSON, with the standard library alone."""

from __future__ import annotations

import dataclasses
import json
from enum import Enum
from typing import Any


def to_json(fact: Any) -> bytes:
    """A dataclass of the model as compact JSON."""
    return json.dumps(
        dataclasses.asdict(fact), default=_plain, separators=(",", ":"), sort_keys=True
    ).encode()


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f"{type(value).__name__} is not a plain value")
