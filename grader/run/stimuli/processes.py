"""Ends processes of the student in the middle of a run, and starts them again."""

from __future__ import annotations

import signal
import time

from grader.assignment.stimuli.kinds.process import Kill, Restart
from grader.recording.event import Intervention
from grader.run.host.stopwatch import Stopwatch
from grader.run.stimuli.context import Playing, StimulusContext, plays


class _OfProcess(Playing):
    """Base of the stimuli that act on one process at one time."""

    _done = False

    @property
    def due_s(self) -> float | None:
        """Its time; then whenever the cell looks."""
        return None if self._done else float(self._order.after)

    @property
    def is_done(self) -> bool:
        """Whether it was done."""
        return self._done

    def _note(self, action: str, signal_name: str = "") -> None:
        self._context.interventions.append(
            Intervention(time.time_ns(), self._order.subject, action, signal_name)
        )


@plays(Kill)
class Killing(_OfProcess):
    """Sends a signal to a process."""

    @property
    def keeps_run(self) -> bool:
        """Whether it ended the process, which is then meant to be gone."""
        return self._context.students.was_killed(self._order.subject)

    def play(self, elapsed_s: float) -> None:
        """Send the signal once."""
        if not self._done:
            self._done = True
            order = self._order
            if self._context.students.kill(order.subject, signal.Signals[order.signal]):
                self._note("kill", order.signal)


@plays(Restart)
class Restarting(_OfProcess):
    """Ends a process if it still runs, in steps, and starts it again."""

    def __init__(self, order: Restart, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._signals = [signal.SIGINT, signal.SIGTERM, signal.SIGKILL]
        """Those that were not sent yet."""
        self._since_signal: Stopwatch | None = None

    @property
    def due_s(self) -> float | None:
        """Its time; then whenever the cell looks."""
        return None if self._since_signal is not None else super().due_s

    @property
    def keeps_run(self) -> bool:
        """Whether the process is still to be started again."""
        return not self._done

    def play(self, elapsed_s: float) -> None:
        """End it and start it again."""
        if self._done:
            return
        context, process = self._context, self._order.subject
        limits = context.limits
        if not context.students.is_running(process):
            self._done = True
            context.start(process)
            self._note("restart")
            return
        is_interrupted_only = len(self._signals) == 2
        patience_s = limits.shutdown_s if is_interrupted_only else limits.terminate_s
        is_waiting = self._since_signal is not None and self._since_signal.elapsed_s <= patience_s
        if not is_waiting and self._signals:
            number = self._signals.pop(0)
            context.students.kill(process, number)
            self._since_signal = Stopwatch(context.meter)
            self._note("kill", number.name)
