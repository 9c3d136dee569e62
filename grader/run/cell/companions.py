"""Programs of the author's that run beside the student's, such as another robot."""

from __future__ import annotations

from pathlib import Path

from grader.run.host.disturbance import DisturbanceMeter
from grader.run.order import CellOrder
from grader.run.process.output import OutputReader
from grader.run.process.student import StudentProcesses

_PIPES_LIMIT_S = 1.0
_SHOWN_LINES = 3


class Companions:
    """They are started and stopped as the student's are, and nothing of theirs is judged."""

    def __init__(self, order: CellOrder, meter: DisturbanceMeter) -> None:
        self._order = order
        self._output = OutputReader(order.limits.output_bytes)
        self._processes = StudentProcesses(self._output, meter, order.process_sandbox)

    @property
    def pids(self) -> frozenset[int]:
        """Every process of theirs."""
        return self._processes.pids

    def start(self, domain_id: int) -> None:
        """Start them."""
        of_run = {"ROS_DOMAIN_ID": str(domain_id)}
        environment, folder = self._order.companion_environment, Path(self._order.scratch)
        for one in self._order.companions:
            self._processes.launch(one.name, one.argv, environment, of_run, folder)

    def faults(self, *, late: bool = False) -> list[str]:
        """A sentence for each that ended by an error, or that still has no node."""
        self._processes.poll()
        found = []
        for one in self._processes.records():
            if one.exited_ns is not None and one.exit_code:
                said = " ".join(self._output.tail(one.name, "stderr", _SHOWN_LINES))
                found.append(
                    f"the companion {one.name} of the assignment ended with exit code "
                    f"{one.exit_code}: {said or 'it printed nothing'}"
                )
        if late and not found:
            names = ", ".join(one.name for one in self._order.companions)
            found.append(f"the companions of the assignment ({names}) have not one node each")
        return found

    def stop(self) -> list[str]:
        """End them; what went wrong before."""
        found = self.faults()
        self._processes.stop(self._order.limits)
        return found

    def clean_up(self) -> None:
        """Take what is left of them."""
        self._processes.clean_up()
        self._output.close(_PIPES_LIMIT_S)
