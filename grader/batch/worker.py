"""What grades one submission of a class: in a thread of the batch, or on a worker of a cluster.

A worker of a cluster gets an order, which is the same for all, and a submission as a parcel. It
sends back the files of the grade.
"""

from __future__ import annotations

import functools
import io
import os
import stat
import tarfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.errors import GraderFault, SubmissionError
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


Values = Mapping[str, str]
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
            leads_to = target.parent / member.linkname if member.issym() else target
            if not leads_to.resolve().is_relative_to(folder.resolve()):
                raise GraderFault(f"a worker sent a file outside its folder: {member.name}")
            if member.isdir():
                target.mkdir(parents=True, exist_ok=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            stream = None if member.issym() else tar.extractfile(member)
            if member.issym():
                target.symlink_to(member.linkname)
            elif stream is not None:
                target.write_bytes(stream.read())
                if member.mode & stat.S_IXUSR:
                    target.chmod(target.stat().st_mode | stat.S_IXUSR)


@dataclass(frozen=True)
class Parcel:
    """A submission on its way to a worker."""

    key: str
    name: str
    given: Values
    content: bytes = b""
    refused: Prepared | None = None

    @classmethod
    def of(cls, key: str, path: Path, given: Values) -> Parcel:
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
    # Else tasks that begin at once would each set up a grading of their own.
    with _SETTING_UP:
        grading = _make_grading(order)
    with Scratch("worker") as temporary:
        folder = temporary / "out"
        folder.mkdir()
        if parcel.refused is None:
            unpack(parcel.content, temporary / "in")
        path = temporary / "in" / parcel.name
        grade_into(grading, HandedIn(path, folder, parcel.key, parcel.given, parcel.refused))
        return pack(folder)


_SETTING_UP = threading.Lock()


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
    choice = Choice.BWRAP if order.sandbox is Choice.AUTO else order.sandbox
    try:
        sandbox, _ = choose(choice, cache_folder())
    except GraderFault as fault:
        raise GraderFault(
            f"{fault}\nOr run the submissions with your own rights: --sandbox none"
        ) from fault
    runner = Runner(ros.find(), admission or Admission(), sandbox=sandbox)
    return Grading(loaded, runner, cache_folder(), seed=order.seed)
