"""Executors that grade a batch: threads of this process, or the workers of a Dask cluster."""

from __future__ import annotations

import logging
import threading
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, Protocol

from grader.batch.worker import Order, Parcel, Values, grade_into, grade_remotely, unpack
from grader.errors import GraderFault, RosgradeError, UsageError
from grader.grading.grading import Grading
from grader.grading.spine import HandedIn

_CONNECT_S = 15
"""A scheduler on a slow network answers within this time."""
_ANSWER_S = _CONNECT_S + 5.0
"""Dask itself would wait for ever for an answer of a program that is no scheduler."""
_EACH_WORKER = 2
"""Submissions on their way to a thread of a worker: one is graded, one waits."""


class ExecutorLost(GraderFault):
    """No worker is left to grade submissions."""


class BatchExecutor(Protocol):
    """Grades submissions."""

    @property
    def capacity(self) -> int:
        """How many submissions to hand over at once at the moment; at least one."""

    def submit(self, key: str, path: Path, folder: Path, given: Values) -> Future[None]:
        """Grade the submission at a path, and write report, result and recordings to a folder.

        ``given`` are the values of variables that the roster says.

        A future that ends with :class:`ExecutorLost` says nothing of its submission.
        """

    def close(self) -> None:
        """Stop all gradings and every process that they started."""


class LocalExecutor:
    """Threads of this process; the cells and builds below them are what takes the CPUs."""

    def __init__(self, grading: Grading, jobs: int) -> None:
        """Start."""
        self.capacity = jobs
        self._grading = grading
        self._pool = ThreadPoolExecutor(max_workers=jobs, thread_name_prefix="submission")

    def submit(self, key: str, path: Path, folder: Path, given: Values) -> Future[None]:
        """See :class:`BatchExecutor`."""
        return self._pool.submit(grade_into, self._grading, HandedIn(path, folder, key, given))

    def close(self) -> None:
        """See :class:`BatchExecutor`."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._grading.close()
        self._pool.shutdown()


def _connected(address: str, client: Any) -> Any:
    """A client of the scheduler at an address; it is made in a thread, which may hang for ever."""
    connected: Future[Any] = Future()

    def connect() -> None:
        try:
            connected.set_result(client(address, timeout=f"{_CONNECT_S}s", set_as_default=False))
        except Exception as error:
            connected.set_exception(error)

    threading.Thread(target=connect, name="connect", daemon=True).start()
    wait([connected], _ANSWER_S)
    if not connected.done() or connected.exception() is not None:
        raise UsageError(
            f"no Dask scheduler answers at {address}; a scheduler's port is 8786, that of its "
            "dashboard 8787"
        )
    return connected.result()


class DaskExecutor:
    """Workers of a cluster; if one dies, the scheduler gives its submissions to others."""

    def __init__(self, address: str, order: Order) -> None:
        """Connect."""
        try:
            import distributed
        except ImportError as error:
            raise UsageError(
                "--scheduler needs Dask: install rosgrade's extra `cluster`, or run `make setup` "
                "in its checkout"
            ) from error
        self._client = _connected(address, distributed.Client)
        # rosgrade itself reports that a scheduler is lost, without Dask's tracebacks.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        self._order = order
        self._address = address
        if not self._threads():
            self._client.close()
            raise UsageError(f"the Dask scheduler at {address} has no workers")

    @property
    def capacity(self) -> int:
        """See :class:`BatchExecutor`; workers come and go."""
        return max(1, _EACH_WORKER * self._threads())

    def _threads(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except OSError:
            return 0

    def _lost(self) -> ExecutorLost:
        return ExecutorLost(f"the Dask scheduler at {self._address} was lost")

    def submit(self, key: str, path: Path, folder: Path, given: Values) -> Future[None]:
        """See :class:`BatchExecutor`."""
        graded: Future[None] = Future()
        try:
            parcel = Parcel.of(key, path, given)
        except RosgradeError as error:
            graded.set_exception(error)
            return graded
        try:
            task = self._client.submit(grade_remotely, self._order, parcel, pure=False, retries=2)
        except Exception:
            # Dask closes a client that has waited in vain for its scheduler to come back.
            if self._client.status != "closed":
                raise
            graded.set_exception(self._lost())
            return graded

        def finish(finished: Any) -> None:
            if finished.cancelled():
                graded.set_exception(self._lost())
                return
            try:
                unpack(finished.result(), folder)
            except GraderFault as fault:
                graded.set_exception(fault)
            except Exception as error:
                graded.set_exception(GraderFault(f"the cluster could not grade it: {error}"))
            else:
                graded.set_result(None)

        task.add_done_callback(finish)
        return graded

    def close(self) -> None:
        """See :class:`BatchExecutor`."""
        self._client.close()
