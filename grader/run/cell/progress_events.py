"""What a cell tells the runner: one JSON line for each event."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
from collections import Counter
from typing import Any

from grader.recording.model import LogLine

# Lines of the student are told by the thread that reads them.
_TELLING = threading.Lock()
_MOST_LINES = 2000


def tell(event: str, **data: Any) -> None:
    """One line of progress."""
    with _TELLING:
        print(json.dumps({"event": event, **data}), flush=True)


class LineTeller:
    """Tells the first lines that each process of the student printed, of each stream."""

    def __init__(self) -> None:
        self._told: Counter[tuple[str, str]] = Counter()

    def __call__(self, line: LogLine) -> None:
        """Tell a line."""
        self._told[line.process, line.stream] += 1
        if self._told[line.process, line.stream] <= _MOST_LINES:
            # The runner may be gone; the pipes must be drained all the same.
            with contextlib.suppress(OSError):
                tell("printed", process=line.process, text=line.text)


def keep_apart() -> None:
    """Let nothing but our progress go to standard output, where Fast DDS writes warnings."""
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
