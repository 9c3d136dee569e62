"""Progress events of a cell for the runner: one JSON line for each."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
from collections import Counter
from typing import Any

from grader.recording.model import LogLine

# The thread that reads the student's output reports its lines.
_PRINTING = threading.Lock()
_MOST_LINES = 2000


def tell(event: str, **data: Any) -> None:
    """Print one line of progress."""
    with _PRINTING:
        print(json.dumps({"event": event, **data}), flush=True)


class LineTeller:
    """Reports the first lines of each stream of each process of the student."""

    def __init__(self) -> None:
        self._lines: Counter[tuple[str, str]] = Counter()

    def __call__(self, line: LogLine) -> None:
        """Report a line."""
        self._lines[line.process, line.stream] += 1
        if self._lines[line.process, line.stream] <= _MOST_LINES:
            # The runner may be gone; the pipes must be drained all the same.
            with contextlib.suppress(OSError):
                tell("printed", process=line.process, text=line.text)


def keep_apart() -> None:
    """Let only progress events go to standard output, where Fast DDS writes warnings."""
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
