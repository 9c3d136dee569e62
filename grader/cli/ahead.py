"""What is needed after a run is imported while the student's node starts.

Nobody waits for it then: a node takes a CPU for a third of a second to start, and the command
has nothing else to do.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

Narrate = Callable[[str, Mapping[str, Any]], None]


def while_it_starts(narrate: Narrate) -> Narrate:
    """Prepare for reading and reporting at the first launch that is told."""
    begun = threading.Event()

    def tell(scenario: str, event: Mapping[str, Any]) -> None:
        narrate(scenario, event)
        if event["event"] == "launching" and not begun.is_set():
            begun.set()
            threading.Thread(target=_get_ready, name="ahead", daemon=True).start()

    return tell


def _get_ready() -> None:
    for module in ("grader.batch.files", "grader.report.text.terminal"):
        import_module(module)
    from grader.recording import mcap_reader
    from grader.report.html import page

    mcap_reader.get_ready()
    page.environment()
