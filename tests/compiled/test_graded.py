"""Nodes in C++ are graded as those in Python: built, held, traced, judged, and mutated."""

from __future__ import annotations

import re
import shutil
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import pytest

from grader.assignment.load import load_assignment
from grader.assignment.reference import CPP, PYTHON
from grader.authoring.mutants.selftest import Role, Setup, TrialResult, selftest, trials
from grader.findings.finding import Status
from grader.grading.graded import Graded
from grader.grading.grading import Grading
from grader.machine import resources, ros
from grader.machine.load import cpu_count
from grader.run.runner import Runner
from tests.compiled.packages import MUTANTS, node, write_package

pytestmark = [pytest.mark.compiles, pytest.mark.ros, pytest.mark.slow]


class Solution(NamedTuple):
    """A lesson's solution in C++: package, executables, and what they need."""

    package: str
    programs: dict[str, str]
    depends: tuple[str, ...]


_TIMER = 'create_wall_timer(300, [this] {timer_callback();}, "BotPublisher::timer_callback()");'
IMPOSED = ("timed_publisher",)
"""Lessons of which every third standard mutant is graded, of the others the first."""
_SPINS = {"single_threaded": "spin", "multi_threaded": "spin_in_threads"}
SOLUTIONS = {
    "simple_publisher": Solution(
        "bot_publisher",
        {"bot_pub": node("timed_publisher").replace(_TIMER, "timer_callback();")},
        ("geometry_msgs",),
    ),
    "timed_publisher": Solution(
        "bot_publisher", {"bot_pub": node("timed_publisher")}, ("geometry_msgs",)
    ),
    "subscribers": Solution(
        "bot_subscriber", {"bot_sub": node("subscribers")}, ("nav_msgs", "sensor_msgs")
    ),
    "bot_controller": Solution(
        "bot_controller", {"bot_ctrl": node("bot_controller")}, ("geometry_msgs", "sensor_msgs")
    ),
    "executors": Solution(
        "executors_demo",
        {name: node("executors").replace("THREADS", how) for name, how in _SPINS.items()},
        ("std_msgs", "rosidl_runtime_c"),
    ),
}


class Results(NamedTuple):
    """What came of all trials: verdicts by lesson, and what failed checks observed."""

    verdicts: dict[str, list[TrialResult]]
    observed: list[str]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The results of all lessons, which are graded at the same time."""
    observed: list[str] = []

    def note(graded: Graded) -> None:
        for result in graded.grade.results:
            if result.status is Status.FAILED:
                observed.extend(item.finding.observed for item in result.findings)

    folder = tmp_path_factory.mktemp("lessons")
    with Runner(ros.find()) as runner, ThreadPoolExecutor(len(SOLUTIONS)) as pool:

        def graded(name: str) -> list[TrialResult]:
            lesson = folder / name
            shutil.copytree(load_assignment(name).folder, lesson)
            write_package(lesson / CPP.reference, *SOLUTIONS[name])
            shutil.copy(MUTANTS / f"{name}.yaml", lesson / CPP.mutants)
            (lesson / PYTHON.mutants).unlink()
            loaded = load_assignment(lesson)
            grading = Grading(loaded, runner, resources.cache_folder())
            every = trials(loaded, CPP)
            imposed = [one for one in every if one.mistakes][:: 3 if name in IMPOSED else 100]
            # The starter package is one on rclcpp.
            kept = [one for one in every if not one.is_derived and one.role is not Role.STARTER]
            setup = Setup(loaded, grading, lesson / CPP.reference, CPP, note)
            return list(selftest(setup, [*kept, *imposed], jobs=cpu_count()))

        verdicts = dict(zip(SOLUTIONS, pool.map(graded, SOLUTIONS), strict=True))
        return Results(verdicts, observed)


@pytest.mark.parametrize("name", SOLUTIONS)
def test_a_right_node_gets_full_points_and_a_wrong_one_loses_what_it_must(
    name: str, results: Results
) -> None:
    wrong = {
        result.trial.id: (result.mistake, *result.findings)
        for result in results.verdicts[name]
        if result.wrong
    }
    assert not wrong


@pytest.mark.parametrize(
    "end", ["SIGSEGV: segmentation fault", "std::runtime_error: no speed is left"]
)
def test_a_crash_is_named_with_the_students_line(end: str, results: Results) -> None:
    place = re.compile(rf"{re.escape(end)} \(bot_publisher/src/bot_pub\.cpp:\d+\)")
    assert any(place.search(text) for text in results.observed), results.observed
