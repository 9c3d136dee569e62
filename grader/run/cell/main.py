"""What a cell does from its fork to its end.

It joins the graph on a domain of its own and waits for a line on standard input. Then it reads a
:class:`~grader.run.order.CellOrder` from its folder, runs it, writes ``recording.mcap`` beside it,
and tells its progress as JSON lines on standard output. When its standard input ends, the runner
is gone, and the cell kills what it started and ends.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from grader.recording.interface import concatenated_definition, definition_finder
from grader.recording.mcap_writer import write_recording
from grader.run.cell.cell import Abandoned, Cell
from grader.run.cell.domain import DomainLock, lock_domain
from grader.run.cell.probe import Probe
from grader.run.cell.progress_events import keep_apart, tell
from grader.run.order import GO, ORDER_FILE, RECORDING_FILE, CellOrder
from grader.run.process.descendants import become_subreaper, kill_descendants


def add_type_support(prefixes: Iterable[Path]) -> None:
    """Make the interface packages in install spaces importable in this process."""
    for prefix in prefixes:
        sys.path[:0] = [str(path) for path in sorted(prefix.glob("lib/python3.*/site-packages"))]
        _load(sorted(prefix.glob("lib/lib*__rosidl_*.so")))


def _load(libraries: list[Path]) -> None:
    """Load libraries that need each other: each one again until all that it needs are there.

    A library that is loaded is found by its name afterwards, wherever it lies.
    """
    while libraries:
        errors: dict[Path, OSError] = {}
        for library in libraries:
            try:
                ctypes.CDLL(str(library))
            except OSError as error:
                errors[library] = error
        if len(errors) == len(libraries):
            raise errors[libraries[0]]
        libraries = list(errors)


if TYPE_CHECKING:
    from grader.recording.model import Recording
    from grader.sandbox.namespaces import Rights


def _keep(recording: Recording, probe: Probe, order: CellOrder, folder: Path) -> None:
    # Bytes of another definition would be read as values that were never sent.
    garbled = {one.topic for one in recording.endpoints if recording.misdefined(one.topic)}
    messages = [one for one in probe.messages if one.is_sent or one.topic not in garbled]
    find = definition_finder(Path(prefix) for prefix in order.prefixes)
    types = {message.type for message in messages}
    definitions = {name: concatenated_definition(name, find) for name in types}
    write_recording(
        folder / RECORDING_FILE, recording, messages, definitions, order.submission.encode()
    )
    used = os.times()
    tell("recorded", students_cpu_s=used.children_user + used.children_system)


def main(folder: Path, avoid_domains: tuple[int, ...], rights: Rights | None = None) -> int:
    """Get ready, wait for the word, run the order in the folder."""
    # A run makes few objects and ends soon; collections would cost a tenth of its CPU time.
    gc.disable()
    become_subreaper()
    keep_apart()
    with DomainLock(0) if rights else lock_domain(avoid_domains) as domain:
        probe = Probe(domain.domain_id)
        if os.read(0, len(GO)) != GO:
            return 1
        order = CellOrder.from_bytes((folder / ORDER_FILE).read_bytes())
        if order.type_support:
            add_type_support(map(Path, order.type_support))
        if rights is not None and order.process_sandbox is not None:
            bounds = order.process_sandbox.limits
            rights.mounter.mount(bounds.disk_bytes, bounds.files, bounds.shared_bytes)
        packets = rights.packets if rights is not None else None
        probe.listen(order.topics, order.limits)
        try:
            recording = Cell(order, domain.domain_id, probe, packets).run()
        except Abandoned:
            return 1
        finally:
            kill_descendants(os.getpid())
        _keep(recording, probe, order, folder)
        # In a sandbox it ends with the cell; to close it may wait for ever for what was sent.
        if rights is None:
            probe.close()
    return 0
