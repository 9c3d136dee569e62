"""The pipeline from a submission to a grade: prepare, run, judge, and again if disturbed."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, nullcontext
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from grader.assignment.limits import BuildLimitOptions
from grader.assignment.load import LoadedAssignment
from grader.checks.check import Parameters
from grader.checks.need import Bags, Need, StudentTests
from grader.errors import GraderFault, UsageError, machine_fault
from grader.findings.finding import Status
from grader.grade import Grade, grade
from grader.grade.naming import named
from grader.grading.reference_run import read_references
from grader.grading.type_support import TypeSupport
from grader.machine.load import cpu_count
from grader.recording.mcap_reader import read_recording
from grader.recording.model import Recording, to_json
from grader.recording.submission import SubmissionRecord
from grader.report.files import write_whole
from grader.report.html.replay import Replay
from grader.run.admission import Admission
from grader.run.imposing.mistake import Mistake
from grader.run.runner import Runner, RunRequest, scenario_seed
from grader.sandbox.python_tree import check_installed
from grader.spec.names import Names
from grader.submission.build.bounded import OutputLimits
from grader.submission.build.colcon import BuildLimits
from grader.submission.build.own_tests import LIBRARY
from grader.submission.prepare import Preparation, Prepared, prepare

RECORDINGS_FOLDER = "recordings"
SUBMISSION_FILE = "submission.json"
MOST_RUNS = 3
"""Runs of a scenario before it is given up as disturbed."""
_LONGEST_WORDS = 300
_N = TypeVar("_N", bound=Need)

OnRecorded = Callable[[SubmissionRecord, Mapping[str, Recording]], None]
"""Called with what is known of a submission: when it is read, when it is built (``build`` is there
then), and with its recordings so far after each of them."""


@dataclass(frozen=True)
class Graded:
    """A graded submission with everything that its grade is made from."""

    grade: Grade
    prepared: Prepared
    recordings: Mapping[str, Recording]
    files: Mapping[str, Path]
    runs: Mapping[str, int]
    faults: Mapping[str, str]
    references: Mapping[str, Replay] = field(default_factory=dict)
    repeats: tuple[str, ...] = ()
    """Why a run was repeated, one text for each."""


class Grading:
    """Grades submissions of one assignment."""

    def __init__(
        self,
        loaded: LoadedAssignment,
        runner: Runner,
        cache: Path,
        *,
        seed: int | None = None,
        first: Collection[str] = (),
        on_recorded: OnRecorded = lambda _record, _recordings: None,
    ) -> None:
        """Set up; the scenarios that are ``first`` are started before the others."""
        self._loaded = loaded
        self._runner = runner
        self._cache = cache
        self._seed = seed
        self._first = first
        self._on_recorded = on_recorded
        self._mistakes: tuple[Mistake, ...] = ()
        self._with_bags = any(True for _ in _needed(loaded, Bags))
        self._libraries = (*loaded.assignment.libraries, *([LIBRARY] if _tested(loaded) else ()))
        check_installed(self._libraries)
        self._build_limits = _build_limits(loaded.assignment.build_limits)
        self._stop = threading.Event()
        self._type_support = TypeSupport(loaded, runner.ros, cache, self._stop)
        self._scenarios = loaded.assignment.scenarios
        # A build takes a CPU or more; too many would only slow down each other.
        self._builds = Admission(cells=cpu_count(), starts=cpu_count())

    def grade(
        self,
        path: Path,
        folder: Path,
        on_build: Callable[[str], None] = lambda _: None,
        name: str | None = None,
        on_output: Callable[[str], None] = lambda _: None,
        given: Mapping[str, str] = MappingProxyType({}),
        source_folder: Path | None = None,
    ) -> Graded:
        """Grade one submission; ``given`` are the roster's values of variables.

        Args:
            source_folder: Where its text files are kept, or None.
        """
        ros = self._type_support.student(on_build)
        if not self._loaded.values:
            self._type_support.prefixes(on_build)
        sandbox = self._runner.sandbox
        if sandbox is not None:
            sandbox = sandbox.allowing(self._libraries)
        outside = tuple(sorted({**self._loaded.given, **given}.items()))

        def tested(record: SubmissionRecord) -> frozenset[str]:
            self._on_recorded(record, {})
            loaded, record, _ = named(self._loaded, replace(record, given=outside))
            return frozenset(one.name for name in _tested(loaded) if (one := record.package(name)))

        how = Preparation(
            ros,
            self._cache,
            limits=self._build_limits,
            on_progress=on_build,
            sandbox=sandbox,
            stop=self._stop,
            on_output=on_output,
            tested=tested,
            source_folder=source_folder,
            with_bags=self._with_bags,
            place=self._build_place,
        )
        prepared = prepare(path, how)
        if name is not None:
            prepared = prepared.named(name)
        prepared = replace(prepared, record=replace(prepared.record, given=outside))
        return self.grade_prepared(prepared, folder)

    def imposing(self, mistakes: tuple[Mistake, ...]) -> Grading:
        """The same, but that mistakes are imposed on the programs: for selftest only."""
        other = copy(self)
        other._mistakes = mistakes
        return other

    @contextmanager
    def _build_place(self, alone: bool) -> Iterator[None]:
        """The place of one build; where it must be alone, no other one runs, and no cell."""
        cells = self._runner.admission.cell(alone=True) if alone else nullcontext()
        with self._builds.cell(alone=alone), cells:
            yield

    @property
    def surroundings(self) -> list[str]:
        """The sandbox that is in force, and what is sourced and not used: a line for each."""
        sandbox = self._runner.sandbox.description if self._runner.sandbox else "none"
        return [f"sandbox: {sandbox}", *filter(None, [self._runner.ros.notice])]

    def close(self) -> None:
        """End every build and cell that runs; what is being graded ends as interrupted."""
        self._stop.set()
        self._runner.close()

    def cancel(self) -> Runner:
        """End every build and cell that runs, as :meth:`close` does."""
        self._stop.set()
        return self._runner.successor()

    def grade_prepared(self, prepared: Prepared, folder: Path) -> Graded:
        """Run and judge a submission that is built already."""
        loaded, record, unnamed = named(self._loaded, prepared.record)
        prepared = replace(prepared, record=record)
        for old in folder.glob("*.mcap"):
            old.unlink()
        write_whole(folder / SUBMISSION_FILE, to_json(prepared.record))
        runs: dict[str, int] = {}
        faults: dict[str, str] = {}
        recordings: dict[str, Recording] = {}
        support = self._type_support
        if loaded is not self._loaded:
            support = TypeSupport(loaded, self._runner.ros, self._cache, self._stop)
        self._on_recorded(prepared.record, {})
        can_run = prepared.install is not None and unnamed is None
        # The longest start first: none of them is left to run alone in the end.
        longest = sorted(self._scenarios, key=lambda scenario: -scenario.timeout)
        again = [scenario.id for scenario in longest] if can_run else []
        alone: list[str] = []
        # What is wrong in what was built is known before any run.
        names = grade(self._loaded, prepared.record, {}).names
        first = 1
        repeats: list[str] = []
        for attempt in range(1, MOST_RUNS + 1):
            run = partial(self._run, loaded, support, prepared, folder, names)
            told = partial(self._on_recorded, prepared.record, recordings)
            self._run_all(run, again, recordings, faults, told, alone=False)
            self._run_all(run, alone, recordings, faults, told, alone=True)
            runs.update((name, runs.get(name, 0) + 1) for name in (*again, *alone))
            result = grade(self._loaded, prepared.record, recordings, faults)
            run_so_far = loaded.assignment.scenarios
            renamed = [
                scenario.id
                for scenario in result.assignment.scenarios
                if scenario not in run_so_far or not result.names[scenario.id] <= names[scenario.id]
            ]
            if attempt < MOST_RUNS and renamed:
                names = {name: known | result.names[name] for name, known in names.items()}
                loaded, _, _ = named(self._loaded, prepared.record, recordings)
                again, alone, first = renamed, [], attempt + 1
                # What is run again for its names is not run again for the machine.
                runs.update(dict.fromkeys(renamed, 0))
                continue
            alone = sorted(
                set(result.disturbed_scenarios(Status.ERROR))
                | {name for name, recording in recordings.items() if recording.faults}
                | set(faults)
            )
            # A failure that happens twice is no accident, and need not be seen on a quiet machine.
            doubtful = result.disturbed_scenarios(Status.FAILED) if attempt == first else ()
            again = [name for name in doubtful if name not in alone]
            if not again and not alone:
                break
            if attempt < MOST_RUNS:
                repeats += [f"{name}, failed on a disturbed machine" for name in again]
                repeats += [
                    f"{name}, {faults.get(name, 'too disturbed').splitlines()[0]}" for name in alone
                ]
        files = {name: folder / f"{name}.mcap" for name in recordings}
        return Graded(
            result,
            prepared,
            recordings,
            files,
            runs,
            faults,
            read_references(self._loaded),
            tuple(repeats),
        )

    def _run_all(
        self,
        run: Callable[[str, bool], Recording],
        names: list[str],
        recordings: dict[str, Recording],
        faults: dict[str, str],
        told: Callable[[], None],
        *,
        alone: bool,
    ) -> None:
        if not names:
            return
        with ThreadPoolExecutor(max_workers=1 if alone else len(names)) as pool:
            try:
                ordered = sorted(names, key=lambda name: name not in self._first)
                futures = {pool.submit(run, name, alone): name for name in ordered}
                for future in as_completed(futures):
                    name = futures[future]
                    faults.pop(name, None)
                    try:
                        recordings[name] = future.result()
                    except GraderFault as fault:
                        faults[name] = str(fault)
                    told()
            except BaseException as error:
                # An interrupt ends all that runs; a bug of rosgrade costs no other run.
                if not isinstance(error, Exception):
                    self._runner.close()
                raise
        # As they lie in their folder, whichever ended first.
        recordings.update({name: recordings.pop(name) for name in sorted(recordings)})

    def _run(
        self,
        loaded: LoadedAssignment,
        support: TypeSupport,
        prepared: Prepared,
        folder: Path,
        names: Mapping[str, Names],
        name: str,
        alone: bool,
    ) -> Recording:
        assert prepared.install is not None
        assignment = loaded.assignment
        scenario = next(item for item in assignment.scenarios if item.id == name)
        file = folder / f"{name}.mcap"
        try:
            request = RunRequest(
                assignment,
                scenario,
                prepared.record,
                prepared.install,
                seed=scenario_seed(assignment.id, name, prepared.record.sha256, self._seed),
                worlds=self._loaded.folder,
                underlays=prepared.underlays,
                type_support=support.prefixes(),
                names=names[name],
                mistakes=self._mistakes,
                pauses=any(
                    bound.parameters.pauses and scenario in loaded.scenarios_of(bound)
                    for bound in loaded.checks
                ),
            )
            self._runner.run(request, file, alone=alone)
            return read_recording(file)
        except UsageError as error:
            raise GraderFault(f"the new recording cannot be read: {error}") from error
        except OSError as error:
            # A full disk, a folder that was removed: it is tried again, and the others go on.
            fault = GraderFault(f"this machine: {str(error)[:_LONGEST_WORDS]}")
            raise machine_fault(error) or fault from error


def _tested(loaded: LoadedAssignment) -> frozenset[str]:
    """The packages whose own tests a check judges."""
    found = _needed(loaded, StudentTests)
    return frozenset(getattr(parameters, need.package) for parameters, need in found)


def _needed(loaded: LoadedAssignment, kind: type[_N]) -> Iterator[tuple[Parameters, _N]]:
    """The needs of one kind that checks have, with the parameters of each check."""
    for bound in loaded.checks:
        for need in bound.parameters.needs:
            if isinstance(need, kind):
                yield bound.parameters, need


def _build_limits(options: BuildLimitOptions) -> BuildLimits:
    room = options.limits()
    limits = BuildLimits(output=OutputLimits(total=room.output_bytes), room=room)
    if options.wall_time is not None:
        limits = replace(limits, python_s=options.wall_time, other_s=options.wall_time)
    return limits
