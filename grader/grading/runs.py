"""The runs of one submission: made side by side, and judged together."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

from grader.assignment.bag import BagOptions
from grader.assignment.model import Scenario
from grader.errors import GraderFault, UsageError, machine_fault
from grader.findings.finding import Status
from grader.grade import Grade, judge_all
from grader.grade.bags import chosen_bag, same_bags
from grader.grade.naming import with_chosen_names
from grader.grading.graded import SUBMISSION_FILE, Graded
from grader.grading.grading import Grading
from grader.grading.next_runs import Round, Run, times_run
from grader.grading.reference_run import read_references
from grader.recording.mcap_reader import read_recording
from grader.recording.model import Recording, to_json
from grader.recording.submission import BagRecord, SubmissionRecord
from grader.report.files import write_whole
from grader.run.from_bag import BagOrder, record_bag
from grader.run.request import RunRequest, scenario_seed
from grader.submission.prepare import Prepared

_LONGEST_WORDS = 300


class Runs:
    """Runs of a submission that is built, with their recordings in a folder."""

    def __init__(self, grading: Grading, prepared: Prepared, folder: Path) -> None:
        """Set up, and note what was handed in; recordings of before are gone then."""
        named = with_chosen_names(grading.loaded, prepared.record)
        self._loaded = named.loaded
        self._grading = grading
        self._support = grading.type_support_of(self._loaded, named.submission)
        self._prepared = replace(prepared, record=named.submission)
        self._folder = folder
        self._can_run = prepared.install is not None and all(one.can_run for one in named.unnamed)
        self._recordings: dict[str, Recording] = {}
        self._faults: dict[str, str] = {}
        self._grade: Grade
        for recording in folder.glob("*.mcap"):
            recording.unlink()
        write_whole(folder / SUBMISSION_FILE, to_json(self._record))
        self._tell()

    def make(self, runs: Sequence[Run]) -> None:
        """Make some runs at once, and then those that want to be alone."""
        first = self._grading.first
        together = [run for run in runs if not run.alone]
        self._make(sorted(together, key=lambda run: run.scenario.id not in first), len(together))
        self._make([run for run in runs if run.alone], 1)

    def judge(self, runs: Sequence[Run]) -> Round:
        """Judge all that is recorded by now, and say what is known after some runs, the last."""
        grade = self._grade = judge_all(
            self._grading.loaded, self._record, self._recordings, self._faults
        )
        # Some names that students choose, such as that of a service, show only in a run.
        if grade.loaded.values != self._loaded.values:
            self._support = self._grading.type_support_of(grade.loaded, self._record)
        self._loaded = grade.loaded
        return Round(
            scenarios=tuple(filter(self._is_to_run, self._loaded.assignment.scenarios)),
            runs=runs,
            names=grade.names,
            undecided=self._undecided(grade),
            doubtful=grade.disturbed_scenarios(Status.FAILED),
        )

    def _undecided(self, grade: Grade) -> dict[str, str]:
        """By scenario, why it could not be judged, in one line."""
        disturbed = grade.disturbed_scenarios(Status.ERROR)
        faulty = [name for name, recording in self._recordings.items() if recording.faults]
        return {
            name: self._faults.get(name, "too disturbed").partition("\n")[0]
            for name in (*disturbed, *faulty, *self._faults)
        }

    def graded(self, rounds: Sequence[Round]) -> Graded:
        """The grade after all rounds."""
        every = [run for one in rounds for run in one.runs]
        return Graded(
            grade=self._grade,
            prepared=self._prepared,
            recordings=self._recordings,
            files={name: self._file(name) for name in self._recordings},
            runs=times_run(rounds),
            references=read_references(self._grading.loaded),
            repeats=tuple(f"{run.scenario.id}, {run.why}" for run in every if run.why),
        )

    @property
    def _record(self) -> SubmissionRecord:
        return self._prepared.record

    def _is_to_run(self, scenario: Scenario) -> bool:
        """Whether there is what a scenario needs: something that was built, or a bag."""
        if scenario.bag is None:
            return self._can_run
        return isinstance(chosen_bag(scenario.bag, scenario.id, self._record), BagRecord)

    def _file(self, name: str) -> Path:
        return self._folder / f"{name}.mcap"

    def _tell(self) -> None:
        self._grading.told.recorded(self._record, self._recordings)

    def _make(self, runs: Sequence[Run], at_once: int) -> None:
        if not runs:
            return
        with ThreadPoolExecutor(max_workers=at_once) as pool:
            try:
                futures = {pool.submit(self._run, run): run.scenario.id for run in runs}
                for future in as_completed(futures):
                    name = futures[future]
                    self._faults.pop(name, None)
                    try:
                        self._recordings[name] = future.result()
                    except GraderFault as fault:
                        self._faults[name] = str(fault)
                    self._tell()
            except BaseException as error:
                # An interrupt ends all that runs; a bug of rosgrade costs no other run.
                if not isinstance(error, Exception):
                    self._grading.runner.close()
                raise
        # As they lie in their folder, whichever ended first.
        self._recordings = {name: self._recordings[name] for name in sorted(self._recordings)}

    def _read_bag(self, options: BagOptions, scenario: Scenario, file: Path) -> None:
        bag = chosen_bag(options, scenario.id, self._record)
        assert isinstance(bag, BagRecord)
        ros, install = self._grading.runner.ros, self._prepared.install
        prefixes = self._support.prefixes(self._grading.told.progress)
        order = BagOrder(
            self._loaded.assignment.id,
            scenario,
            self._record,
            bag,
            self._prepared.bags[bag.path],
            # rosgrade's own definition comes before one of the student's.
            (*prefixes, *ros.underlays, *ros.prefixes, *([install] if install else [])),
            same_bags(bag, self._record),
        )
        record_bag(order, file)

    def _run(self, run: Run) -> Recording:
        scenario, file = run.scenario, self._file(run.scenario.id)
        try:
            if scenario.bag is not None:
                self._read_bag(scenario.bag, scenario, file)
            else:
                self._grading.runner.run(self._request(run), file, alone=run.alone)
            return read_recording(file)
        except UsageError as error:
            raise GraderFault(f"the new recording cannot be read: {error}") from error
        except OSError as error:
            # A full disk, a folder that was removed: it is tried again, and the others go on.
            fault = GraderFault(f"this machine: {str(error)[:_LONGEST_WORDS]}")
            raise machine_fault(error) or fault from error

    def _request(self, run: Run) -> RunRequest:
        loaded, scenario, grading = self._loaded, run.scenario, self._grading
        assert self._prepared.install is not None
        seed = scenario_seed(loaded.assignment.id, scenario.id, self._record.sha256, grading.seed)
        judging = [bound for bound in loaded.checks if scenario in loaded.scenarios_of(bound)]
        return RunRequest(
            loaded.assignment,
            scenario,
            self._record,
            self._prepared.install,
            seed=seed,
            worlds=loaded.folder,
            underlays=self._prepared.underlays,
            type_support=self._support.prefixes(grading.told.progress),
            names=run.names,
            mistakes=grading.mistakes,
            pauses=any(bound.parameters.pauses for bound in judging),
        )
