"""How far a long piece of work is: a bar on a terminal, else plain lines."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

_LEAST_FOR_RATE = 3


class ClassProgress:
    """Counts, rate and time left of the work on a class, on standard error."""

    def __init__(self, quiet: bool = False) -> None:
        """Prepare.

        Args:
            quiet: Say only what must be known.
        """
        self._quiet = quiet
        self._bar: Bar | None = None
        self._task: TaskID | None = None
        self._count = self._total = self._fresh = 0
        self._began_s = 0.0

    def __enter__(self) -> ClassProgress:
        """Show the bar, on a terminal."""
        if not self._quiet and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[pace]}"),
                console=Console(stderr=True, highlight=False, emoji=False),
                transient=True,
            )
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()

    def begin(self, work: str, total: int, already: int = 0) -> None:
        """Begin a piece of work.

        Args:
            already: How many of them were done before; they say nothing of the pace.
        """
        self._total, self._count, self._fresh = total, 0, 0
        self._began_s = time.monotonic()
        if self._bar is not None:
            if self._task is not None:
                self._bar.remove_task(self._task)
            self._task = self._bar.add_task(work, total=total, pace="")
        elif not self._quiet:
            before = f", {already} of them by an earlier run" if already else ""
            print(f"rosgrade: {work} {total}{before}", file=sys.stderr, flush=True)

    def advance(self, name: str, said: str = "", *, fresh: bool = True) -> None:
        """One more is done."""
        self._count += 1
        self._fresh += fresh
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=self._count, pace=self.pace())
        elif said and fresh and not self._quiet:
            told = f"{self._count} of {self._total}: {name}: {said}"
            pace = self.pace()
            print(f"rosgrade: {told}{f' ({pace})' if pace else ''}", file=sys.stderr, flush=True)

    def say(self, text: str) -> None:
        """Say something that is good to know."""
        if not self._quiet:
            self.note(text)

    def note(self, text: str) -> None:
        """Say something that must not be missed."""
        if self._bar is not None:
            from rich.text import Text

            self._bar.console.print(Text(f"rosgrade: {text}"))
        else:
            print(f"rosgrade: {text}", file=sys.stderr, flush=True)

    def pace(self) -> str:
        """Rate and time left, once there is something to tell them from."""
        if self._fresh < _LEAST_FOR_RATE:
            return ""
        each_s = (time.monotonic() - self._began_s) / self._fresh
        return f"{60 / each_s:.0f} a minute, {_span((self._total - self._count) * each_s)} left"


def _span(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
