"""What a cell tells whoever ordered the run: one JSON line for each event."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
from typing import Any

from grader.recording.model import LogLine

# Lines of the student are told by the thread that reads them.
_TELLING = threading.Lock()


def tell(event: str, **data: Any) -> None:
    """One line of progress."""
    with _TELLING:
        print(json.dumps({"event": event, **data}), flush=True)


def tell_line(line: LogLine) -> None:
    """Tell what a process of the student printed."""
    # Whoever ordered the run may be gone; the pipes must be drained all the same.
    with contextlib.suppress(OSError):
        tell("printed", process=line.process, text=line.text)


def keep_apart() -> None:
    """Let nothing but our progress go to standard output.

    Fast DDS writes its warnings there, such as one for every message that is too long for the
    type that the probe reads.
    """
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
