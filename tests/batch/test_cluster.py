"""The same batch on a real Dask cluster: two workers, one of which is killed in the middle."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from grader.assignment.load import load_assignment
from grader.batch.batch import Batch, Done
from grader.batch.executor import (
    BatchExecutor,
    DaskExecutor,
    ExecutorLost,
    LocalExecutor,
)
from grader.batch.intake import collect
from grader.batch.ledger import Ledger
from grader.batch.worker import Order, make_grading
from grader.errors import UsageError
from grader.machine import resources
from grader.report.model.result import grade_json
from grader.sandbox.choice import Choice

pytestmark = [pytest.mark.ros, pytest.mark.slow]

ASSIGNMENT = "simple_publisher"
LIMIT_S = 60.0


class Cluster:
    """A scheduler and its workers, as processes."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.folder = folder
        self.processes = [self._start("scheduler", "--port", "0", "--no-dashboard")]
        await_that(self.file.exists)
        self.workers = [self._start("worker", "--nthreads", "1", "--no-nanny") for _ in range(2)]
        self.processes += self.workers

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]]
        with (self.folder / f"{arguments[0]}.log").open("ab") as log:
            return subprocess.Popen(
                [*command, "--scheduler-file", str(self.file)], stdout=log, stderr=log
            )

    @property
    def address(self) -> str:
        """Of the scheduler, once both workers have come."""
        import distributed

        connect = distributed.Client
        with connect(scheduler_file=str(self.file)) as client:  # type: ignore[no-untyped-call]
            client.wait_for_workers(2, timeout=LIMIT_S)  # type: ignore[no-untyped-call]
            return str(client.scheduler.address)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    for process in made.processes:
        process.kill()
        process.wait()


def grade(
    order: Order, submissions: Path, out: Path, executor: BatchExecutor, on_first: object
) -> list[Done]:
    """Grade a folder of submissions; calls back after the first result."""
    done = []
    staging = out.with_name(out.name + "-staging")
    staging.mkdir()
    with Ledger(out).opened() as ledger:
        batch = Batch(load_assignment(ASSIGNMENT), ledger)
        _, to_do = batch.read(collect(submissions, staging))
        for item in batch.grade(to_do, executor):
            done.append(item)
            if len(done) == 1 and callable(on_first):
                on_first()
    executor.close()
    return sorted(done, key=lambda item: item.entry.key)


def test_a_worker_that_dies_loses_nothing_and_changes_nothing(
    tmp_path: Path, cluster: Cluster
) -> None:
    submissions = tmp_path / "class"
    for number, value in enumerate(("1.0", "1.5", "1.0  # again", "-1.0")):
        folder = submissions / f"student{number}"
        shutil.copytree(resources.reference() / ASSIGNMENT, folder)
        node = folder / "bot_publisher" / "bot_publisher" / "bot_publisher.py"
        node.write_text(node.read_text().replace("linear.x = 1.0", f"linear.x = {value}"))
        node.chmod(0o755)
        (folder / "link.py").symlink_to(node.relative_to(folder))
    (submissions / "broken.zip").write_bytes(b"PK")
    (submissions / "leads_out").mkdir()
    (submissions / "leads_out" / "passwd").symlink_to("/etc/passwd")
    loaded = load_assignment(ASSIGNMENT)
    order = Order(ASSIGNMENT, loaded.sha256, None, Choice.NONE)
    executor = DaskExecutor(cluster.address, order)
    far = grade(order, submissions, tmp_path / "far", executor, cluster.workers[0].kill)
    local = LocalExecutor(make_grading(order, loaded), 4)
    near = grade(order, submissions, tmp_path / "near", local, None)
    assert all(item.result is not None for item in far)
    assert [judged(item) for item in far] == [judged(item) for item in near]
    assert {item.result.score for item in far if item.result} >= {0.0, 10.0}


def test_a_cluster_takes_what_its_workers_can_and_is_lost_with_its_scheduler(
    tmp_path: Path, cluster: Cluster
) -> None:
    order = Order(ASSIGNMENT, load_assignment(ASSIGNMENT).sha256, None, Choice.NONE)
    executor = DaskExecutor(cluster.address, order)
    assert executor.capacity == 4
    cluster.workers[0].kill()
    await_that(lambda: executor.capacity == 2)
    submission = tmp_path / "ana"
    shutil.copytree(resources.reference() / ASSIGNMENT, submission)
    on_its_way = executor.submit("ana", submission, tmp_path, {})
    cluster.processes[0].kill()
    with pytest.raises(ExecutorLost, match=r"the Dask scheduler at tcp://.* was lost"):
        on_its_way.result(LIMIT_S)
    executor.close()


def await_that(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LIMIT_S
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def judged(done: Done) -> tuple[str, str, str | None]:
    """The grade of a submission, and what was graded."""
    assert done.result is not None, done.entry
    submission = done.result.submission
    assert submission.sha256 == done.entry.sha256
    return grade_json(done.result), submission.id, submission.problem


@pytest.mark.parametrize("words", [b"", b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n"])
def test_what_is_no_scheduler_is_not_waited_for(
    words: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grader.batch.executor._CONNECT_S", 1)
    monkeypatch.setattr("grader.batch.executor._ANSWER_S", 2.0)
    over = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            with server.accept()[0] as connection:
                connection.sendall(words)
                if not words:
                    over.wait()

        threading.Thread(target=answer, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        order = Order(ASSIGNMENT, "", None, Choice.NONE)
        with pytest.raises(UsageError, match=rf"no Dask scheduler answers at {address}; "):
            DaskExecutor(address, order)
        over.set()
