"""The folder of a batch: what is in it is graded, what is not is still to do.

``OUT/submissions/<key>/`` is moved into place when all of it is written, so after Ctrl-C, a
killed process or a power cut every submission is either there as a whole or not at all.
"""

from __future__ import annotations

import fcntl
import json
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from grader.errors import RosgradeError, UsageError, machine_fault
from grader.grading.files import RESULT_FILE
from grader.grading.last_attempt import EARLIER, keep_earlier
from grader.report.files import check_folder, file_version, folder_name, sync, write_whole
from grader.report.model.class_row import for_class
from grader.report.model.result import read_result
from grader.report.model.result_model import Result

BATCH_FILE = "batch.json"
SUBMISSIONS = "submissions"
_PARTIAL = ".partial"
_LOCK = ".lock"
_BETWEEN = "; "
"""Between the problems of a row in one text."""
_E = TypeVar("_E", bound="Entry")
_REPLACED = "#replaced"
"""Suffix of a result's folder while another one replaces it; no key has such a folder."""


@dataclass(frozen=True)
class Entry:
    """Facts about a row besides its result.

    Attributes:
        key: Of the row; names its folder.
        name: The student's, or empty.
        sha256: Of the submission, or empty where there is none.
        problem: What the instructor should look at, or why there is nothing to grade.
        same_as: Key of the row with the same submission that was graded for both, or empty.
        fault: Why it could not be graded, where not even a result could be written.
        team: Key whose review those have who handed it in together, or empty for one alone.
        email: The student's, or empty.
        source: Path of what was handed in, as it lay when it was read; may be gone by now.
        handed_in: ISO 8601, without an offset where its source has none; or empty.
        handed_in_from: What tells it, such as ``Gradescope's metadata``.
        attempt_of: Key of the student's row, where this is an earlier attempt.
        download: Name that Canvas gave to the file, or to one of them; or empty.
        shared_by: Key of the student of the same group who handed it in for this one, or empty.
    """

    key: str
    name: str = ""
    late: bool = False
    sha256: str = ""
    problem: str = ""
    same_as: str = ""
    fault: str = ""
    team: str = ""
    email: str = ""
    source: str = ""
    handed_in: str = ""
    handed_in_from: str = ""
    attempt_of: str = ""
    download: str = ""
    shared_by: str = ""

    @property
    def review_key(self) -> str:
        """Whose review is this row's: a team has one."""
        return self.team or self.attempt_of or self.key

    @property
    def original(self) -> str:
        """Key of the row that was graded for all who handed in the same."""
        return self.same_as or self.key

    @property
    def submission(self) -> object:
        """What tells whether two rows have the same submission; empty where there is none."""
        return self.sha256

    @property
    def handed_in_fields(self) -> dict[str, Any]:
        """The fields about what was handed in, by name: a group has them in common."""
        return {
            "sha256": self.sha256,
            "source": self.source,
            "fault": self.fault,
            "late": self.late,
            "handed_in": self.handed_in,
            "handed_in_from": self.handed_in_from,
        }

    def with_problem(self: _E, *problems: str) -> _E:
        """The row with more problems."""
        return replace(self, problem=_BETWEEN.join(filter(None, (self.problem, *problems))))

    def without_problem(self: _E, is_meant: Callable[[str], bool]) -> _E:
        """The row without those of its problems that are meant."""
        problems = self.problem.split(_BETWEEN)
        return replace(self, problem=_BETWEEN.join(one for one in problems if not is_meant(one)))


@dataclass(frozen=True)
class TakenFrom:
    """Where a batch found its submissions and its roster, and the seed that it was given."""

    submissions: str
    roster: str | None = None
    seed: int | None = None


@dataclass(frozen=True)
class BatchRows:
    """The assignment and the rows of a batch; ``course`` is the path of the rules, if any.

    ``before`` are the hashes of the assignments that the class was graded with earlier.
    """

    assignment: str
    location: str | None
    entries: tuple[Entry, ...]
    course: str | None = None
    sha256: str = ""
    before: tuple[str, ...] = ()
    taken_from: TakenFrom | None = None


class Ledger:
    """The folder of a batch."""

    def __init__(self, out: Path) -> None:
        """Name the folder; nothing is made yet."""
        self.out = out
        self._results: dict[str, tuple[object, Result | None]] = {}

    @contextmanager
    def opened(self) -> Iterator[Ledger]:
        """Hold the folder for this process, with nothing half-written in it."""
        check_folder(self.out)
        try:
            self.out.mkdir(parents=True, exist_ok=True)
            known = {BATCH_FILE, SUBMISSIONS, _PARTIAL, _LOCK}
            inside = {item.name for item in self.out.iterdir()}
            if inside and not inside & known:
                raise UsageError(f"{self.out}: holds other files; use a new folder")
            lock = (self.out / _LOCK).open("w")
        except OSError as error:
            refusal = UsageError(f"{self.out}: cannot be written: {error.strerror}")
            raise machine_fault(error, self.out) or refusal from error
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise UsageError(f"{self.out}: another batch is writing to it") from error
            self._put_back()
            shutil.rmtree(self.out / _PARTIAL, ignore_errors=True)
            (self.out / _PARTIAL).mkdir()
            try:
                yield self
            finally:
                shutil.rmtree(self.out / _PARTIAL, ignore_errors=True)

    @classmethod
    def around(cls, folder: Path) -> Ledger | None:
        """The batch that a folder is, or that a report lies in; None for a report of its own."""
        resolved = folder.resolve()
        # OUT/submissions/KEY is a report, OUT/submissions/KEY/recordings holds its recordings.
        for out in (resolved, *resolved.parents[1:3]):
            if (out / BATCH_FILE).is_file():
                return cls(out)
        return None

    def folder(self, key: str) -> Path:
        """Folder of a row's result."""
        return self.out / SUBMISSIONS / folder_name(key)

    def partial(self, key: str) -> Path:
        """A new folder to write a result in before it is moved into place."""
        folder = self.out / _PARTIAL / folder_name(key)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def put(self, key: str, partial: Path) -> None:
        """Move a result into place; the one that was there is kept beside its files."""
        target = self.folder(key)
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists():
            keep_earlier(target / RESULT_FILE)
            if (target / EARLIER).is_dir():
                shutil.copytree(target / EARLIER, partial / EARLIER)
        # Else a power cut could leave a folder in its place with nothing in its files.
        for item in (*partial.rglob("*"), partial):
            sync(item)
        if target.exists():
            old = partial.with_name(partial.name + _REPLACED)
            target.rename(old)
            partial.rename(target)
            shutil.rmtree(old, ignore_errors=True)
        else:
            partial.rename(target)
        sync(target.parent)

    def _put_back(self) -> None:
        """Undo a :meth:`put` that was killed: the earlier result and its history are whole."""
        for old in (self.out / _PARTIAL).glob(f"*{_REPLACED}"):
            target = self.out / SUBMISSIONS / old.name.removesuffix(_REPLACED)
            if not target.exists():
                old.rename(target)

    def result(self, key: str) -> Result | None:
        """What the class keeps of a row's result; None where there is none or it is damaged.

        It lacks plots, logs and figures: to write a result again, read :meth:`whole_result`.
        """
        # Read once for all that ask.
        version = file_version(self.folder(key) / RESULT_FILE)
        if key not in self._results or self._results[key][0] != version:
            whole = self.whole_result(key)
            self._results[key] = version, for_class(whole) if whole is not None else None
        return self._results[key][1]

    def whole_result(self, key: str) -> Result | None:
        """A row's result as it was written; None where there is none or it is damaged."""
        try:
            return read_result(self.folder(key) / RESULT_FILE)
        except RosgradeError:
            return None

    def write(
        self,
        entries: Iterable[Entry],
        assignment: str,
        assignment_sha256: str,
        location: str | None = None,
        course: str | None = None,
        taken_from: TakenFrom | None = None,
    ) -> None:
        """Write the assignment and the rows; what is known of earlier ones stays."""
        columns = [field.name for field in fields(Entry)]
        before: dict[str, None] = {}
        with suppress(UsageError):
            earlier = self.read()
            before = dict.fromkeys((*earlier.before, earlier.sha256))
            taken_from = taken_from or earlier.taken_from
        before.pop(assignment_sha256, None)
        data = {
            "assignment": {
                "id": assignment,
                "sha256": assignment_sha256,
                "location": location,
                "before": list(before),
            },
            "course": course,
            "taken_from": asdict(taken_from) if taken_from is not None else None,
            "rows": [{name: getattr(entry, name) for name in columns} for entry in entries],
        }
        write_whole(self.out / BATCH_FILE, json.dumps(data, indent=2, ensure_ascii=False) + "\n")

    def read(self) -> BatchRows:
        """Read what :meth:`write` wrote."""
        file = self.out / BATCH_FILE
        try:
            data = json.loads(file.read_text(encoding="utf-8"))
            entries = tuple(Entry(**row) for row in data["rows"])
            assignment = data["assignment"]
            taken_from = data.get("taken_from")
            return BatchRows(
                assignment=str(assignment["id"]),
                location=assignment.get("location"),
                entries=entries,
                course=data.get("course"),
                sha256=assignment["sha256"],
                before=tuple(assignment.get("before", ())),
                taken_from=TakenFrom(**taken_from) if taken_from else None,
            )
        except FileNotFoundError as error:
            raise UsageError(f"{self.out}: is not the folder of a batch") from error
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UsageError(f"{file}: is damaged: {error}; run the batch again") from error
