"""Ends processes of the student in the middle of a run, and starts them again."""

from __future__ import annotations

import signal
import time
from dataclasses import dataclass

from grader.recording.event import Intervention
from grader.run.host.stopwatch import Stopwatch
from grader.run.stimuli.context import Playing, StimulusContext, plays


@dataclass(frozen=True)
class RestartOrder:
    """End a process if it still runs, and start it again.

    Attributes:
        process: ``package/executable``.
    """

    process: str
    after_s: float


@dataclass(frozen=True)
class KillOrder:
    """Send a signal to a process.

    Attributes:
        process: ``package/executable``.
    """

    process: str
    signal: str
    after_s: float


@plays(KillOrder)
class Killing(Playing):
    """Sends a signal to a process."""

    def __init__(self, order: KillOrder, context: StimulusContext) -> None:
        """Nothing is sent yet."""
        self._order = order
        self._context = context
        self._sent = False

    @property
    def due_s(self) -> float | None:
        """Its time."""
        return None if self._sent else self._order.after_s

    @property
    def is_done(self) -> bool:
        """Whether the signal was sent."""
        return self._sent

    @property
    def keeps_run(self) -> bool:
        """What the scenario ends is meant to be gone."""
        return self._context.students.was_killed(self._order.process)

    def tick(self, elapsed_s: float | None) -> None:
        """Send the signal when it is due."""
        if self._sent or elapsed_s is None or elapsed_s < self._order.after_s:
            return
        self._sent = True
        order = self._order
        if self._context.students.kill(order.process, signal.Signals[order.signal]):
            self._context.interventions.append(
                Intervention(time.time_ns(), order.process, "kill", order.signal)
            )


@plays(RestartOrder)
class Restarting(Playing):
    """Ends a process if it still runs, in steps, and starts it again."""

    def __init__(self, order: RestartOrder, context: StimulusContext) -> None:
        """Nothing is done yet."""
        self._order = order
        self._context = context
        self._steps = [signal.SIGINT, signal.SIGTERM, signal.SIGKILL]
        self._since: Stopwatch | None = None
        self._done = False

    @property
    def due_s(self) -> float | None:
        """Its time; then whenever the cell looks."""
        return None if self._done or self._since is not None else self._order.after_s

    @property
    def is_done(self) -> bool:
        """Whether it was started again."""
        return self._done

    @property
    def keeps_run(self) -> bool:
        """Until it is started again nothing needs to run."""
        return not self._done

    def tick(self, elapsed_s: float | None) -> None:
        """End it and start it again when it is due."""
        if self._done or elapsed_s is None or elapsed_s < self._order.after_s:
            return
        context, process = self._context, self._order.process
        limits = context.limits
        if context.students.is_running(process):
            patience_s = limits.shutdown_s if len(self._steps) == 2 else limits.terminate_s
            waiting = self._since is not None and self._since.elapsed_s <= patience_s
            if not waiting and self._steps:
                number = self._steps.pop(0)
                context.students.kill(process, number)
                self._since = Stopwatch(context.meter)
                context.interventions.append(
                    Intervention(time.time_ns(), process, "kill", number.name)
                )
            return
        self._done = True
        context.start(process)
        context.interventions.append(Intervention(time.time_ns(), process, "restart"))
