"""Which sandbox is asked for."""

from __future__ import annotations

from enum import Enum


class Choice(str, Enum):
    """What is asked for on the command line."""

    AUTO = "auto"
    BWRAP = "bwrap"
    NONE = "none"
