"""Plays the stimuli of a scenario."""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib import import_module
from pkgutil import iter_modules

from grader.assignment.stimuli.stimulus_model import StimulusModel
from grader.run import stimuli
from grader.run.stimuli.context import PLAYS, StimulusContext

for _module in iter_modules(stimuli.__path__):
    if _module.name != "player":
        import_module(f"{stimuli.__name__}.{_module.name}")


class Player:
    """Plays every stimulus of a run at its time."""

    def __init__(self, orders: Sequence[StimulusModel], context: StimulusContext) -> None:
        self._playing = [PLAYS[type(order)](order, context) for order in orders]
        self._began_s: float | None = None

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics on which a subscription of the student's is expected."""
        return tuple(sorted({item.topic for item in self._playing if item.topic}))

    @property
    def servers(self) -> tuple[str, ...]:
        """Services of which a client of the student's is expected."""
        return tuple(sorted({item.server for item in self._playing if item.server}))

    @property
    def answers(self) -> dict[str, str]:
        """Topic that is published on -> topic on which its answers are expected."""
        return {one.topic: one.answer for one in self._playing if one.topic and one.answer}

    @property
    def asks(self) -> bool:
        """Whether a stimulus asks something of a service or an action."""
        return any(item.asks for item in self._playing)

    @property
    def is_done(self) -> bool:
        """Whether every stimulus that has an end was played."""
        return self._began_s is not None and all(item.is_done for item in self._playing)

    @property
    def keeps_run(self) -> bool:
        """Whether the run goes on although no process of the student's runs any more."""
        return any(item.keeps_run for item in self._playing)

    @property
    def last_ns(self) -> int | None:
        """When the last message was published that an answer may still come to."""
        return max((item.last_ns for item in self._playing if item.last_ns), default=None)

    def begin(self) -> None:
        """Start the clock of all stimuli: the first match was now."""
        if self._began_s is None:
            self._began_s = time.monotonic()

    def tick(self) -> None:
        """Do what is due."""
        elapsed_s = self._elapsed_s()
        for item in self._playing:
            item.tick(elapsed_s)

    def finish(self) -> None:
        """The observation is over: note what could not be played."""
        for item in self._playing:
            item.finish()

    def pause_s(self, most_s: float) -> float:
        """How long nothing is due, at most ``most_s``."""
        elapsed_s = self._elapsed_s()
        if elapsed_s is None:
            return most_s
        due = [item.due_s for item in self._playing]
        return max(0.0, min([most_s, *(one - elapsed_s for one in due if one is not None)]))

    def _elapsed_s(self) -> float | None:
        return None if self._began_s is None else time.monotonic() - self._began_s
