"""``make bench``: the figures of the speed budget, measured on this machine.

Prints a table and writes ``rosgrade-bench.json``. Quote medians; compare only figures of one
run on one machine.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from grader.assignment.load import load_assignment
from grader.assignment.reference import reference_of
from grader.grading.files import write_graded
from grader.grading.graded import RECORDINGS_FOLDER
from grader.grading.grading import Grading
from grader.grading.regrading import find_recordings, regrade
from grader.grading.spine import run_and_judge
from grader.machine import ros
from grader.machine.load import cpu_count
from grader.machine.resources import BUILDS
from grader.recording.mcap_reader import read_recording
from grader.recording.model import NS
from grader.report.files import write_whole
from grader.report.model.facts import Clock
from grader.run.admission import Admission
from grader.run.cell.domain import lock_domain
from grader.run.request import RunRequest
from grader.run.runner import Runner
from grader.sandbox.choice import Choice
from grader.sandbox.trial import choose
from grader.submission.prepare import Preparation, Prepared, prepare

CLASSES = {"timed_publisher": 100, "bot_controller": 40, "p_controller": 40}
"""Assignment, without and with a robot -> size of its class."""
CELLS = {"at rest": ("bot_controller", "blocked"), "driving": ("bot_controller", "open")}
"""What the robot does -> assignment and scenario in which the reference does it."""
ASSIGNMENT = "timed_publisher"
PICTURES = {
    "raw": ("Image", "/camera/image_raw"),
    "compressed": ("CompressedImage", "/camera/image_raw/compressed"),
}
"""What somebody listens to -> its type and topic."""
_LISTENER = """
import sys, rclpy, sensor_msgs.msg as types
rclpy.init()
node = rclpy.create_node("listener")
node.create_subscription(getattr(types, sys.argv[1]), sys.argv[2], lambda message: None, 10)
rclpy.spin(node)
"""
REGRADED = 50
OUTPUT = Path("rosgrade-bench.json")
_FEW = 3

Samples = defaultdict[str, list[float]]
"""Figures by their names, one of each kind for every run."""


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="of `rosgrade check`")
    parser.add_argument("--only", choices=sorted(MEASUREMENTS), action="append")
    options = parser.parse_args()
    # A user's Python keeps what it compiled; without that, each start would compile all of it.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    samples: Samples = defaultdict(list)
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="rosgrade-bench-") as name:
        for what in options.only or MEASUREMENTS:
            passed_s = time.monotonic() - began_s
            print(f"{passed_s:4.0f} s: measuring {what}", file=sys.stderr, flush=True)
            MEASUREMENTS[what](samples, Path(name), options.runs)
    summary = {
        figure: {"min": min(values), "median": median(values), "max": max(values)}
        for figure, values in samples.items()
    }
    print(f"{'figure (s, or a ratio)':<60} {'min':>9} {'median':>9} {'max':>9}")
    for figure, row in summary.items():
        print(f"{figure:<60} {row['min']:>9.6f} {row['median']:>9.6f} {row['max']:>9.6f}")
    write_whole(OUTPUT, json.dumps({"runs": options.runs, "figures": summary}, indent=2) + "\n")
    print(f"written to {OUTPUT}")
    return 0


def _check(samples: Samples, folder: Path, runs: int) -> None:
    """`rosgrade check` as a user runs it: wall and CPU time of everything that it starts."""
    cache, report = folder / "check-cache", folder / "check"
    for build in ["cold"] * _FEW + ["warm"] * runs:
        if build == "cold":
            # The student's Python environment beside the builds is made once on a machine.
            shutil.rmtree(cache / "rosgrade" / BUILDS, ignore_errors=True)
        arguments = ["check", ASSIGNMENT, str(reference_of(ASSIGNMENT)), "--quiet"]
        wall_s, cpu_s = _timed(
            [sys.executable, "-m", "grader", *arguments, "--report", str(report)],
            {**os.environ, "XDG_CACHE_HOME": str(cache)},
        )
        (file,) = (report / RECORDINGS_FOLDER).glob("*.mcap")
        recording = read_recording(file)
        needed_s = (recording.stop_ns - (recording.matched_ns or recording.launched_ns)) / NS
        samples[f"rosgrade check, {build} build: wall"].append(wall_s)
        samples[f"rosgrade check, {build} build: overhead"].append(wall_s - needed_s)
        samples[f"rosgrade check, {build} build: CPU"].append(cpu_s)


def _timed(command: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Wall and CPU time of a command and all that it starts, in seconds."""
    began_s = time.monotonic()
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{command[:4]} ended with {process.returncode}")
    return time.monotonic() - began_s, usage.ru_utime + usage.ru_stime


def _batch(samples: Samples, folder: Path, _: int) -> None:
    """Classes of one and the same submission, in the sandbox where this machine has one."""
    sandbox, notice = choose(Choice.AUTO, folder / "batch-cache")
    if notice:
        print(notice, file=sys.stderr)
    for name, count in CLASSES.items():
        loaded = load_assignment(name)
        how = Preparation(ros=ros.find(), cache=folder / "batch-cache", sandbox=sandbox)
        prepared = prepare(reference_of(name), how)
        with Runner(ros.find(), Admission(), sandbox=sandbox) as runner:
            grading = Grading(loaded, runner, folder / "batch-cache")
            work = partial(_grade_into, grading, prepared, folder / name)
            work(0)
            repeats: Counter[str] = Counter()
            before_s, own_s = runner.cpu_s, time.process_time()
            students_s = runner.students_cpu_s
            began_s = time.monotonic()
            with ThreadPoolExecutor(max_workers=runner.admission.most) as pool:
                futures = [pool.submit(work, number) for number in range(count)]
                for number, future in enumerate(as_completed(futures), start=1):
                    repeats.update(future.result())
                    if number % 20 == 0:
                        print(f"{name}: {number} of {count}", file=sys.stderr, flush=True)
            wall_s = time.monotonic() - began_s
            cpu_s = runner.cpu_s - before_s + time.process_time() - own_s
            students_s = runner.students_cpu_s - students_s
        samples[f"batch of {name}: submissions per minute"].append(60 * count / wall_s)
        samples[f"batch of {name}: CPU of each"].append(cpu_s / count)
        samples[f"batch of {name}: CPU of each that is ours"].append((cpu_s - students_s) / count)
        samples[f"batch of {name}: ours to the students' own"].append(cpu_s / students_s - 1)
        samples[f"batch of {name}: runs repeated"].append(repeats.total())
        for why, number in repeats.most_common():
            print(f"{name}: {number} times run again: {why}", file=sys.stderr)
        share = cpu_s / cpu_count() / wall_s
        samples[f"batch of {name}: share of what the CPUs bound"].append(share)
        began_s = time.monotonic()
        for _ in range(REGRADED):
            regrade(loaded, find_recordings(folder / name / "0"))
        rate = 60 * REGRADED / (time.monotonic() - began_s)
        samples[f"regrade of {name}: submissions per minute"].append(rate)


def _grade_into(grading: Grading, prepared: Prepared, folder: Path, number: int) -> Iterable[str]:
    """Grade one more of the class; returns why runs were repeated."""
    own = folder / str(number)
    clock = Clock()
    graded = run_and_judge(prepared, grading, own / RECORDINGS_FOLDER)
    write_graded(graded, own, clock)
    return graded.repeats


def _cell(samples: Samples, folder: Path, _: int) -> None:
    """What share of a core a cell and the student's process in it take together."""
    sandbox, _notice = choose(Choice.AUTO, folder / "cell-cache")
    for what, (name, scenario_id) in CELLS.items():
        loaded = load_assignment(name)
        how = Preparation(ros=ros.find(), cache=folder / "cell-cache", sandbox=sandbox)
        prepared = prepare(reference_of(name), how)
        (scenario,) = (one for one in loaded.assignment.scenarios if one.id == scenario_id)
        assert prepared.install is not None
        with Runner(ros.find(), sandbox=sandbox) as runner:
            taken_s = []
            for seconds in (2, 2, 12):
                until = scenario.until.model_validate({"elapsed": f"{seconds} s"})
                update = {"until": until, "timeout": 2 * seconds}
                before_s = runner.cpu_s
                request = RunRequest(
                    loaded.assignment,
                    scenario.model_copy(update=update),
                    prepared.record,
                    prepared.install,
                    seed=1,
                    worlds=loaded.folder,
                )
                runner.run(request, folder / "cell.mcap")
                taken_s.append(runner.cpu_s - before_s)
        # The first run also pays for what the prefork server imports.
        samples[f"cell with a robot {what}: share of a core"].append((taken_s[2] - taken_s[1]) / 10)


def _simulator(samples: Samples, folder: Path, _: int) -> None:
    """What share of a core the simulator takes in real time, with a robot among 100 walls."""
    walls = [[x, y, x + 0.5, y + 0.3] for x in range(10) for y in range(10)]
    for _ in range(_FEW):
        samples["simulator: share of a core at real time, 100 segments"].append(
            _simulated(folder, {"start": [-1, -1, 0], "segments": walls}, {})
        )


def _camera(samples: Samples, folder: Path, _: int) -> None:
    """What share of a core the simulator takes with a camera, and how much of it is the camera."""
    box = {"size": [0.3, 0.2], "colour": "red", "height": 0.2}
    around = [[2 * math.cos(angle), 2 * math.sin(angle)] for angle in range(6)]
    world = {
        "bounds": [-4, -4, 4, 4],
        "boxes": [{"centre": centre, **box} for centre in around],
        "lines": [{"points": around, "colour": "black"}],
    }
    camera = {"lidar": {"enabled": False}, "camera": {"noise": "1 %"}}
    for _ in range(_FEW):
        unheard = _simulated(folder, world, camera)
        for what, topic in PICTURES.items():
            heard = _simulated(folder, world, camera, ("-c", _LISTENER, *topic))
            samples[f"camera of 320 x 240 at 10 Hz, {what}: share of a core"].append(
                heard - unheard
            )


def _simulated(
    folder: Path, world: Any, options: dict[str, Any], beside: Sequence[str] = ()
) -> float:
    """The share of a core that the simulator takes in real time, with a robot that drives.

    Args:
        beside: A Python program that runs beside it, whose time does not count.
    """
    drives = [{"at": "0 s", "linear": "0.2 m/s", "angular": "0.4 rad/s"}]
    files = folder / "world.yaml", folder / "options.yaml"
    for file, content in zip(files, (world, {"robot": {"drives": drives}, **options}), strict=True):
        file.write_text(json.dumps(content))
    simulate = [sys.executable, "-m", "grader", "sim", str(files[0]), "--options", str(files[1])]
    with lock_domain() as domain:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain.domain_id)}
        other = subprocess.Popen([sys.executable, *(beside or ("-c", ""))], env=environment)
        try:
            # Both have met after the shorter time.
            short_s, long_s = (
                _timed([*simulate, "--duration", seconds], environment)[1]
                for seconds in ("3", "13")
            )
        finally:
            other.kill()
            other.wait()
    return (long_s - short_s) / 10


MEASUREMENTS: dict[str, Callable[[Samples, Path, int], None]] = {
    "check": _check,
    "batch": _batch,
    "cell": _cell,
    "simulator": _simulator,
    "camera": _camera,
}


if __name__ == "__main__":
    sys.exit(main())
