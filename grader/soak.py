"""``make soak``: grade the same submissions again and again on a loaded machine.

Every CPU is kept busy by a process of its own; a verdict (the status of every check) that
differs from the one that the submission must get is counted.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from grader import ros
from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.mutation import reference_of
from grader.batch.grading import Grading
from grader.batch.selftest import REFERENCE, Trial, TrialResult, run_trial, trials
from grader.cli.console import cache_folder
from grader.run.admission import Admission, cpu_count
from grader.run.runner import Runner

SUBMISSIONS = {
    "simple_publisher": (REFERENCE, "publishes_twice", "topic_misspelt"),
    "timed_publisher": (REFERENCE, "period_30_ms", "sleeps_in_main", "best_effort"),
}
"""Assignment -> what is graded: both references and five mutants."""


@dataclass(frozen=True)
class Job:
    """One submission to grade over and over."""

    loaded: LoadedAssignment
    grading: Grading
    trial: Trial
    reference: Path

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.loaded.assignment.id}/{self.trial.id}"


def _burn() -> None:
    while True:
        pass


def _jobs(runner: Runner) -> list[Job]:
    found = []
    for name, wanted in SUBMISSIONS.items():
        loaded = load_assignment(name)
        grading = Grading(loaded, runner, cache_folder())
        by_id = {trial.id: trial for trial in trials(loaded)}
        found += [Job(loaded, grading, by_id[i], reference_of(name)) for i in wanted]
    return found


def main() -> int:
    """Run the soak; 0 if no verdict changed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="runs of each submission")
    parser.add_argument("--jobs", type=int, default=2 * cpu_count(), help="submissions at once")
    parser.add_argument("--calm", action="store_true", help="do not load the CPUs")
    options = parser.parse_args()
    burners = [
        multiprocessing.Process(target=_burn, daemon=True)
        for _ in range(0 if options.calm else cpu_count())
    ]
    jobs = _jobs(Runner(ros.find(), Admission(cells=options.jobs)))
    for burner in burners:
        burner.start()
    began_s = time.monotonic()
    try:
        results = _grade_all(jobs, options.runs, options.jobs)
    finally:
        for burner in burners:
            burner.kill()
    return _summary(results, time.monotonic() - began_s)


def _grade_all(jobs: list[Job], runs: int, at_once: int) -> list[tuple[Job, TrialResult]]:
    results = []
    with (
        tempfile.TemporaryDirectory(prefix="rosgrade-soak-") as name,
        ThreadPoolExecutor(max_workers=at_once) as pool,
    ):
        futures = {
            pool.submit(_grade_once, job, Path(name) / f"{job.trial.id}-{number}"): job
            for number in range(runs)
            for job in jobs
        }
        try:
            for future in as_completed(futures):
                job, result = futures[future], future.result()
                results.append((job, result))
                for difference in result.verdict.differences:
                    print(f"{job.name}: {difference}", flush=True)
                if len(results) % 50 == 0:
                    print(f"{len(results)} of {len(futures)} graded", file=sys.stderr, flush=True)
        except KeyboardInterrupt:
            # What is finished still counts.
            pool.shutdown(wait=False, cancel_futures=True)
            for job in jobs:
                job.grading.abort()
    return results


def _grade_once(job: Job, folder: Path) -> TrialResult:
    return run_trial(job.trial, job.loaded, job.grading, job.reference, folder)


def _summary(results: list[tuple[Job, TrialResult]], wall_s: float) -> int:
    runs: Counter[str] = Counter()
    changed: Counter[str] = Counter()
    errors: Counter[str] = Counter()
    again: Counter[str] = Counter()
    for job, result in results:
        runs[job.name] += 1
        changed[job.name] += not result.verdict.right
        errors[job.name] += not result.graded.grade.graded
        again[job.name] += any(count > 1 for count in result.graded.runs.values())
    print(f"{'submission':<40} {'runs':>5} {'changed':>8} {'errors':>7} {'run again':>10}")
    for name in sorted(runs):
        print(f"{name:<40} {runs[name]:>5} {changed[name]:>8} {errors[name]:>7} {again[name]:>10}")
    total = sum(changed.values())
    print(f"{len(results)} grades in {wall_s:.0f} s: {total} verdicts changed")
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
