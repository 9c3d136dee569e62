"""``make soak``: grade a class on a loaded machine, and look for a grade that changes.

The class is made of references and mutants in random order, in Python and, where rclcpp is there,
in C++. Each is built while processes load every CPU, in bursts or all the time. Each grade (see
:mod:`grader.report.model.result`) is compared with the one that the same submission got alone
on the machine before.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.reference import CPP, PYTHON, Language, reference_of
from grader.authoring.mutants.selftest import Role, Setup, Trial, TrialResult, run_trial, trials
from grader.grading.grading import Grading
from grader.machine import ros
from grader.machine.load import cpu_count
from grader.machine.resources import UNDERLAYS, cache_folder
from grader.machine.scratch import Scratch
from grader.report.model.result import differences
from grader.run.admission import Admission
from grader.run.runner import Runner
from grader.sandbox.choice import Choice
from grader.sandbox.trial import choose
from grader.submission.underlay.definition import find_underlay
from grader.submission.underlay.store import UnderlayStore

ASSIGNMENTS = ("simple_publisher", "timed_publisher", "bot_controller", "p_controller")
_BURST_S = _PAUSE_S = (0.3, 3.0)


@dataclass(frozen=True)
class Job:
    """One submission to grade over and over.

    Attributes:
        alone: The grade that it got alone on the machine; empty until then.
    """

    loaded: LoadedAssignment
    grading: Grading
    trial: Trial
    language: Language
    alone: str = ""

    @property
    def name(self) -> str:
        """Assignment and trial."""
        language = "C++" if self.language is CPP else "Python"
        return f"{self.loaded.assignment.id}/{self.trial.id} in {language}"

    def grade(self, folder: Path) -> TrialResult:
        """Grade it into a new folder."""
        reference = reference_of(self.loaded.assignment.id, language=self.language)
        setup = Setup(self.loaded, self.grading, reference, self.language)
        return run_trial(self.trial, setup, folder)


def main() -> int:
    """Run the soak; 0 if no grade changed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--students", type=int, default=200, help="size of the class")
    parser.add_argument(
        "--different", type=int, default=25, help="of the class; the others are copies of them"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the class and of the bursts")
    parser.add_argument("--sandbox", type=Choice, default=Choice.AUTO)
    parser.add_argument("--calm", action="store_true", help="do not load the CPUs")
    parser.add_argument(
        "--load", type=int, default=0, help="busy processes at any time, instead of bursts"
    )
    options = parser.parse_args()
    sandbox, notice = choose(options.sandbox, cache_folder())
    if notice:
        print(notice, file=sys.stderr)
    with (
        Runner(ros.find(), Admission(), sandbox=sandbox) as runner,
        Scratch("soak-cache") as cache,
    ):
        # Nothing is built in there yet, so the class is built under load.
        (cache / UNDERLAYS).symlink_to(cache_folder() / UNDERLAYS)
        known, new = (
            _jobs(runner, folder, options.different, random.Random(options.seed))
            for folder in (cache_folder(), cache)
        )
        grades = _graded_alone(known)
        jobs = [replace(job, alone=alone) for job, alone in zip(new, grades, strict=True)]
        queue = [jobs[number % len(jobs)] for number in range(options.students)]
        random.Random(options.seed).shuffle(queue)
        began_s = time.monotonic()
        busy = 0 if options.calm else options.load or cpu_count()
        with _load(busy, options.seed, (0.0, 0.0) if options.load else _PAUSE_S):
            results = _grade_all(queue, 8 * cpu_count())
    return _summary(results, time.monotonic() - began_s)


def _jobs(runner: Runner, cache: Path, different: int, order: random.Random) -> list[Job]:
    """The references, and mutants drawn from all of them."""
    references, mutants = [], []
    store = UnderlayStore(cache_folder(), runner.ros)
    languages = [PYTHON] if store.missing([find_underlay("rclcpp")]) else [PYTHON, CPP]
    for name, language in product(ASSIGNMENTS, languages):
        loaded = load_assignment(name)
        grading = Grading(loaded, runner, cache)
        for trial in trials(loaded, language):
            if trial.role is Role.REFERENCE:
                references.append(Job(loaded, grading, trial, language))
            elif trial.role is Role.MUTANT:
                mutants.append(Job(loaded, grading, trial, language))
    return references + order.sample(mutants, max(0, different - len(references)))


def _graded_alone(jobs: Sequence[Job]) -> list[str]:
    found = []
    with Scratch("soak") as folder:
        for number, job in enumerate(jobs, start=1):
            result = job.grade(folder / str(number))
            found.append(result.grade)
            lost = ", ".join(result.lost) or "full points" if result.graded else "not graded"
            print(
                f"alone: {number} of {len(jobs)}, {job.name}: {lost}", file=sys.stderr, flush=True
            )
    return found


@contextmanager
def _load(processes: int, seed: int, pause_s: tuple[float, float]) -> Iterator[None]:
    burners = [
        multiprocessing.get_context("spawn").Process(
            target=_burn, args=(seed + number, pause_s), daemon=True
        )
        for number in range(processes)
    ]
    for burner in burners:
        burner.start()
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()


def _burn(seed: int, pause_s: tuple[float, float]) -> None:
    order = random.Random(seed)
    parent = os.getppid()
    # It must not outlive a soak that was killed.
    while os.getppid() == parent:
        until_s = time.monotonic() + order.uniform(*_BURST_S)
        while time.monotonic() < until_s:
            pass
        time.sleep(order.uniform(*pause_s))


def _grade_all(queue: Sequence[Job], at_once: int) -> list[tuple[Job, TrialResult]]:
    results = []
    with Scratch("soak") as folder, ThreadPoolExecutor(max_workers=at_once) as pool:
        futures = {
            pool.submit(job.grade, folder / str(number)): job for number, job in enumerate(queue)
        }
        try:
            for future in as_completed(futures):
                job, result = futures[future], future.result()
                results.append((job, result))
                for difference in differences(job.alone, result.grade):
                    print(f"{job.name}: {difference}", flush=True)
                if len(results) % 10 == 0:
                    print(f"{len(results)} of {len(futures)} graded", file=sys.stderr, flush=True)
        except KeyboardInterrupt:
            # What is finished still counts.
            pool.shutdown(wait=False, cancel_futures=True)
            for job in queue:
                job.grading.close()
    return results


def _summary(results: list[tuple[Job, TrialResult]], wall_s: float) -> int:
    changed = Counter(j.name for j, result in results if differences(j.alone, result.grade))
    for name, times in changed.most_common():
        print(f"{name}: changed {times} times")
    print(
        f"{len(results)} grades in {wall_s:.0f} s: {changed.total()} changed, "
        f"{sum(not result.graded for _, result in results)} not graded, "
        f"{sum(result.repeated for _, result in results)} run again"
    )
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
