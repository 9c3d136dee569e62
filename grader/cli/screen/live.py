"""What a grading does at the moment: a line for each scenario on a terminal, else plain lines."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from grader.cli.screen.console import Progress
from grader.safe_text import one_line

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.live import Live

_REFRESHES_PER_S = 8
_LONG_S = 5.0
"""What lasts longer says for how long."""
_REMIND_S = 15.0
"""Where lines stay, what still goes on is told again so often: it does not hang."""


@dataclass
class ScenarioActivity:
    """Where one scenario is.

    Attributes:
        since_s: When recording began, by the monotonic clock; None before and after.
    """

    doing: str = ""
    since_s: float | None = None
    limit_s: float = 0.0
    messages: int = 0
    done: bool = False

    def take(self, event: Mapping[str, Any], now_s: float) -> None:
        """Follow what its cell tells."""
        kind = event["event"]
        if kind == "launching":
            self.doing, self.done, self.messages = f"starting {event['process']}", False, 0
        elif kind == "waiting":
            self.doing = f"waiting for {event['what']}"
        elif kind == "matched":
            self.doing, self.since_s, self.limit_s = "recording", now_s, event["limit_s"]
        elif kind == "recording":
            self.messages = event["messages"]
        elif kind == "stopping":
            self.doing, self.since_s = "stopping", None
        elif kind == "recorded":
            self.doing, self.done = "recorded", True

    def told(self, now_s: float) -> str:
        """It in words."""
        if self.since_s is None:
            return self.doing
        elapsed_s = min(now_s - self.since_s, self.limit_s)
        messages = "1 message" if self.messages == 1 else f"{self.messages} messages"
        return f"recording, {elapsed_s:.1f} of at most {self.limit_s:.1f} s, {messages}"


@dataclass
class Activity:
    """Where a grading is: reading and building, then its scenarios."""

    doing: str = ""
    scenarios: dict[str, ScenarioActivity] = field(default_factory=dict)
    since_s: float | None = None

    def say(self, text: str, now_s: float) -> bool:
        """Begin something else; whether it is something else."""
        if text == self.doing:
            return False
        self.doing, self.since_s = text, now_s
        return True

    def take(self, scenario: str, event: Mapping[str, Any], now_s: float) -> None:
        """Follow what a cell tells."""
        self.scenarios.setdefault(scenario, ScenarioActivity()).take(event, now_s)

    def lines(self, now_s: float) -> list[tuple[bool, str]]:
        """What to show: whether it is over, and the line."""
        if not self.scenarios:
            return [(False, self.doing + self._for(now_s))] if self.doing else []
        return [(one.done, f"{id_}: {one.told(now_s)}") for id_, one in self.scenarios.items()]

    def _for(self, now_s: float) -> str:
        """How long it is being done, where that is long."""
        lasted_s = now_s - self.since_s if self.since_s is not None else 0.0
        return f", {lasted_s:.0f} s so far" if lasted_s >= _LONG_S else ""


_PLAIN = frozenset({"launching", "matched", "recorded"})
"""Events that are worth a line of their own where lines stay."""


class GradingProgress(Progress):
    """Shows on standard error what a grading does."""

    def __init__(self, quiet: bool = False, verbose: bool = False) -> None:
        """Prepare."""
        super().__init__(quiet)
        self._verbose = verbose
        self._activity = Activity()
        self._live: Live | None = None
        self._lock = threading.Lock()

    @contextmanager
    def shown(self) -> Iterator[GradingProgress]:
        """Show what happens while the block runs; it begins with nothing."""
        self._activity = Activity()
        if self._quiet:
            yield self
            return
        console = _console()
        if not console.is_terminal or console.is_dumb_terminal:
            with self._reminding():
                yield self
            return
        from rich.live import Live

        self._live = Live(
            console=console,
            transient=True,
            refresh_per_second=_REFRESHES_PER_S,
            get_renderable=_spinning(self._shown_lines),
        )
        try:
            with self._live:
                yield self
        finally:
            self._live = None

    @contextmanager
    def _reminding(self) -> Iterator[None]:
        ended = threading.Event()

        def remind() -> None:
            while not ended.wait(_REMIND_S):
                if not self._activity.scenarios:
                    for _, line in self._shown_lines():
                        self._print(f"still {line}")

        reminder = threading.Thread(target=remind, name="reminder", daemon=True)
        reminder.start()
        try:
            yield
        finally:
            ended.set()
            reminder.join()

    def say(self, text: str) -> None:
        """Say in a few words what happens now, besides the scenarios."""
        with self._lock:
            is_new = self._activity.say(text, time.monotonic())
        if self._live is None and is_new:
            self._print(text)

    def narrate(self, scenario: str, event: Mapping[str, Any]) -> None:
        """Tell what a cell does, in a student's words."""
        if event["event"] == "printed":
            self.output(f"{scenario} {event['process']}", event["text"])
            return
        with self._lock:
            self._activity.take(scenario, event, time.monotonic())
            now = self._activity.scenarios[scenario].doing
        if self._live is None and event["event"] in _PLAIN:
            self._print(f"{scenario}: {now}")

    def output(self, source: str, line: str) -> None:
        """Show a line that the build or a process of the student printed, where that is wanted."""
        if not self._verbose or self._quiet:
            return
        from rich.text import Text

        console = self._live.console if self._live is not None else _console()
        console.print(Text.assemble((f"{source} | ", "dim"), one_line(line)), soft_wrap=True)

    def _print(self, text: str) -> None:
        if not self._quiet:
            print(f"rosgrade: {text}", file=sys.stderr, flush=True)

    def _shown_lines(self) -> list[tuple[bool, str]]:
        with self._lock:
            return self._activity.lines(time.monotonic())


def _console() -> Console:
    from rich.console import Console

    return Console(stderr=True, highlight=False, emoji=False, markup=False)


def _spinning(lines: Callable[[], list[tuple[bool, str]]]) -> Callable[[], RenderableType]:
    """Make what draws the lines, each that is not over with a sign that turns."""
    from rich.spinner import Spinner
    from rich.table import Table
    from rich.text import Text

    spinner = Spinner("dots")

    def draw() -> RenderableType:
        table = Table.grid(padding=(0, 1, 0, 0), expand=True)
        table.add_column(width=1)
        table.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
        for done, line in lines():
            table.add_row(Text(" ") if done else spinner, Text(line, "dim" if done else ""))
        return table

    return draw
