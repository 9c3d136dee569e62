"""``make soak``: grade the same submissions again and again on a loaded machine.

Without ``N``, a class of 200, references and mutants in random order, while processes load
every CPU in bursts: each grade (see :mod:`grader.report.model.grade_part`) is compared with the one
that the same submission got alone on the machine before. With ``N``, both publisher references
and five mutants ``N`` times each while every CPU is busy all the time: each verdict is compared
with the one that the submission must get.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from grader import ros
from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.mutation import reference_of
from grader.batch.grading import Grading
from grader.batch.selftest import REFERENCE, Role, Trial, TrialResult, run_trial, trials
from grader.report.model.grade_part import differences
from grader.resources import cache_folder
from grader.run.admission import Admission
from grader.run.host.load import cpu_count
from grader.run.runner import Runner
from grader.sandbox.choice import Choice
from grader.sandbox.trial import choose
from grader.scratch import Scratch

SUBMISSIONS = {
    "simple_publisher": (REFERENCE, "publishes_twice", "topic_misspelt"),
    "timed_publisher": (REFERENCE, "period_30_ms", "sleeps_in_main", "best_effort"),
}
"""Assignment -> what is graded: both references and five mutants."""
_BURST_S = (0.3, 3.0)
_PAUSE_S = (0.3, 3.0)
_TOLD_EACH = 10


@dataclass(frozen=True)
class Job:
    """One submission to grade over and over.

    Attributes:
        alone: The grade that it got alone on the machine, or None for the verdict that it must
            get.
    """

    loaded: LoadedAssignment
    grading: Grading
    trial: Trial
    reference: Path
    alone: str | None = None

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.loaded.assignment.id}/{self.trial.id}"


def main() -> int:
    """Run the soak; 0 if no verdict changed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, help="runs of each of seven submissions")
    parser.add_argument("--students", type=int, default=200, help="size of the class")
    parser.add_argument(
        "--different", type=int, default=25, help="of the class; the others are copies of them"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the class and of the bursts")
    parser.add_argument("--sandbox", type=Choice, default=Choice.AUTO)
    parser.add_argument("--calm", action="store_true", help="do not load the CPUs")
    options = parser.parse_args()
    sandbox, notice = choose(options.sandbox, cache_folder())
    if notice:
        print(notice, file=sys.stderr)
    with Runner(ros.find(), Admission(), sandbox=sandbox) as runner:
        if options.runs:
            queue = _jobs(runner, SUBMISSIONS) * options.runs
        else:
            queue = _class(runner, options.students, options.different, options.seed)
        bursts = None if options.runs else options.seed
        began_s = time.monotonic()
        with _load(0 if options.calm else cpu_count(), bursts):
            results = _grade_all(queue, 8 * cpu_count())
    return _summary(results, time.monotonic() - began_s)


def _jobs(runner: Runner, wanted: Mapping[str, Sequence[str]]) -> list[Job]:
    found = []
    for name, ids in wanted.items():
        loaded = load_assignment(name)
        grading = Grading(loaded, runner, cache_folder())
        by_id = {trial.id: trial for trial in trials(loaded)}
        found += [Job(loaded, grading, by_id[i], reference_of(name)) for i in ids]
    return found


def _class(runner: Runner, students: int, different: int, seed: int) -> list[Job]:
    """A class in random order, each of it graded alone before."""
    order = random.Random(seed)
    wanted: dict[str, list[str]] = {}
    for name in SUBMISSIONS:
        wanted[name] = [REFERENCE]
        wanted[name] += [t.id for t in trials(load_assignment(name)) if t.role is Role.MUTANT]
    everything = [(name, i) for name, ids in wanted.items() for i in ids[1:]]
    chosen = order.sample(everything, max(0, different - len(wanted)))
    picked = {name: [REFERENCE, *(i for n, i in chosen if n == name)] for name in wanted}
    alone = []
    for job in _jobs(runner, picked):
        graded = _grade_all([job], 1)
        if not graded:
            sys.exit("interrupted before the class began")
        ((_, result),) = graded
        alone.append(replace(job, alone=result.grade))
        lost = ", ".join(result.lost) or "full points" if result.graded else "not graded"
        print(
            f"alone: {len(alone)} of {different}, {job.name}: {lost}", file=sys.stderr, flush=True
        )
    queue = [alone[number % len(alone)] for number in range(students)]
    order.shuffle(queue)
    return queue


@contextmanager
def _load(cpus: int, seed: int | None) -> Iterator[None]:
    """Load CPUs, all the time or, with a seed, in bursts."""
    burners = [
        multiprocessing.get_context("spawn").Process(
            target=_burn, args=(None if seed is None else seed + number,), daemon=True
        )
        for number in range(cpus)
    ]
    for burner in burners:
        burner.start()
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()


def _burn(seed: int | None) -> None:
    order = random.Random(seed)
    parent = os.getppid()
    # Whoever is left behind by a soak that was killed would burn for ever.
    while os.getppid() == parent:
        until_s = time.monotonic() + order.uniform(*_BURST_S)
        while time.monotonic() < until_s:
            pass
        if seed is not None:
            time.sleep(order.uniform(*_PAUSE_S))


def _grade_all(queue: Sequence[Job], at_once: int) -> list[tuple[Job, TrialResult]]:
    results = []
    began_s = time.monotonic()
    with (
        Scratch("soak") as folder,
        ThreadPoolExecutor(max_workers=at_once) as pool,
    ):
        futures = {
            pool.submit(_grade_once, job, folder / f"{job.trial.id}-{number}"): job
            for number, job in enumerate(queue)
        }
        try:
            for future in as_completed(futures):
                job, result = futures[future], future.result()
                results.append((job, result))
                for difference in _differences(job, result):
                    print(f"{job.name}: {difference}", flush=True)
                if len(results) % _TOLD_EACH == 0:
                    rate = len(results) / (time.monotonic() - began_s)
                    left_s = (len(futures) - len(results)) / rate
                    print(
                        f"{len(results)} of {len(futures)} graded, {60 * rate:.0f} a minute, "
                        f"{left_s:.0f} s left",
                        file=sys.stderr,
                        flush=True,
                    )
        except KeyboardInterrupt:
            # What is finished still counts.
            pool.shutdown(wait=False, cancel_futures=True)
            for job in queue:
                job.grading.close()
    return results


def _grade_once(job: Job, folder: Path) -> TrialResult:
    return run_trial(job.trial, job.loaded, job.grading, job.reference, folder)


def _differences(job: Job, result: TrialResult) -> list[str]:
    if job.alone is None:
        return [str(difference) for difference in result.verdict.differences]
    return differences(job.alone, result.grade)


def _summary(results: list[tuple[Job, TrialResult]], wall_s: float) -> int:
    runs: Counter[str] = Counter()
    changed: Counter[str] = Counter()
    errors: Counter[str] = Counter()
    again: Counter[str] = Counter()
    for job, result in results:
        runs[job.name] += 1
        changed[job.name] += bool(_differences(job, result))
        errors[job.name] += not result.graded
        again[job.name] += result.repeated
    print(f"{'submission':<40} {'runs':>5} {'changed':>8} {'errors':>7} {'run again':>10}")
    for name in sorted(runs):
        print(f"{name:<40} {runs[name]:>5} {changed[name]:>8} {errors[name]:>7} {again[name]:>10}")
    total = sum(changed.values())
    print(
        f"{len(results)} grades in {wall_s:.0f} s: {total} changed, {sum(errors.values())} not "
        f"graded, {sum(again.values())} run again"
    )
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
