"""The grading of a class: submissions side by side, each once, with results in one folder."""

from __future__ import annotations

import shutil
import traceback
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.batch.collected import Collected
from grader.batch.executor import BatchExecutor, ExecutorLost
from grader.batch.ledger import Entry, Ledger, TakenFrom
from grader.batch.used_assignment import regrade_command
from grader.errors import GraderFault, RosgradeError, UsageError, machine_fault
from grader.grading.files import write_graded
from grader.grading.graded import RECORDINGS_FOLDER, SUBMISSION_FILE
from grader.grading.last_attempt import EARLIER
from grader.grading.regrading import find_recordings, regrade
from grader.recording.model import to_json
from grader.report.files import write_whole
from grader.report.model.facts import Clock
from grader.report.model.result import grade_json
from grader.report.model.result_model import Result
from grader.review.store import ReviewStore
from grader.spec.nearest_name import did_you_mean
from grader.submission.intake.locate import NO_FILES
from grader.submission.intake.paths import shown
from grader.submission.prepare import fingerprint

FAULTS_FILE = "faults.log"
_MOST_NAMED = 5
RETRY_ALL, RETRY_ERRORS = "all", "errors"


@dataclass(frozen=True)
class Done:
    """A row that is finished."""

    entry: Entry
    result: Result | None
    fresh: bool


@dataclass
class Batch:
    """Grades the rows of a class into a folder.

    ``retry`` holds keys, ``all`` or ``errors``; ``course`` is the path of the rules, if any. With
    ``keep`` a student whose submission is not there any more stays as graded before.
    """

    loaded: LoadedAssignment
    ledger: Ledger
    retry: frozenset[str] = frozenset()
    course: str | None = None
    taken_from: TakenFrom | None = None
    keep: bool = False
    _entries: dict[str, Entry] = field(default_factory=dict)
    _twins: dict[str, list[str]] = field(default_factory=dict)
    """Key of a row that is graded -> keys of the rows with the same submission."""
    _values: dict[str, dict[str, str]] = field(default_factory=dict)
    """Key of a row -> what the roster says for variables of the assignment."""

    def read(
        self, rows: Sequence[Collected], on_read: Callable[[str], None] = lambda _: None
    ) -> tuple[list[Entry], dict[str, Path]]:
        """Read what was handed in, and find identical submissions.

        Returns:
            All rows, and where that lies which is still to be graded, by key.
        """
        earlier = self._earlier()
        self._refuse_unknown_retry([row.key for row in rows])
        paths: dict[str, Path] = {}
        first: dict[tuple[str, str], str] = {}
        for row in rows:
            on_read(row.key)
            self._values[row.key] = self._values_of(row)
            entry = self._entries[row.key] = self._read_row(row, first)
            if row.path is not None and not entry.same_as and not entry.fault:
                paths[row.key] = row.path
        if self.keep:
            paths |= self._keep_absent(earlier)
        entries = with_teams(self._entries.values(), earlier, self.ledger)
        self._entries = {entry.key: entry for entry in entries}
        to_do = {key: path for key, path in paths.items() if not self._is_done(key)}
        self._refuse_changed(to_do)
        self._keep_attempts(earlier)
        self._write()
        return list(self._entries.values()), to_do

    def _refuse_unknown_retry(self, keys: Collection[str]) -> None:
        unknown = self.retry.difference(keys, (RETRY_ALL, RETRY_ERRORS))
        if unknown:
            name = min(unknown)
            nearest = did_you_mean(name, keys)
            raise UsageError(f"--retry: there is no submission called {name}.{nearest}")

    def _values_of(self, row: Collected) -> dict[str, str]:
        values = {}
        for name, variable in self.loaded.assignment.variables.items():
            if variable.column is not None:
                value = row.columns.get(variable.column.casefold(), "")
                if value:
                    values[name] = value
        return values

    def _read_row(self, row: Collected, first: dict[tuple[str, str], str]) -> Entry:
        """A row with the hash of its submission, or why that cannot be read.

        Args:
            first: Hash and values of what was read -> key of the first row with them.
        """
        if row.path is None:
            return row
        entry: Entry = replace(row, source=str(row.path.resolve()))
        try:
            entry = replace(entry, sha256=fingerprint(row.path))
        except Exception as error:
            entry = self._with_fault(entry, error)
        if entry.sha256 in ("", NO_FILES):
            return entry
        original = first.setdefault((entry.sha256, str(self._values[row.key])), row.key)
        if original == row.key:
            return entry
        self._twins.setdefault(original, []).append(row.key)
        return replace(entry, same_as=original)

    def grade(self, to_do: dict[str, Path], executor: BatchExecutor | None) -> Iterator[Done]:
        """Grade, and put each result into place as soon as it is there."""
        for key, entry in self._entries.items():
            if key not in to_do and not entry.same_as:
                yield from self._finished(key, fresh=False)
        waiting = deque(to_do.items())
        running: dict[Future[None], tuple[str, Path]] = {}
        try:
            while executor is not None and (waiting or running):
                while waiting and len(running) < executor.capacity:
                    key, path = waiting.popleft()
                    partial = self.ledger.partial(key)
                    future = executor.submit(key, path, partial, self._values[key])
                    running[future] = (key, partial)
                finished, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    key, partial = running.pop(future)
                    self._take(key, partial, future)
                    yield from self._finished(key, fresh=True)
        finally:
            self._write()

    def _is_done(self, key: str) -> bool:
        result = self.ledger.result(key)
        if result is None or result.submission.sha256 != self._entries[key].sha256:
            return False
        values = self._values[key]
        if values and dict(find_recordings(self.ledger.folder(key)).submission.given) != values:
            return False
        # Of identical submissions only one is graded, even if another one was named.
        named = {key, *self._twins.get(key, ())}
        if RETRY_ALL in self.retry or not self.retry.isdisjoint(named):
            return False
        return result.graded or RETRY_ERRORS not in self.retry

    def _earlier(self) -> dict[str, Entry]:
        """The rows as an earlier batch wrote them."""
        try:
            written = self.ledger.read()
        except UsageError:
            # There is none yet, or it is damaged; it is written again from the class.
            return {}
        name = written.assignment
        if name != self.loaded.assignment.id:
            raise UsageError(f"{self.ledger.out}: holds the grades of {name}; use a new folder")
        return {entry.key: entry for entry in written.entries}

    def _refuse_changed(self, to_do: Collection[str]) -> None:
        """Let no grade of another version of the assignment stay beside the new ones."""
        changed: dict[str, str | None] = {}
        for key, entry in sorted(self._entries.items()):
            if key in to_do or not entry.sha256 or entry.same_as:
                continue
            result = self.ledger.result(key)
            if result is None or result.submission.sha256 != entry.sha256:
                continue
            if result.assignment.sha256 != self.loaded.sha256:
                changed[key] = result.assignment.location
        if not changed:
            return
        out, more = self.ledger.out, ", …" if len(changed) > _MOST_NAMED else ""
        remedies = [
            f"{regrade_command(out, self.loaded)} judges their recordings again with this one"
        ]
        if set(changed.values()) != {self.loaded.location}:
            remedies.append(f"`rosgrade batch {out}` goes on with theirs")
        if not self.keep:
            remedies.append("`--retry all` runs all of them again, `--retry NAME` one")
        raise UsageError(
            f"{out}: {len(changed)} ({', '.join([*changed][:_MOST_NAMED])}{more}) graded with "
            f"another version of {self.loaded.assignment.id}. {'; '.join(remedies)}"
        )

    def _take(self, key: str, partial: Path, future: Future[None]) -> None:
        try:
            future.result()
            self.ledger.put(key, partial)
        except ExecutorLost:
            raise
        except Exception as error:
            self._entries[key] = self._with_fault(self._entries[key], error)

    def _with_fault(self, entry: Entry, error: Exception) -> Entry:
        """Note on the row why it could not be graded; the others go on."""
        if isinstance(error, OSError):
            error = machine_fault(error) or error
        fault = str(error).partition("\n")[0]
        if not isinstance(error, RosgradeError):
            fault = f"a fault of rosgrade, see {FAULTS_FILE}: {type(error).__name__}"
        log = self.ledger.out / FAULTS_FILE
        with log.open("a", encoding="utf-8", errors="backslashreplace") as stream:
            stream.write(f"{entry.key}\n{''.join(traceback.format_exception(error))}\n")
        return replace(entry, fault=shown(fault))

    def _finished(self, key: str, *, fresh: bool) -> Iterable[Done]:
        """The row with its result, then those with the same submission."""
        entry = self._entries[key]
        result = self.ledger.result(key) if entry.sha256 and not entry.fault else None
        yield Done(entry, result, fresh)
        for twin_key in self._twins.get(key, ()):
            twin = replace(self._entries[twin_key], fault=entry.fault)
            if result is not None:
                try:
                    copy_result(self.loaded, self.ledger, key, twin)
                except RosgradeError as error:
                    why = str(error).partition("\n")[0]
                    fault = GraderFault(f"{why}; `--retry {key}` grades both again")
                    twin = self._with_fault(twin, fault)
            self._entries[twin_key] = twin
            has_result = result is not None and not twin.fault
            yield Done(twin, self.ledger.result(twin_key) if has_result else None, fresh)

    def _keep_absent(self, earlier: Mapping[str, Entry]) -> dict[str, Path]:
        """Keep the rows of students whose submission is not among those that were named now.

        Returns:
            What is still to be graded of them, such as after Ctrl-C, where it lay before.
        """
        kept = self._absent(earlier)
        paths: dict[str, Path] = {}
        heirs: dict[str, str] = {}
        for key, old in kept.items():
            original = self._entries.get(old.same_as, Entry(""))
            if old.same_as and original.sha256 != old.sha256:
                # It is something else by now, so the first of its twins takes its place.
                original = self._entries[heirs.setdefault(old.same_as, key)]
            graded_key = original.original if original.key != key else ""
            self._entries[key] = replace(old, same_as=graded_key)
            if graded_key:
                self._twins.setdefault(graded_key, []).append(key)
                continue
            result = self.ledger.result(key)
            is_graded = result is not None and result.submission.sha256 == old.sha256
            if not is_graded and _lies_still(old):
                self._entries[key] = replace(old, same_as="", fault="")
                paths[key] = Path(old.source)
        return paths

    def _absent(self, earlier: Mapping[str, Entry]) -> dict[str, Entry]:
        """Put earlier rows of students back who handed in nothing now; these rows by key."""
        absent = {}
        # Who has it of another one of the group keeps it with that one, which is put back first.
        for key, old in sorted(earlier.items(), key=lambda item: bool(item[1].shared_by)):
            now = self._entries.get(key, Entry(key))
            giver = self._entries.get(old.shared_by, Entry("")) if old.shared_by else old
            had_submission = old.sha256 and not old.attempt_of and giver.sha256 == old.sha256
            if had_submission and not (now.sha256 or now.fault):
                self._entries[key] = absent[key] = old
                self._values.setdefault(key, {})
        return absent

    def _keep_attempts(self, earlier: Mapping[str, Entry]) -> None:
        """Keep the grades of students who handed in again, each as a row of its own."""
        for key, old in earlier.items():
            if old.attempt_of in self._entries:
                self._entries.setdefault(key, old)
        for key, old in earlier.items():
            entry = self._entries.get(key)
            if entry is None or old.attempt_of or entry.sha256 in ("", old.sha256):
                continue
            result = self.ledger.result(key)
            if result is None or result.submission.sha256 != old.sha256:
                continue
            attempts = [one for one in self._entries.values() if one.attempt_of == key]
            if old.sha256 in (attempt.sha256 for attempt in attempts):
                continue
            attempt = replace(
                old, key=self._attempt_key(key), attempt_of=key, same_as="", problem=""
            )
            try:
                copy_result(self.loaded, self.ledger, key, attempt)
                self._entries[attempt.key] = attempt
            except RosgradeError as error:
                why = f"an earlier attempt could not be kept: {error}".partition("\n")[0]
                self._entries[key] = entry.with_problem(why)

    def _attempt_key(self, key: str) -> str:
        names = (f"{key} (attempt {number})" for number in count(1))
        return next(name for name in names if name not in self._entries)

    def _write(self) -> None:
        loaded = self.loaded
        version = (loaded.assignment.id, loaded.sha256, loaded.location)
        self.ledger.write(self._entries.values(), *version, self.course, self.taken_from)


def _lies_still(entry: Entry) -> bool:
    """Whether what was handed in lies where it was read, unchanged."""
    with suppress(RosgradeError, OSError):
        return bool(entry.source) and fingerprint(entry.source) == entry.sha256
    return False


def copy_result(loaded: LoadedAssignment, ledger: Ledger, key: str, twin: Entry) -> None:
    """Give an identical submission of another student the same result, under its own name."""
    before, original = ledger.whole_result(twin.key), ledger.whole_result(key)
    if before and original and grade_json(before) == grade_json(original):
        return
    partial = ledger.partial(twin.key)
    history = shutil.ignore_patterns(EARLIER)
    shutil.copytree(ledger.folder(key), partial, dirs_exist_ok=True, ignore=history)
    recordings = find_recordings(partial)
    record = replace(recordings.submission, id=twin.key)
    write_whole(partial / RECORDINGS_FOLDER / SUBMISSION_FILE, to_json(record))
    write_graded(regrade(loaded, replace(recordings, submission=record)), partial, Clock())
    ledger.put(twin.key, partial)


def with_teams(rows: Iterable[Entry], before: Mapping[str, Entry], ledger: Ledger) -> list[Entry]:
    """Rows with the teams that share a submission.

    A team has one review: that of a member who was reviewed before, or of the first to hand in. A
    member who has a review keeps it.
    """
    rows, store = list(rows), ReviewStore(ledger.out)
    team_of: dict[str, str] = {}
    for members in _sharing(rows):
        reviews = {}
        for key in members:
            review = before[key].review_key if key in before else key
            # One of somebody who is in the team no more stays with that person.
            reviews[key] = review if review in members else key
        reviewed = {key: one for key, one in reviews.items() if store.file(one).is_file()}
        first = next(iter(reviewed.values()), members[0])
        team_of |= {key: reviewed.get(key, first) for key in members}
    return [row if row.attempt_of else replace(row, team=team_of.get(row.key, "")) for row in rows]


def _sharing(rows: Iterable[Entry]) -> list[list[str]]:
    """Keys of the rows of each submission that several share, who handed it in first."""
    members: dict[str, list[str]] = {}
    for row in sorted(rows, key=lambda row: bool(row.shared_by)):
        if not row.attempt_of:
            submission = row.source or row.shared_by or row.team or row.key
            members.setdefault(submission, []).append(row.key)
    return [keys for keys in members.values() if len(keys) > 1]
