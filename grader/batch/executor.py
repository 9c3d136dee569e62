"""Executors that grade a batch: threads of this process, or the workers of a Dask cluster.

Below them what a worker gets and sends: its order, a submission as a parcel, the files of a grade.
"""

from __future__ import annotations

import functools
import io
import logging
import os
import stat
import tarfile
import threading
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.errors import GraderFault, RosgradeError, SubmissionError, UsageError
from grader.grading.files import write_graded
from grader.grading.grading import Grading
from grader.grading.spine import HandedIn, grade
from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.machine.scratch import Scratch
from grader.report.model.facts import Clock
from grader.run.admission import Admission
from grader.run.runner import Runner
from grader.sandbox.choice import Choice
from grader.sandbox.trial import choose
from grader.submission.intake.locate import opened
from grader.submission.prepare import Prepared, refused


@dataclass(frozen=True)
class Order:
    """What every worker of a batch needs to know."""

    assignment: str
    sha256: str
    seed: int | None
    sandbox: Choice


Given = Mapping[str, str]
"""What the roster says for variables of the assignment, by their names."""


def grade_into(grading: Grading, handed_in: HandedIn) -> None:
    """Grade a submission and write report, result and recordings."""
    clock = Clock()
    write_graded(grade(handed_in, grading), handed_in.folder, clock)


def pack(path: Path, name: str = ".") -> bytes:
    """A file or a folder as an uncompressed tar: recordings are compressed already."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as tar:
        tar.add(path, name)
    return stream.getvalue()


def unpack(packed: bytes, folder: Path) -> None:
    """Write the files of a tar that :func:`pack` made; one that leads out of the folder is refused.

    Links and executable bits are kept: they belong to what a submission's hash is of. The filters
    of :mod:`tarfile` are not there in Debian 12's Python, 3.11.2.
    """
    with tarfile.open(fileobj=io.BytesIO(packed)) as tar:
        for member in tar:
            target = folder / member.name
            end = target.parent / member.linkname if member.issym() else target
            if not end.resolve().is_relative_to(folder.resolve()):
                raise GraderFault(f"a worker sent a file outside its folder: {member.name}")
            if member.isdir():
                target.mkdir(parents=True, exist_ok=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            if member.issym():
                target.symlink_to(member.linkname)
            elif (stream := tar.extractfile(member)) is not None:
                target.write_bytes(stream.read())
                if member.mode & stat.S_IXUSR:
                    target.chmod(target.stat().st_mode | stat.S_IXUSR)


@dataclass(frozen=True)
class Parcel:
    """A submission on its way to a worker."""

    key: str
    name: str
    given: Given
    content: bytes = b""
    refused: Prepared | None = None

    @classmethod
    def of(cls, key: str, path: Path, given: Given) -> Parcel:
        """Pack what was handed in."""
        try:
            with opened(path) as located:
                packed = pack(located.root if path.is_dir() else path, path.name)
                return cls(key, path.name, given, packed)
        except SubmissionError as error:
            # A refused archive is not sent: it may be large, and nothing of it will run.
            return cls(key, path.name, given, refused=refused(path, error))


def grade_remotely(order: Order, parcel: Parcel) -> bytes:
    """Grade on a worker of a cluster."""
    with _held:
        grading = _make_grading(order)
    with Scratch("worker") as temporary:
        folder = temporary / "out"
        folder.mkdir()
        if parcel.refused is None:
            unpack(parcel.content, temporary / "in")
        path = temporary / "in" / parcel.name
        grade_into(grading, HandedIn(path, folder, parcel.key, parcel.given, parcel.refused))
        return pack(folder)


_held = threading.Lock()


@functools.cache
def _make_grading(order: Order) -> Grading:
    """The grading of this process; all tasks share its builds, cells and limits."""
    loaded = load_assignment(order.assignment)
    if loaded.sha256 != order.sha256:
        raise GraderFault(
            f"the worker on {os.uname().nodename} has another version of the assignment "
            f"{order.assignment}; install the same version there"
        )
    return make_grading(order, loaded)


def make_grading(
    order: Order, loaded: LoadedAssignment, admission: Admission | None = None
) -> Grading:
    """Set up grading on this machine."""
    # Unknown programs run without a sandbox only by explicit wish.
    wanted = Choice.BWRAP if order.sandbox is Choice.AUTO else order.sandbox
    try:
        sandbox, _ = choose(wanted, cache_folder())
    except GraderFault as fault:
        raise GraderFault(
            f"{fault}\nOr run the submissions with your own rights: --sandbox none"
        ) from fault
    runner = Runner(ros.find(), admission or Admission(), sandbox=sandbox)
    return Grading(loaded, runner, cache_folder(), seed=order.seed)


_CONNECT_S = 15
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

    def submit(self, key: str, path: Path, folder: Path, given: Given) -> Future[None]:
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

    def submit(self, key: str, path: Path, folder: Path, given: Given) -> Future[None]:
        """See :class:`BatchExecutor`."""
        return self._pool.submit(grade_into, self._grading, HandedIn(path, folder, key, given))

    def close(self) -> None:
        """See :class:`BatchExecutor`."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._grading.close()
        self._pool.shutdown()


def _connected(address: str, connect: Any) -> Any:
    answer: Future[Any] = Future()

    def ask() -> None:
        try:
            answer.set_result(connect(address, timeout=f"{_CONNECT_S}s", set_as_default=False))
        except Exception as error:
            answer.set_exception(error)

    threading.Thread(target=ask, name="connect", daemon=True).start()
    wait([answer], _ANSWER_S)
    if not answer.done() or answer.exception() is not None:
        raise UsageError(
            f"no Dask scheduler answers at {address}; a scheduler's port is 8786, that of its "
            "dashboard 8787"
        )
    return answer.result()


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

    def submit(self, key: str, path: Path, folder: Path, given: Given) -> Future[None]:
        """See :class:`BatchExecutor`."""
        done: Future[None] = Future()
        try:
            parcel = Parcel.of(key, path, given)
        except RosgradeError as error:
            done.set_exception(error)
            return done
        try:
            task = self._client.submit(grade_remotely, self._order, parcel, pure=False, retries=2)
        except Exception:
            # Dask closes a client that has waited in vain for its scheduler to come back.
            if self._client.status != "closed":
                raise
            done.set_exception(self._lost())
            return done

        def finish(finished: Any) -> None:
            if finished.cancelled():
                done.set_exception(self._lost())
                return
            try:
                unpack(finished.result(), folder)
            except GraderFault as fault:
                done.set_exception(fault)
            except Exception as error:
                done.set_exception(GraderFault(f"the cluster could not grade it: {error}"))
            else:
                done.set_result(None)

        task.add_done_callback(finish)
        return done

    def close(self) -> None:
        """See :class:`BatchExecutor`."""
        self._client.close()
