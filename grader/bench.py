"""``make bench``: what rosgrade costs beyond the time that a scenario needs.

Prints a table and writes ``rosgrade-bench.json``. Quote medians; compare only figures of one
run on one machine.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import TypeVar

from grader import ros
from grader.assignment.load import load_assignment
from grader.assignment.mutation import reference_of
from grader.batch.files import write_graded
from grader.batch.grading import RECORDINGS_FOLDER, Graded, Grading
from grader.batch.regrading import find, regrade
from grader.batch.rendering import render_all
from grader.grade import grade
from grader.recording.mcap_reader import read_recording
from grader.recording.model import NS, Recording
from grader.report.files import write_whole
from grader.report.html.overview import render_overview
from grader.report.html.report import render_report
from grader.report.model.class_row import ClassRow
from grader.report.model.facts import Clock, RunFacts
from grader.report.model.result import make_result
from grader.run.admission import Admission
from grader.run.cell.domain import lock_domain
from grader.run.host.load import cpu_count
from grader.run.runner import Runner
from grader.sandbox.choice import Choice
from grader.sandbox.trial import choose
from grader.submission.build.build_cache import BUILDS
from grader.submission.prepare import Prepared, prepare

ASSIGNMENT = "timed_publisher"
CLASS = 100
ROBOT_ASSIGNMENTS = ("bot_controller", "p_controller")
SUBMISSIONS = 500
_RENDERED = 50
_FEW = 3
_TOLD_EACH = 20
_SERIAL = 10
"""Submissions that are graded one after the other."""
OUTPUT = Path("rosgrade-bench.json")
_PLAIN_TEST = """
import signal, subprocess, sys
import rclpy
from geometry_msgs.msg import Twist

rclpy.init()
node = rclpy.create_node("plain_test")
heard = []
node.create_subscription(Twist, "/cmd_vel", heard.append, 10)
program = subprocess.Popen(sys.argv[2:])
while len(heard) < int(sys.argv[1]):
    rclpy.spin_once(node, timeout_sec=0.1)
program.send_signal(signal.SIGINT)
program.wait()
rclpy.shutdown()
"""
"""What a course without an autograder would write; argv: how many messages, the program."""
T = TypeVar("T")


class Samples:
    """Figures of one kind each, over all runs."""

    def __init__(self) -> None:
        """Start empty."""
        self.values: dict[str, list[float]] = {}

    def add(self, name: str, value: float) -> None:
        """Add one figure."""
        self.values.setdefault(name, []).append(value)

    def timed(self, name: str, work: Callable[[], T]) -> T:
        """Add the wall time of some work, in seconds."""
        began_s = time.monotonic()
        result = work()
        self.add(name, time.monotonic() - began_s)
        return result

    def summary(self) -> dict[str, dict[str, float]]:
        """Minimum, median and maximum of each figure."""
        return {
            name: {"min": min(values), "median": median(values), "max": max(values)}
            for name, values in self.values.items()
        }


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="of a single grade")
    parser.add_argument("--only", choices=sorted(MEASUREMENTS), action="append")
    options = parser.parse_args()
    # A user's Python keeps what it compiled; without that, each start would compile all of us.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    samples = Samples()
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="rosgrade-bench-") as name:
        for what in options.only or MEASUREMENTS:
            passed_s = time.monotonic() - began_s
            print(f"{passed_s:4.0f} s: measuring {what}", file=sys.stderr, flush=True)
            MEASUREMENTS[what](samples, Path(name), options.runs)
    summary = samples.summary()
    print(f"{'figure (s, or a ratio)':<56} {'min':>9} {'median':>9} {'max':>9}")
    for figure, row in summary.items():
        print(f"{figure:<56} {row['min']:>9.6f} {row['median']:>9.6f} {row['max']:>9.6f}")
    write_whole(OUTPUT, json.dumps({"runs": options.runs, "figures": summary}, indent=2) + "\n")
    print(f"written to {OUTPUT}")
    return 0


def _single(samples: Samples, folder: Path, runs: int) -> None:
    """One grade: its steps, and the whole of it as a user runs it."""
    with Runner(ros.find()) as runner:
        for _ in range(runs):
            _parts(samples, folder, runner)
            _whole(samples, folder, "warm")
    for _ in range(_FEW):
        _whole(samples, folder, "cold")


def _parts(samples: Samples, folder: Path, runner: Runner) -> None:
    """The steps of one grade, in this process, with a build of its own."""
    loaded = load_assignment(ASSIGNMENT)
    cache = folder / "cold-cache"
    shutil.rmtree(cache, ignore_errors=True)
    reference = reference_of(ASSIGNMENT)
    samples.timed("build, cold", lambda: prepare(reference, runner.ros, cache=cache))
    prepared = samples.timed("build, cached", lambda: prepare(reference, runner.ros, cache=cache))
    grading = Grading(loaded, runner, cache)
    before_s = runner.cpu_s
    graded = samples.timed(
        "run and judge", lambda: grading.grade_prepared(prepared, folder / "recordings")
    )
    samples.add("run: CPU of the cell and the student in it", runner.cpu_s - before_s)
    for scenario, file in graded.files.items():
        recording = samples.timed("judge: read the recording", partial(read_recording, file))
        recordings = {scenario: recording}
        samples.timed("judge: all checks", partial(grade, loaded, prepared.record, recordings))
        matched_ns = recording.matched_ns or recording.stop_ns
        samples.add("start: launch to first match", (matched_ns - recording.launched_ns) / NS)
        samples.add("observe: first match to SIGINT", (recording.stop_ns - matched_ns) / NS)
        samples.add("stop: SIGINT to the end", (recording.end_ns - recording.stop_ns) / NS)
    samples.timed("report", lambda: write_graded(graded, folder / "report", Clock()))


def _batch(samples: Samples, folder: Path, _: int) -> None:
    """A class of one and the same submission, all at once and one after the other.

    In the sandbox, as `rosgrade batch` does it, where this machine has one; and the same run by a
    plain test program.
    """
    loaded = load_assignment(ASSIGNMENT)
    cache = folder / "batch-cache"
    sandbox, notice = choose(Choice.AUTO, cache)
    if notice:
        print(notice, file=sys.stderr)
    prepared = prepare(reference_of(ASSIGNMENT), ros.find(), cache=cache, sandbox=sandbox)
    rates: list[float] = []
    for name, count, jobs in (("all at once", CLASS, None), ("one after the other", _SERIAL, 1)):
        with Runner(ros.find(), Admission(cells=jobs), sandbox=sandbox) as runner:
            grading = Grading(loaded, runner, cache)
            work = partial(_grade_into, grading, prepared, folder / "class")
            with ThreadPoolExecutor(max_workers=runner.admission.most) as pool:
                work(0)
                before_s, own_s = runner.cpu_s, time.process_time()
                machine_s = _machine_cpu_s()
                began_s = time.monotonic()
                futures = [pool.submit(work, number) for number in range(count)]
                done_s: list[float] = []
                for future in as_completed(futures):
                    future.result()
                    done_s.append(time.monotonic() - began_s)
                    if len(done_s) % _TOLD_EACH == 0:
                        print(f"{name}: {len(done_s)} of {count}", file=sys.stderr, flush=True)
                wall_s = done_s[-1]
            machine_s = _machine_cpu_s() - machine_s
            cpu_s = runner.cpu_s - before_s + time.process_time() - own_s
        rates.append(60 * count / wall_s)
        samples.add(f"batch, {name}: submissions per minute", rates[-1])
        samples.add(f"batch, {name}: CPU of each", cpu_s / count)
        share = cpu_s / cpu_count() / wall_s
        samples.add(f"batch, {name}: share of what the CPUs bound", share)
        # With what the kernel does for a sandbox in threads of its own, and with all others' load.
        busy = machine_s / cpu_count() / wall_s
        samples.add(f"batch, {name}: share of the CPUs in use on the machine", busy)
        # In the first and the last seconds of a class too few are under way to fill the CPUs.
        first, last = count // 4, count - count // 4
        middle = 60 * (last - first) / (done_s[last] - done_s[first])
        samples.add(f"batch, {name}: per minute, its middle half", middle)
        samples.add(
            f"batch, {name}: share of the CPUs, its middle half", share * middle / rates[-1]
        )
    plain_s = median(_plain(samples, prepared) for _ in range(_SERIAL))
    samples.add("batch: times our own rate of one after the other", rates[0] / rates[1])
    samples.add("batch: times the rate of the plain test program", rates[0] * plain_s / 60)


def _machine_cpu_s() -> float:
    """CPU time of the whole machine since it started, in seconds: see proc_stat(5)."""
    user, nice, system, _idle, _iowait, irq, softirq, steal = map(
        int, Path("/proc/stat").read_text().split()[1:9]
    )
    ticks = user + nice + system + irq + softirq + steal
    return ticks / os.sysconf("SC_CLK_TCK")


def _plain(samples: Samples, prepared: Prepared) -> float:
    """Start the student's program, wait for what the assignment waits for, and stop it.

    Returns:
        Wall time in seconds.
    """
    found = ros.find()
    (until,) = (scenario.until for scenario in load_assignment(ASSIGNMENT).assignment.scenarios)
    assert prepared.install is not None
    (program,) = prepared.install.glob("lib/bot_publisher/bot_pub")
    command = [str(found.python), "-c", _PLAIN_TEST, str(until.messages), str(program)]
    with lock_domain() as domain:
        environment = found.environment(os.environ, (prepared.install,))
        environment["ROS_DOMAIN_ID"] = str(domain.domain_id)
        began_s = time.monotonic()
        process = subprocess.Popen(command, env=environment)
        _, status, usage = os.wait4(process.pid, 0)
        wall_s = time.monotonic() - began_s
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"the plain test program ended with {process.returncode}")
    samples.add("plain test program: wall", wall_s)
    samples.add("plain test program: CPU", usage.ru_utime + usage.ru_stime)
    return wall_s


def _grade_into(grading: Grading, prepared: Prepared, folder: Path, number: int) -> None:
    own = folder / str(number)
    clock = Clock()
    write_graded(grading.grade_prepared(prepared, own / RECORDINGS_FOLDER), own, clock)


def _simulator(samples: Samples, _folder: Path, _: int) -> None:
    """What share of a core the simulator takes in real time."""
    from sim.benchmark import share_of_core

    for _ in range(_FEW):
        with lock_domain() as domain:
            share = share_of_core(domain_id=domain.domain_id)
        samples.add("simulator: share of a core at real time, 100 segments", share)


def _robots(samples: Samples, folder: Path, _: int) -> None:
    for name in ROBOT_ASSIGNMENTS:
        _robot(samples, name, folder)


def _robot(samples: Samples, name: str, folder: Path) -> None:
    """Wall time of a robot assignment against the least time that its physics needs."""
    loaded = load_assignment(name)
    prepared = prepare(reference_of(name), ros.find(), cache=folder / "robot-cache")
    for _ in range(_FEW):
        with Runner(ros.find()) as runner:
            grading = Grading(loaded, runner, folder / "robot-cache")
            began_s = time.monotonic()
            graded = grading.grade_prepared(prepared, folder / name / RECORDINGS_FOLDER)
            samples.add(f"{name}: wall, all scenarios at once", time.monotonic() - began_s)
        least_s = max(_least_s(recording) for recording in graded.recordings.values())
        samples.add(f"{name}: least time of the longest scenario", least_s)
        samples.timed(f"{name}: HTML report with replays", partial(_report, graded))
        samples.timed(
            f"{name}: {_RENDERED} HTML reports on all CPUs", partial(_on_all_cpus, graded)
        )
    write_graded(graded, folder / name, Clock())
    folders = [folder / name] * _RENDERED
    samples.timed(
        f"{name}: {_RENDERED} HTML reports, judged again", lambda: list(render_all(folders))
    )


def _on_all_cpus(graded: Graded) -> None:
    """Render reports in as many processes as there are CPUs."""
    count = cpu_count()
    shares = [len(range(first, _RENDERED, count)) for first in range(count)]
    context = multiprocessing.get_context("fork")
    workers = [context.Process(target=_reports, args=(graded, share)) for share in shares]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
        if worker.exitcode:
            raise SystemExit(f"rendering ended with {worker.exitcode}")


def _reports(graded: Graded, count: int) -> None:
    for _ in range(count):
        _report(graded)


def _class(samples: Samples, folder: Path, _: int) -> None:
    """Render what a class gets, from recordings of one submission."""
    loaded = load_assignment(ASSIGNMENT)
    prepared = prepare(reference_of(ASSIGNMENT), ros.find(), cache=folder / "class-cache")
    with Runner(ros.find()) as runner:
        grading = Grading(loaded, runner, folder / "class-cache")
        grading.grade_prepared(prepared, folder / "one" / RECORDINGS_FOLDER)
    found = find(folder / "one")
    graded = regrade(loaded, found)
    facts = RunFacts(Clock().started, 0.0)
    result = make_result(graded.grade, graded.recordings, facts)
    rows = [ClassRow(f"student {i}", "", f"{i}/report.html", result) for i in range(SUBMISSIONS)]

    def render() -> None:
        for _ in rows:
            _report(graded)
        render_overview(rows)

    samples.timed(f"HTML reports of {SUBMISSIONS} submissions, with the overview", render)
    samples.timed(f"overview of {SUBMISSIONS} submissions", lambda: render_overview(rows))


def _report(graded: Graded) -> str:
    facts = RunFacts(Clock().started, 0.0)
    return render_report(graded.grade, graded.recordings, facts, graded.references)


def _least_s(recording: Recording) -> float:
    """Time for the way and the turns of a run at the greatest speeds that it reached."""
    way_m = turn_rad = 0.0
    for before, after in pairwise(recording.truth):
        way_m += math.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
        turn_rad += abs(math.remainder(after.yaw_rad - before.yaw_rad, math.tau))
    speed = max((abs(truth.linear_m_s) for truth in recording.truth), default=0.0)
    turn = max((abs(truth.angular_rad_s) for truth in recording.truth), default=0.0)
    return max(way_m / speed if speed else 0.0, turn_rad / turn if turn else 0.0)


def _whole(samples: Samples, folder: Path, build: str) -> None:
    """`rosgrade check` as a user runs it: wall and CPU time of everything it starts."""
    cache = folder / "whole-cache"
    if build == "cold":
        # The student's Python environment beside the builds is made once on a machine.
        shutil.rmtree(cache / "rosgrade" / BUILDS, ignore_errors=True)
    arguments = ["check", ASSIGNMENT, str(reference_of(ASSIGNMENT)), "--quiet"]
    report = folder / "whole"
    began_s = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "grader", *arguments, "--report", str(report)],
        env={**os.environ, "XDG_CACHE_HOME": str(cache)},
        stdout=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall_s = time.monotonic() - began_s
    if process.returncode:
        raise SystemExit(f"rosgrade check ended with {process.returncode}")
    (file,) = (report / RECORDINGS_FOLDER).glob("*.mcap")
    recording = read_recording(file)
    needed_s = (recording.stop_ns - (recording.matched_ns or recording.launched_ns)) / NS
    samples.add(f"rosgrade check, {build} build: wall", wall_s)
    samples.add(f"rosgrade check, {build} build: overhead", wall_s - needed_s)
    samples.add(f"rosgrade check, {build} build: CPU", usage.ru_utime + usage.ru_stime)


MEASUREMENTS: dict[str, Callable[[Samples, Path, int], None]] = {
    "single": _single,
    "batch": _batch,
    "simulator": _simulator,
    "robots": _robots,
    "class": _class,
}


if __name__ == "__main__":
    sys.exit(main())
