"""What is run again, what is given up, and whose fault it is: no ROS needed for that.

The runner is replaced at its seam by one that leaves recordings made by hand.
"""

from __future__ import annotations

import dataclasses
import gc
import shutil
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.authoring.mutants.selftest import Role, Setup, Trial, mutation_score, run_trial
from grader.batch.ledger import Entry, Ledger
from grader.errors import GraderFault, UsageError
from grader.findings.finding import Status
from grader.gradebook.class_files import find_reports
from grader.gradebook.class_regrading import regrade_class
from grader.grading import runs as runs_module
from grader.grading import spine
from grader.grading.files import REPORT_FILE, RESULT_FILE, write_graded
from grader.grading.graded import Graded
from grader.grading.grading import Grading, Told
from grader.grading.regrading import compare, find_recordings, regrade
from grader.grading.spine import HandedIn, run_and_judge
from grader.machine import ros
from grader.recording.event import Disturbance
from grader.recording.mcap_writer import write_recording
from grader.recording.model import Ending, Endpoint, Kind, Node, Owner, Qos, Recording
from grader.recording.submission import BuildRecord, PackageRecord, SubmissionRecord
from grader.report.model.facts import Clock
from grader.run.request import RunRequest
from grader.run.runner import Runner
from grader.spec.names import Names, Thing, WrongName
from grader.submission.build.colcon import BuildLimits
from grader.submission.prepare import Preparation, Prepared

YAML = """\
rosgrade: 1
id: lesson
title: Test
packages: [{name: bot, executables: [bot]}]
scenarios:
  - id: run
    launch: [{executable: bot}]
    record: [{topic: /cmd_vel, type: geometry_msgs/msg/Twist}]
    timeout: 5 s
checks:
  - {id: alive, uses: node.alive, points: 1}
  - {id: ends, uses: node.ends, with: {within: 2 s}, points: 1, requires: [alive]}
"""
SUBMISSION = SubmissionRecord(
    id="ada",
    sha256="ab" * 32,
    packages=(PackageRecord(name="bot", path=".", executables=("bot",)),),
    build=BuildRecord(succeeded=True, duration_s=1.0),
)
SECOND = 1_000_000_000


def recording(
    stop_s: float = 0.1, stolen_s: float = 0.0, faults: tuple[str, ...] = ()
) -> Recording:
    """A run whose node took so long to end, while the host took so much."""
    from grader.recording.model import Process

    end = 10 * SECOND
    return Recording(
        scenario="run",
        seed=1,
        ending=Ending.FAULT if faults else Ending.UNTIL,
        launched_ns=SECOND,
        matched_ns=2 * SECOND,
        stop_ns=5 * SECOND,
        end_ns=end,
        submission=SUBMISSION,
        nodes=(Node("/bot", Owner.STUDENT, 2 * SECOND),),
        endpoints=(
            Endpoint(
                Kind.PUBLISHER,
                "/cmd_vel",
                "geometry_msgs/msg/Twist",
                "/bot",
                Owner.STUDENT,
                Qos("reliable", "volatile"),
                "01",
                2 * SECOND,
            ),
        ),
        processes=(Process("bot/bot", 7, SECOND, end, -2, "SIGINT", stop_s),),
        disturbance=(Disturbance(6 * SECOND, 0, int(stolen_s * SECOND)),),
        faults=faults,
    )


class ScriptedRunner(Runner):
    """Leaves one prepared recording after the other, or raises."""

    def __init__(self, *outcomes: Recording | Exception) -> None:
        super().__init__(ros.RosInstallation("wheels", Path("python"), ()))
        self._outcomes: Iterator[Recording | Exception] = iter(outcomes)
        self.alone: list[bool] = []
        self.names: list[object] = []
        self.scenarios: list[Any] = []

    def run(self, request: RunRequest, recording: Path, *, alone: bool = False) -> None:
        outcome = next(self._outcomes)
        self.scenarios.append(request.scenario)
        self.alone.append(alone)
        self.names.append(request.names)
        if isinstance(outcome, Exception):
            raise outcome
        recording.parent.mkdir(parents=True, exist_ok=True)
        write_recording(recording, outcome, (), {})


@pytest.fixture
def lesson(tmp_path: Path) -> LoadedAssignment:
    folder = tmp_path / "lesson"
    folder.mkdir()
    (folder / "assignment.yaml").write_text(YAML, encoding="utf-8")
    return load_assignment(folder)


Grade = Callable[..., tuple[Graded, ScriptedRunner]]


@pytest.fixture
def grade(lesson: LoadedAssignment, tmp_path: Path) -> Grade:
    def run(*outcomes: Recording | Exception) -> tuple[Graded, ScriptedRunner]:
        runner = ScriptedRunner(*outcomes)
        grading = Grading(lesson, runner, tmp_path / "cache")
        prepared = Prepared(record=SUBMISSION, install=tmp_path / "install")
        return run_and_judge(prepared, grading, tmp_path / "recordings"), runner

    return run


def test_a_calm_run_is_judged_once(grade: Grade) -> None:
    graded, runner = grade(recording())
    assert graded.grade.full_points
    assert runner.alone == [False]


def test_a_fault_of_the_student_is_not_run_again(grade: Grade) -> None:
    graded, runner = grade(recording(stop_s=2.5))
    assert graded.grade.result("ends").status is Status.FAILED
    assert runner.alone == [False]


def test_a_disturbed_run_is_repeated_alone(grade: Grade) -> None:
    disturbed = recording(stop_s=2.5, stolen_s=4.6)
    graded, runner = grade(disturbed, recording())
    assert graded.grade.full_points
    assert runner.alone == [False, True]
    assert graded.runs == {"run": 2}


def test_what_failed_last_runs_first_and_is_told_while_the_others_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one_by_one = partial(ThreadPoolExecutor, 1)
    monkeypatch.setattr(runs_module, "ThreadPoolExecutor", lambda max_workers: one_by_one())
    folder = tmp_path / "lesson"
    folder.mkdir()
    run = YAML[YAML.index("  - id: run") : YAML.index("checks:")]
    more = "".join(run.replace("id: run", f"id: {name}") for name in ("far", "near"))
    (folder / "assignment.yaml").write_text(YAML.replace(run, run + more), encoding="utf-8")
    runs = [dataclasses.replace(recording(), scenario=name) for name in ("far", "near", "run")]
    runner = ScriptedRunner(runs[1], runs[2], runs[0])
    told: list[list[str]] = []
    grading = Grading(
        load_assignment(folder),
        runner,
        tmp_path / "cache",
        first={"near"},
        told=Told(recorded=lambda record, recordings: told.append(list(recordings))),
    )
    prepared = Prepared(record=SUBMISSION, install=tmp_path / "install")
    graded = run_and_judge(prepared, grading, tmp_path / "recordings")
    assert [one.id for one in runner.scenarios] == ["near", "run", "far"]
    assert [set(names) for names in told] == [
        set(),
        {"near"},
        {"near", "run"},
        {"near", "run", "far"},
    ]
    assert list(graded.recordings) == ["far", "near", "run"]
    assert graded.grade.full_points


NAMED = (
    YAML.replace(
        "packages:",
        """variables:
  topic: {match: any, in: publishers, of: geometry_msgs/msg/Twist, example: /cmd_vel}
  bot: {match: "{bot}", in: packages, column: Team, example: red}
packages:""",
    )
    .replace("topic: /cmd_vel,", 'topic: "{topic}",')
    .replace("{name: bot,", '{name: "{bot}",')
)


@pytest.fixture
def named(tmp_path: Path) -> LoadedAssignment:
    folder = tmp_path / "lesson"
    folder.mkdir()
    (folder / "assignment.yaml").write_text(NAMED, encoding="utf-8")
    return load_assignment(folder)


@pytest.mark.parametrize(("topic", "runs"), [("/cmd_vel", 1), ("/speed", 2)])
def test_a_run_is_repeated_with_the_name_that_it_showed(
    named: LoadedAssignment, tmp_path: Path, topic: str, runs: int
) -> None:
    right = recording()
    run = dataclasses.replace(
        right, endpoints=(dataclasses.replace(right.endpoints[0], topic=topic),)
    )
    runner = ScriptedRunner(*[run] * runs)
    prepared = Prepared(record=SUBMISSION, install=tmp_path / "install")
    graded = run_and_judge(prepared, Grading(named, runner, tmp_path / "cache"), tmp_path)
    assert graded.grade.full_points
    assert [one.record[0].topic for one in runner.scenarios] == ["/cmd_vel", topic][:runs]


def test_a_misnamed_package_is_found_by_the_names_that_the_submission_chose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "lesson"
    folder.mkdir()
    group = 'variables: {n: {match: "group{n}_interfaces", in: packages, example: 7}}\npackages:'
    checks = """checks:
  - {id: found, uses: package.found, with: {package: "group{n}_gp2", remap: true}, points: 1}
  - {id: tests, uses: package.tests, with: {package: "group{n}_gp2"}, points: 1}
"""
    text = YAML.replace("packages:", group, 1).replace("{name: bot,", '{name: "group{n}_gp2",')
    text = text.replace("checks:\n", checks)
    (folder / "assignment.yaml").write_text(text, encoding="utf-8")
    packages = tuple(PackageRecord(name, name) for name in ("group3_interfaces", "grup3_gp2"))
    record = dataclasses.replace(SUBMISSION, packages=packages)
    asked: list[frozenset[str]] = []

    def note(_path: Path, how: Preparation) -> Prepared:
        asked.append(how.choose_tested(record))
        return Prepared(record=record, install=None)

    monkeypatch.setattr(spine, "prepare", note)
    grading = Grading(load_assignment(folder), ScriptedRunner(), tmp_path / "cache")
    graded = spine.grade(HandedIn(tmp_path, tmp_path / "out"), grading)
    assert asked == [{"grup3_gp2"}]
    assert graded.prepared.record.names == Names.of(
        [WrongName(Thing.PACKAGE, "grup3_gp2", "group3_gp2")]
    )


def test_what_has_not_the_name_of_the_roster_is_not_run(
    named: LoadedAssignment, tmp_path: Path
) -> None:
    record = dataclasses.replace(SUBMISSION, given=(("bot", "blue"),))
    prepared = Prepared(record=record, install=None)
    graded = run_and_judge(prepared, Grading(named, ScriptedRunner(), tmp_path / "cache"), tmp_path)
    assert graded.grade.graded and graded.grade.score == 0
    assert "blue" in graded.grade.result("alive").decisive.finding.expected
    again = regrade(named, find_recordings(tmp_path))
    assert again.grade.assignment.packages[0].name == "blue"


def test_a_wrong_name_is_put_right_in_one_more_run(tmp_path: Path) -> None:
    asked = "with: {topic: /cmd_vel, remap: true}, points: 1"
    folder = tmp_path / "lesson"
    folder.mkdir()
    (folder / "assignment.yaml").write_text(
        f"{YAML}  - {{id: topic, uses: topic.published, {asked}}}\n", encoding="utf-8"
    )
    right = recording()
    probe = dataclasses.replace(
        right.endpoints[0], kind=Kind.SUBSCRIPTION, owner=Owner.PROBE, node="/probe", gid="02"
    )
    wrong = dataclasses.replace(right.endpoints[0], topic="/cmdvel")
    names = Names.of([WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel")])
    runner = ScriptedRunner(
        dataclasses.replace(right, endpoints=(wrong, probe)),
        dataclasses.replace(right, names=names),
    )
    grading = Grading(load_assignment(folder), runner, tmp_path / "cache")
    prepared = Prepared(record=SUBMISSION, install=tmp_path / "install")
    graded = run_and_judge(prepared, grading, tmp_path / "recordings")
    assert runner.names == [Names(), names]
    # It was no machine that disturbed it.
    assert graded.runs == {"run": 1}
    assert graded.grade.result("topic").put_right
    assert graded.grade.score == 2.0


def test_a_failure_of_a_robot_that_the_host_held_up_counts_if_it_happens_again(
    grade: Grade, monkeypatch: pytest.MonkeyPatch
) -> None:
    def doubted(loaded: LoadedAssignment, *arguments: object) -> object:
        graded = judge(loaded, *arguments)
        results = tuple(
            dataclasses.replace(
                result,
                findings=tuple(
                    dataclasses.replace(item, finding=item.finding.doubted())
                    for item in result.findings
                ),
            )
            for result in graded.results
        )
        return dataclasses.replace(graded, results=results)

    judge = runs_module.judge_all
    monkeypatch.setattr(runs_module, "judge_all", doubted)
    wrong = recording(stop_s=2.5)
    graded, runner = grade(wrong, recording())
    assert graded.grade.full_points
    assert runner.alone == [False, False]
    graded, runner = grade(wrong, wrong)
    assert graded.grade.result("ends").status is Status.FAILED
    assert runner.alone == [False, False]


def test_after_three_disturbed_runs_it_is_not_graded_and_costs_nothing(grade: Grade) -> None:
    disturbed = recording(stop_s=2.5, stolen_s=4.6)
    graded, runner = grade(disturbed, disturbed, disturbed)
    assert not graded.grade.graded
    assert graded.grade.result("ends").status is Status.ERROR
    assert graded.grade.result("alive").status is Status.PASSED
    assert runner.alone == [False, True, True]


def test_a_fault_of_rosgrade_is_tried_again_and_then_an_error_by_name(grade: Grade) -> None:
    foreign = recording(faults=("not alone on ROS domain 7: /neighbour",))
    graded, _ = grade(foreign, recording())
    assert graded.grade.full_points
    graded, _ = grade(foreign, foreign, foreign)
    assert not graded.grade.graded
    assert "/neighbour" in graded.grade.result("alive").decisive.finding.observed


def test_a_cell_that_fails_is_an_error_and_not_the_student_s(grade: Grade) -> None:
    fault = GraderFault("the cell of scenario 'run' ended with status -9")
    graded, _ = grade(fault, recording())
    assert graded.grade.full_points
    graded, _ = grade(fault, fault, fault)
    assert not graded.grade.graded
    assert graded.grade.result("alive").status is Status.ERROR
    assert "status -9" in graded.grade.result("alive").decisive.finding.observed


def test_a_full_disk_in_one_run_ends_no_other(grade: Grade) -> None:
    graded, runner = grade(OSError(28, "No space left on device"), recording())
    assert graded.grade.full_points
    assert runner.alone == [False, True]
    assert not runner._aborted


def test_a_recording_that_cannot_be_read_ends_no_other(grade: Grade) -> None:
    graded, runner = grade(UsageError("run.mcap: damaged recording"), recording())
    assert graded.grade.full_points
    assert not runner._aborted


def test_a_bug_in_one_run_ends_no_other(lesson: LoadedAssignment, tmp_path: Path) -> None:
    prepared = Prepared(SUBMISSION, install=tmp_path)
    runner = ScriptedRunner(ZeroDivisionError("a bug"), recording())
    grading = Grading(lesson, runner, tmp_path / "cache")
    with pytest.raises(ZeroDivisionError):
        run_and_judge(prepared, grading, tmp_path / "one")
    assert run_and_judge(prepared, grading, tmp_path / "another").grade.full_points
    assert not runner._aborted


def test_what_does_not_build_is_not_run(lesson: LoadedAssignment, tmp_path: Path) -> None:
    build = BuildRecord(succeeded=False, duration_s=1.0, log="error")
    record = dataclasses.replace(SUBMISSION, build=build)
    runner = ScriptedRunner()
    grading = Grading(lesson, runner, tmp_path)
    graded = run_and_judge(Prepared(record=record, install=None), grading, tmp_path / "r")
    assert runner.alone == []
    assert graded.grade.graded
    assert graded.grade.score == 0


def test_recordings_are_judged_again_without_running_anything(
    grade: Grade, lesson: LoadedAssignment, tmp_path: Path
) -> None:
    first, _ = grade(recording(stop_s=2.5))
    found = find_recordings(tmp_path / "recordings")
    assert regrade(lesson, found).grade == first.grade
    (lesson.folder / "assignment.yaml").write_text(
        YAML.replace("within: 2 s", "within: 3 s"), encoding="utf-8"
    )
    assert regrade(load_assignment(lesson.folder), found).grade.full_points


@pytest.fixture
def grading(lesson: LoadedAssignment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Grading:
    """Grades one run that does not end in time."""
    built = Prepared(record=SUBMISSION, install=tmp_path / "install")
    monkeypatch.setattr(spine, "prepare", lambda _path, _how: built)
    return Grading(lesson, ScriptedRunner(recording(stop_s=2.5)), tmp_path / "cache")


def test_of_a_trial_only_what_is_printed_is_kept(
    grading: Grading, lesson: LoadedAssignment, tmp_path: Path
) -> None:
    told: list[weakref.ref[Graded]] = []
    trial = Trial(Role.REFERENCE, "reference", "the reference solution", None)
    setup = Setup(
        lesson,
        grading,
        tmp_path,
        on_graded=lambda graded: told.append(weakref.ref(graded)),
    )
    result = run_trial(trial, setup, tmp_path)
    gc.collect()
    assert [graded() for graded in told] == [None]
    assert (result.lost, result.graded, result.repeated) == (("ends",), True, False)
    assert result.wrong
    assert '"id": "ends"' in result.grade


def test_an_untouched_starter_that_gets_many_points_is_judged_wrongly(
    grading: Grading, lesson: LoadedAssignment, tmp_path: Path
) -> None:
    trial = Trial(Role.STARTER, "starter", "the starter package, untouched", None)
    setup = Setup(lesson, grading, tmp_path)
    result = run_trial(trial, setup, tmp_path)
    assert result.mistake.startswith(
        "points: 1 point of 2, and a starter package may have 15% at most"
    )
    assert not mutation_score([result]).perfect


def test_a_limit_of_the_build_is_the_author_s(lesson: LoadedAssignment, tmp_path: Path) -> None:
    asked: list[BuildLimits] = []

    def note(_path: Path, how: Preparation) -> Prepared:
        asked.append(how.limits)
        return Prepared(record=dataclasses.replace(SUBMISSION, build=None), install=None)

    written = "build_limits: {wall_time: 30 s, output: 1 MiB, memory: 1 GiB}\nscenarios:"
    file = lesson.folder / "assignment.yaml"
    file.write_text(YAML.replace("scenarios:", written, 1), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spine, "prepare", note)
        for loaded in (lesson, load_assignment(lesson.folder)):
            spine.grade(
                HandedIn(tmp_path, tmp_path / "out"), Grading(loaded, ScriptedRunner(), tmp_path)
            )
    usual, own = asked
    assert usual == BuildLimits()
    assert (own.python_s, own.other_s, own.output.total) == (30.0, 30.0, 2**20)
    assert own.room.memory_bytes == 2**30


def test_of_a_refused_submission_is_kept_what_the_roster_says_of_it(
    lesson: LoadedAssignment, tmp_path: Path
) -> None:
    refused = dataclasses.replace(SUBMISSION, build=None, problem="an archive of 2 GiB")
    grading = Grading(lesson, ScriptedRunner(), tmp_path / "cache")
    parcel = HandedIn(
        tmp_path / "a.zip", tmp_path / "out", "ana", {"n": "7"}, Prepared(refused, None)
    )
    record = spine.grade(parcel, grading).prepared.record
    assert (record.id, record.given) == ("ana", (("n", "7"),))
    assert record.problem == "an archive of 2 GiB"


def test_a_regrade_says_who_gains_what_and_why(
    grade: Grade, lesson: LoadedAssignment, tmp_path: Path
) -> None:
    first, _ = grade(recording(stop_s=2.5))
    write_graded(first, tmp_path, Clock())
    (lesson.folder / "assignment.yaml").write_text(
        YAML.replace("within: 2 s", "within: 3 s"), encoding="utf-8"
    )
    found = find_recordings(tmp_path)
    assert found.assignment_folder("regrade", str(tmp_path)) == str(lesson.folder)
    assert found.result is not None
    lines = compare(found.result, regrade(load_assignment(lesson.folder), found).grade)
    assert lines[0].startswith("ends: failed -> passed, 0 -> 1 points: ")
    assert lines[1] == "score: 1 -> 2 of 2"


def test_a_result_is_replaced_only_when_its_report_is(grade: Grade, tmp_path: Path) -> None:
    first, _ = grade(recording())
    write_graded(first, tmp_path, Clock())
    before = (tmp_path / RESULT_FILE).read_bytes()
    (tmp_path / REPORT_FILE).unlink()
    (tmp_path / REPORT_FILE).mkdir()
    second, _ = grade(recording(stop_s=2.5))
    with pytest.raises(UsageError, match=r"report\.html cannot be written"):
        write_graded(second, tmp_path, Clock())
    assert (tmp_path / RESULT_FILE).read_bytes() == before


def test_what_cannot_be_judged_again_is_no_loss_of_points(
    grade: Grade, lesson: LoadedAssignment, tmp_path: Path
) -> None:
    first, _ = grade(recording())
    with Ledger(tmp_path / "out").opened() as ledger:
        partial = ledger.partial("ada")
        (tmp_path / "recordings").rename(partial / "recordings")
        write_graded(first, partial, Clock())
        ledger.put("ada", partial)
        ledger.write([Entry("ada", sha256=first.grade.submission.sha256)], "lesson", lesson.sha256)
        (ledger.folder("ada") / "recordings" / "run.mcap").unlink()
        (row,) = regrade_class(lesson, ledger)
    assert row.changes[0].startswith("alive: passed -> error: ")
    assert row.changes[-1] == "score: 2 -> not graded"
    assert row.gained == 0.0 and row.done.result is not None and not row.done.result.graded


def test_what_cannot_be_read_again_keeps_its_grade_and_is_reported(
    grade: Grade, lesson: LoadedAssignment, tmp_path: Path
) -> None:
    first, _ = grade(recording())
    sha256 = first.prepared.record.sha256
    names = ("ada", "ben", "cai", "dee")
    with Ledger(tmp_path / "out").opened() as ledger:
        for name in names:
            partial = ledger.partial(name)
            shutil.copytree(tmp_path / "recordings", partial / "recordings")
            write_graded(first, partial, Clock())
            ledger.put(name, partial)
        entries = [*(Entry(name, sha256=sha256) for name in names[:3]), Entry("dee", sha256="0")]
        ledger.write([*entries, Entry("eli", problem="handed in nothing")], "lesson", lesson.sha256)
        (ledger.folder("ada") / "recordings" / "run.mcap").write_bytes(b"cut")
        (ledger.folder("ben") / "result.json").write_text("")
        ada, ben, cai, dee, eli = regrade_class(lesson, ledger)
    assert "run.mcap: damaged recording: " in ada.problem
    assert ada.done.result is not None and not ada.done.fresh
    assert ada.done.entry.problem == f"not judged again: {ada.problem}"
    assert not cai.problem and cai.done.fresh
    for row in (ben, dee):
        assert row.problem == "not graded yet; run the batch again"
        assert row.done.result is None
    assert not eli.problem and eli.done.entry.problem == "handed in nothing"
    assert ledger.read().entries[0].problem == ""


def test_a_class_is_not_judged_again_as_of_another_assignment(
    grade: Grade, lesson: LoadedAssignment, tmp_path: Path
) -> None:
    first, _ = grade(recording())
    with Ledger(tmp_path / "out").opened() as ledger:
        partial = ledger.partial("ada")
        (tmp_path / "recordings").rename(partial / "recordings")
        write_graded(first, partial, Clock())
        ledger.put("ada", partial)
        ledger.write([Entry("ada")], "other", lesson.sha256)
        with pytest.raises(UsageError, match="out: holds the grades of other, not of lesson"):
            list(regrade_class(lesson, ledger))
        assert ledger.result("ada") is not None
        assert not (ledger.folder("ada") / "earlier").exists()


def test_a_folder_without_recordings_is_a_wrong_use(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there are no recordings in it"):
        find_recordings(tmp_path)
    for missing in (find_recordings, find_reports):
        with pytest.raises(UsageError, match="nowhere: does not exist"):
            missing(tmp_path / "nowhere")
