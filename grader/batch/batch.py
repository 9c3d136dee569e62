"""The grading of a class: submissions side by side, each once, with results in one folder."""

from __future__ import annotations

import shutil
import traceback
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
    _given: dict[str, dict[str, str]] = field(default_factory=dict)

    def read(
        self, rows: Sequence[Collected], on_read: Callable[[str], None] = lambda _: None
    ) -> tuple[list[Entry], dict[str, Path]]:
        """Read what was handed in, and find identical submissions."""
        earlier = self._earlier()
        unknown = self.retry - {RETRY_ALL, RETRY_ERRORS} - {row.key for row in rows}
        if unknown:
            name = min(unknown)
            nearest = did_you_mean(name, [row.key for row in rows])
            raise UsageError(f"--retry: there is no submission called {name}.{nearest}")
        paths: dict[str, Path] = {}
        first: dict[tuple[str, str], str] = {}
        columns = {
            name: one.column.casefold()
            for name, one in self.loaded.assignment.variables.items()
            if one.column is not None
        }
        for row in rows:
            on_read(row.key)
            given = {name: row.columns.get(column, "") for name, column in columns.items()}
            self._given[row.key] = {name: value for name, value in given.items() if value}
            entry: Entry = row
            if row.path is not None:
                entry = replace(entry, source=str(row.path.resolve()))
                try:
                    entry = replace(entry, sha256=fingerprint(row.path))
                except Exception as error:
                    entry = self._with_fault(entry, error)
                distinct = entry.sha256 in ("", NO_FILES)
                same = (entry.sha256, str(self._given[row.key]))
                original = row.key if distinct else first.setdefault(same, row.key)
                if original != row.key:
                    entry = replace(entry, same_as=original)
                    self._twins.setdefault(original, []).append(row.key)
                elif not entry.fault:
                    paths[row.key] = row.path
            self._entries[row.key] = entry
        if self.keep:
            paths |= self._keep_absent(earlier)
        named = with_teams(self._entries.values(), earlier, self.ledger)
        self._entries = {entry.key: entry for entry in named}
        to_do = {key: path for key, path in paths.items() if not self._is_done(key)}
        self._refuse_changed(to_do)
        self._keep_attempts(earlier)
        self._write()
        return list(self._entries.values()), to_do

    def grade(self, to_do: dict[str, Path], executor: BatchExecutor | None) -> Iterator[Done]:
        """Grade, and put each result into place as soon as it is there."""
        for key, entry in self._entries.items():
            if key not in to_do and not entry.same_as:
                yield from self._finished(key, fresh=False)
        waiting = list(to_do.items())[::-1]
        running: dict[Future[None], tuple[str, Path]] = {}
        try:
            while executor is not None and (waiting or running):
                while waiting and len(running) < executor.capacity:
                    key, path = waiting.pop()
                    partial = self.ledger.partial(key)
                    running[executor.submit(key, path, partial, self._given[key])] = (
                        key,
                        partial,
                    )
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
        given = self._given[key]
        if given and dict(find_recordings(self.ledger.folder(key)).submission.given) != given:
            return False
        # Of identical submissions only one is graded, even if another one was named.
        same = {key, *self._twins.get(key, ())}
        if RETRY_ALL in self.retry or not self.retry.isdisjoint(same):
            return False
        return not (RETRY_ERRORS in self.retry and not result.graded)

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
        changed, places = [], set()
        for key, entry in sorted(self._entries.items()):
            result = self.ledger.result(key) if entry.sha256 and not entry.same_as else None
            if key in to_do or result is None or result.submission.sha256 != entry.sha256:
                continue
            if result.assignment.sha256 != self.loaded.sha256:
                changed.append(key)
                places.add(result.assignment.location)
        if changed:
            out, more = self.ledger.out, ", …" if len(changed) > _MOST_NAMED else ""
            remedies = [
                f"{regrade_command(out, self.loaded)} judges their recordings again with this one"
            ]
            if places != {self.loaded.location}:
                remedies.append(f"`rosgrade batch {out}` goes on with theirs")
            if not self.keep:
                remedies.append("`--retry all` runs all of them again, `--retry NAME` one")
            raise UsageError(
                f"{out}: {len(changed)} ({', '.join(changed[:_MOST_NAMED])}{more}) graded with "
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
        entry = self._entries[key]
        result = self.ledger.result(key) if entry.sha256 and not entry.fault else None
        yield Done(entry, result, fresh)
        for twin in [self._entries[name] for name in self._twins.get(key, ())]:
            row = self._entries[twin.key] = replace(twin, fault=entry.fault)
            if result is not None:
                try:
                    copy_result(self.loaded, self.ledger, key, twin)
                except RosgradeError as error:
                    why = str(error).partition("\n")[0]
                    again = GraderFault(f"{why}; `--retry {key}` grades both again")
                    row = self._entries[twin.key] = self._with_fault(twin, again)
            known = result is not None and not row.fault
            yield Done(row, self.ledger.result(twin.key) if known else None, fresh)

    def _keep_absent(self, earlier: Mapping[str, Entry]) -> dict[str, Path]:
        """Keep the rows of students whose submission is not among those that were named now.

        Returns:
            What is still to be graded of them, such as after Ctrl-C, where it lay before.
        """
        kept, heirs, paths = {}, dict[str, str](), dict[str, Path]()
        # Who has it of another one of the group keeps it with that one.
        for key, old in sorted(earlier.items(), key=lambda one: bool(one[1].shared_by)):
            now = self._entries.get(key, Entry(key))
            giver = self._entries.get(old.shared_by, Entry("")) if old.shared_by else old
            own = old.sha256 and not old.attempt_of and giver.sha256 == old.sha256
            if own and not (now.sha256 or now.fault):
                self._entries[key] = kept[key] = old
                self._given.setdefault(key, {})
        for key, old in kept.items():
            original = self._entries.get(old.same_as, Entry(""))
            if old.same_as and original.sha256 != old.sha256:
                # It is something else by now, so the first of its twins takes its place.
                original = self._entries[heirs.setdefault(old.same_as, key)]
            twin = original.original if original.key != key else ""
            self._entries[key] = replace(old, same_as=twin)
            if twin:
                self._twins.setdefault(twin, []).append(key)
                continue
            result = self.ledger.result(key)
            if (result is None or result.submission.sha256 != old.sha256) and _lies_still(old):
                self._entries[key] = replace(old, same_as="", fault="")
                paths[key] = Path(old.source)
        return paths

    def _keep_attempts(self, earlier: Mapping[str, Entry]) -> None:
        """Keep the grades of students who handed in again, each as a row of its own."""
        for key, old in earlier.items():
            if old.attempt_of in self._entries:
                self._entries.setdefault(key, old)
        for key, old in earlier.items():
            entry = self._entries.get(key)
            if entry is None or old.attempt_of or entry.sha256 in ("", old.sha256):
                continue
            known = {one.sha256 for one in self._entries.values() if one.attempt_of == key}
            result = self.ledger.result(key)
            if result is None or old.sha256 in known or result.submission.sha256 != old.sha256:
                continue
            names = (f"{key} (attempt {number})" for number in count(1))
            name = next(name for name in names if name not in self._entries)
            kept = replace(old, key=name, attempt_of=key, same_as="", problem="")
            try:
                copy_result(self.loaded, self.ledger, key, kept)
                self._entries[name] = kept
            except RosgradeError as error:
                why = f"an earlier attempt could not be kept: {error}".partition("\n")[0]
                self._entries[key] = entry.with_problem(why)

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
    known, original = map(ledger.whole_result, (twin.key, key))
    if known and original and grade_json(known) == grade_json(original):
        return
    partial = ledger.partial(twin.key)
    history = shutil.ignore_patterns(EARLIER)
    shutil.copytree(ledger.folder(key), partial, dirs_exist_ok=True, ignore=history)
    found = find_recordings(partial)
    record = replace(found.submission, id=twin.key)
    write_whole(partial / RECORDINGS_FOLDER / SUBMISSION_FILE, to_json(record))
    write_graded(regrade(loaded, replace(found, submission=record)), partial, Clock())
    ledger.put(twin.key, partial)


def with_teams(rows: Iterable[Entry], before: Mapping[str, Entry], ledger: Ledger) -> list[Entry]:
    """Rows with the teams that share a submission.

    A team has one review: that of a member who was reviewed before, or of the first to hand in. A
    member who has a review keeps it.
    """
    rows, store = list(rows), ReviewStore(ledger.out)
    shared: dict[str, list[str]] = {}
    for row in sorted(rows, key=lambda row: bool(row.shared_by)):
        if not row.attempt_of:
            hand = row.source or row.shared_by or row.team or row.key
            shared.setdefault(hand, []).append(row.key)
    teams: dict[str, str] = {}
    for keys in filter(lambda keys: len(keys) > 1, shared.values()):
        had = {key: before[key].review_key if key in before else key for key in keys}
        had = {key: one if one in keys else key for key, one in had.items()}
        reviewed = {key: one for key, one in had.items() if store.file(one).is_file()}
        first = next(iter(reviewed.values()), keys[0])
        teams |= {key: reviewed.get(key, first) for key in keys}
    return [row if row.attempt_of else replace(row, team=teams.get(row.key, "")) for row in rows]
