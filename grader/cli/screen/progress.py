"""What a command does at the moment: lines that change on a terminal, else plain lines."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.findings.words import counted
from grader.spec.safe_text import one_line

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

    from grader.recording.submission import SourceError, SubmissionRecord

_LEAST_FOR_RATE = 3
_DOING = {
    "launching": "starting {process}",
    "waiting": "waiting for {what}",
    "matched": "recording",
    "recording": "recording, {elapsed_s:.1f} of at most {limit_s:.1f} s, {counted}",
    "stopping": "stopping",
    "recorded": "recorded",
}
"""Event of a cell (see :mod:`grader.run.cell.progress_events`) -> what its scenario does."""
_PLAIN = frozenset({"launching", "matched", "recorded"})
"""Events that are worth a line of their own where lines stay."""


class Progress:
    """Shows on standard error what a command does."""

    def __init__(
        self,
        quiet: bool = False,
        verbose: bool = False,
        on_phase: Callable[[str, str], None] = lambda _scenario, _text: None,
    ) -> None:
        """Set up; nothing is shown yet.

        Args:
            on_phase: Called with what a scenario does, or the whole where there is none.
        """
        self._on_phase = on_phase
        self._quiet = quiet
        self._verbose = verbose
        self._bars: Bars | None = None
        self._tasks: dict[str, TaskID] = {}
        self._said = ""
        self._lock = threading.Lock()
        self._work, self._count, self._total, self._fresh = "", 0, 0, 0
        self._began_s = 0.0

    @contextmanager
    def shown(self) -> Iterator[Progress]:
        """Show what happens while the block runs; it begins with nothing."""
        self._said, self._tasks = "", {}
        if self._quiet or not sys.stderr.isatty():
            yield self
            return
        with _make_bars() as bars:
            self._bars = bars
            try:
                yield self
            finally:
                self._bars = None

    def say(self, text: str) -> None:
        """Say in a few words what happens now, besides the scenarios."""
        self._on_phase("", text)
        if self._quiet or text == self._said:
            return
        self._said = text
        if self._bars is not None:
            self._show("", text)
        else:
            _print(text)

    def note(self, text: str) -> None:
        """Print a line that stays."""
        if self._bars is not None:
            from rich.text import Text

            self._bars.console.print(Text(f"rosgrade: {text}"))
        else:
            _print(text)

    def tell(self, text: str) -> None:
        """Print a line that stays, unless nothing is to be shown."""
        if not self._quiet:
            self.note(text)

    def begin(self, work: str, total: int, already: int = 0) -> None:
        """Begin to count a piece of work."""
        self._work, self._count, self._total, self._fresh = work, 0, total, 0
        self._began_s = time.monotonic()
        if self._bars is not None:
            self._show("", work, completed=0, total=total)
        elif not self._quiet:
            by_earlier_run = f", {already} of them by an earlier run" if already else ""
            _print(f"{work} {total}{by_earlier_run}")

    def advance(self, name: str, note: str = "", *, fresh: bool = True) -> None:
        """Count one piece of work that is done."""
        self._count += 1
        if fresh:
            self._fresh += 1
        rate = self._rate()
        if self._bars is not None:
            text = ", ".join(filter(None, (f"{self._work}, {self._count} of {self._total}", rate)))
            self._show("", text, completed=self._count, total=self._total)
        elif note and fresh and not self._quiet:
            in_brackets = f" ({rate})" if rate else ""
            _print(f"{self._count} of {self._total}: {name}: {note}{in_brackets}")

    def narrate(self, scenario: str, event: Mapping[str, Any]) -> None:
        """Tell what the cell of a scenario does."""
        kind = event["event"]
        if kind == "printed":
            self.output(f"{scenario} {event['process']}", event["text"])
        elif kind in _DOING:
            messages = counted(event.get("messages", 0), "message")
            phase = _DOING[kind].format_map({**event, "counted": messages})
            self._on_phase(scenario, phase)
            text = f"{scenario}: {phase}"
            if self._bars is not None:
                self._show(scenario, text, completed=int(kind == "recorded"), total=1)
            elif kind in _PLAIN and not self._quiet:
                _print(text)

    def output(self, source: str, line: str) -> None:
        """Show a line that the build or a process of the student printed, where that is wanted."""
        if not self._verbose or self._quiet:
            return
        from rich.console import Console
        from rich.text import Text

        bars = self._bars
        console = bars.console if bars is not None else Console(stderr=True, highlight=False)
        console.print(Text.assemble((f"{source} | ", "dim"), one_line(line)), soft_wrap=True)

    def _show(
        self, name: str, text: str, *, completed: int | None = None, total: int | None = None
    ) -> None:
        with self._lock:
            if self._bars is None:
                return
            if name and "" in self._tasks:
                self._bars.remove_task(self._tasks.pop(""))
            if name not in self._tasks:
                self._tasks[name] = self._bars.add_task(text, total=None)
            task = self._tasks[name]
            if completed == 0 and any(one.finished for one in self._bars.tasks if one.id == task):
                # A scenario that is run again, or the next piece of work, begins anew.
                self._bars.reset(task)
            self._bars.update(task, description=text, completed=completed, total=total)

    def _rate(self) -> str:
        if self._fresh < _LEAST_FOR_RATE:
            return ""
        each_s = (time.monotonic() - self._began_s) / self._fresh
        return f"{60 / each_s:.0f} a minute, {_span((self._total - self._count) * each_s)} left"


def syntax_errors(record: SubmissionRecord, folder: Path) -> list[str]:
    """The lines that Python cannot read, of a submission that is not built yet."""
    packages = () if record.build else record.packages
    errors = (error for package in packages for error in package.syntax_errors)
    return [f"{error}{_line_of(error, folder)}" for error in errors]


def _line_of(error: SourceError, folder: Path) -> str:
    """The line of a file that an error is in, where it is there to be read."""
    with suppress(OSError, IndexError):
        lines = (folder / error.file).read_text("utf-8", "replace").splitlines()
        return f": {one_line(lines[error.line - 1])}" if error.line else ""
    return ""


def _make_bars() -> Bars:
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn
    from rich.table import Column

    description = Column(no_wrap=True, overflow="ellipsis", ratio=1)
    return Progress(
        SpinnerColumn(finished_text=" "),
        TextColumn("{task.description}", markup=False, table_column=description),
        console=Console(stderr=True, highlight=False, emoji=False, markup=False),
        transient=True,
        expand=True,
    )


def _print(text: str) -> None:
    print(f"rosgrade: {text}", file=sys.stderr, flush=True)


def _span(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
