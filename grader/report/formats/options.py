"""Choices that single formats have."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class FormatOptions:
    """What the command line says of formats beside their files.

    Attributes:
        xunit1: JUnit XML in the dialect xunit1, not xunit2.
        gradescope_metadata: Gradescope's ``submission_metadata.json``, or None.
    """

    xunit1: bool = False
    gradescope_metadata: Path | None = None


DEFAULTS = FormatOptions()
