"""The rows of a class: each is graded once, by every executor and with every outcome.

What is handed in here cannot be built, so that nothing needs ROS.
"""

from __future__ import annotations

import errno
import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.variable import Variable
from grader.batch.batch import Batch, Done
from grader.batch.collected import Collected
from grader.batch.executor import BatchExecutor, ExecutorLost, LocalExecutor
from grader.batch.intake import collect
from grader.batch.ledger import Entry, Ledger
from grader.batch.roster import parse_roster
from grader.errors import GraderFault, UsageError
from grader.findings.finding import Status
from grader.gradebook.class_files import NO_RESULT, all_standing, class_rows, copies, find_reports
from grader.grading.files import RESULT_FILE
from grader.grading.graded import RECORDINGS_FOLDER, SUBMISSION_FILE
from grader.grading.grading import Grading
from grader.machine import ros
from grader.report.model.result import make_result
from grader.run.runner import Runner
from grader.submission.kept_source import SOURCE_FOLDER, read_kept_source
from tests.report.sample import not_graded

YAML = """\
rosgrade: 1
id: lesson
title: Test
packages: [{name: bot, executables: [bot]}]
scenarios:
  - {id: run, launch: [{executable: bot}], timeout: 5 s}
checks:
  - {id: package, uses: package.found, with: {package: bot}, points: 1}
"""


def notes_of(done: Sequence[Done]) -> dict[str, str]:
    """What the class says of each row."""
    return {row.id: row.note for row in class_rows(done)}


class Class:
    """A class that is graded again and again into the same folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "lesson").mkdir()
        (folder / "lesson" / "assignment.yaml").write_text(YAML, encoding="utf-8")
        self.loaded: LoadedAssignment = load_assignment(folder / "lesson")
        self.ledger = Ledger(folder / "out")

    def hand_in(self, name: str, content: str) -> None:
        """A folder with one file."""
        (self.folder / "class" / name).mkdir(parents=True)
        (self.folder / "class" / name / "notes.txt").write_text(content)

    def executor(self, jobs: int = 2) -> LocalExecutor:
        """Who can grade."""
        runner = Runner(ros.RosInstallation("wheels", Path("python"), ()))
        return LocalExecutor(Grading(self.loaded, runner, self.folder / "cache"), jobs)

    def grade(self, executor: BatchExecutor, *retry: str) -> dict[str, Done]:
        """Run a batch to its end."""
        with self.ledger.opened():
            batch = Batch(self.loaded, self.ledger, frozenset(retry))
            _, to_do = batch.read(collect(self.folder / "class", self.folder))
            done = {item.entry.key: item for item in batch.grade(to_do, executor)}
        executor.close()
        return done

    def written(self) -> dict[str, int]:
        """When each result was written."""
        files = self.ledger.out.glob(f"submissions/*/{RESULT_FILE}")
        return {file.parent.name: file.stat().st_mtime_ns for file in files}


class FailingCrew:
    """Has graded nothing when it fails."""

    capacity = 1

    def __init__(self, error: Exception) -> None:
        self._error = error
        self.given: dict[str, Mapping[str, str]] = {}

    def submit(self, key: str, path: Path, folder: Path, given: Mapping[str, str]) -> Future[None]:
        """Fail."""
        self.given[key] = given
        done: Future[None] = Future()
        done.set_exception(self._error)
        return done

    def close(self) -> None:
        """There is nothing to end."""


@pytest.fixture
def course(tmp_path: Path) -> Class:
    made = Class(tmp_path)
    made.hand_in("ana", "first")
    made.hand_in("ben", "second")
    made.hand_in("cai", "first")
    return made


@pytest.mark.parametrize("named", ["ana", "cai"])
def test_of_the_same_submissions_either_may_be_named_to_be_graded_again(
    course: Class, named: str
) -> None:
    assert not any(item.entry.fault for item in course.grade(course.executor()).values())
    before = course.written()
    done = course.grade(course.executor(), named)
    assert {key for key, item in done.items() if item.fresh} == {"ana", "cai"}
    after = course.written()
    assert after["ana"] != before["ana"] and after["ben"] == before["ben"]


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ("Cai", "called Cai. Did you mean 'cai'?"),
        ("bem", "called bem. Did you mean 'ben'?"),
        ("somebody else", "called somebody else."),
    ],
)
def test_an_unknown_name_to_grade_again_is_reported_with_the_nearest(
    course: Class, named: str, said: str
) -> None:
    rows = collect(course.folder / "class", course.folder)
    with course.ledger.opened(), pytest.raises(UsageError) as caught:
        Batch(course.loaded, course.ledger, frozenset({named})).read(rows)
    assert str(caught.value) == f"--retry: there is no submission {said}"


def test_two_who_handed_in_nothing_did_not_copy_from_each_other(course: Class) -> None:
    for name in ("dora", "emil"):
        (course.folder / "class" / name).mkdir()
    done = course.grade(course.executor())
    assert [done[key].entry.same_as for key in ("cai", "dora", "emil")] == ["ana", "", ""]
    told = notes_of(list(done.values()))
    assert told["dora"] == told["emil"] == "the submission is empty"


def test_the_source_of_each_lies_beside_its_result_also_of_the_same_submission(
    course: Class,
) -> None:
    course.grade(course.executor())
    kept = {
        key: read_kept_source(course.ledger.folder(key) / SOURCE_FOLDER).files
        for key in ("ana", "ben", "cai")
    }
    first, second = {"notes.txt": "first"}, {"notes.txt": "second"}
    assert kept == {"ana": first, "ben": second, "cai": first}


def test_each_of_those_who_handed_in_the_same_names_the_others(course: Class) -> None:
    course.hand_in("dora", "first")
    told = notes_of(list(course.grade(course.executor()).values()))
    assert {key: note.partition(";")[0] for key, note in told.items() if key != "ben"} == {
        "ana": "the same submission as cai and dora",
        "cai": "the same submission as ana and dora",
        "dora": "the same submission as ana and cai",
    }
    assert "same" not in told["ben"]


def test_a_team_did_not_copy_from_itself_but_may_have_been_copied_from(course: Class) -> None:
    course.hand_in("dora", "third")
    (course.folder / "class" / "submission_metadata.yml").write_text(
        "ana:\n  :submitters:\n  - :name: Ana\n  - :name: Abe\n"
        "dora:\n  :submitters:\n  - :name: Dora\n  - :name: Dan\n"
    )
    done = list(course.grade(course.executor()).values())
    assert {key: "same submission" in note for key, note in notes_of(done).items()} == {
        **dict.fromkeys(("Ana", "Abe", "cai"), True),
        **dict.fromkeys(("Dora", "Dan", "ben"), False),
    }
    told = {key: note.partition(";")[0] for key, note in notes_of(done).items()}
    assert told["Ana"] == told["Abe"] == "the same submission as cai"
    assert told["cai"] == "the same submission as Abe and Ana"
    assert copies(done) == 1
    # What is judged again later knows of the teams too.
    assert {entry.key: entry.team for entry in course.ledger.read().entries} == {
        **dict.fromkeys(("Ana", "Abe"), "Abe"),
        **dict.fromkeys(("Dora", "Dan"), "Dan"),
        **dict.fromkeys(("ben", "cai"), ""),
    }


def test_of_very_many_the_same_a_few_are_named() -> None:
    first = Done(Entry("0"), None, fresh=False)
    same = [Done(Entry(str(number), same_as="0"), None, fresh=False) for number in range(1, 500)]
    told = notes_of([first, *same])
    assert told["0"] == "the same submission as 1, 2, 3, 4, 5 and 494 others"
    assert told["2"] == "the same submission as 0, 1, 3, 4, 5 and 494 others"
    assert told["499"] == "the same submission as 0, 1, 2, 3, 4 and 494 others"
    assert notes_of([first, *same[:6]])["6"] == "the same submission as 0, 1, 2, 3, 4 and 1 other"


def test_the_row_of_what_was_not_graded_says_why() -> None:
    sample = not_graded()
    result = make_result(sample.grade, sample.recordings, sample.facts)
    observed = next(c.observed for c in result.checks if c.status is Status.ERROR)
    told = notes_of([Done(Entry("ana"), result, fresh=True)])
    assert told["ana"] == f"not graded, 2 points open: {observed}"


def test_a_full_disk_is_the_machine_s_and_says_what_to_do(course: Class) -> None:
    full = OSError(errno.ENOSPC, "No space left on device", "/cache/builds")
    told = {item.entry.fault for item in course.grade(FailingCrew(full)).values()}
    (fault,) = told
    assert fault.startswith("this machine: the disk is full (/cache/builds); no point is lost")
    assert "make room there" in fault


def test_what_could_not_be_graded_is_reported_on_the_row_of_its_twin_too(course: Class) -> None:
    done = course.grade(FailingCrew(GraderFault("the disk is full")))
    assert {key: item.entry.fault for key, item in done.items()} == dict.fromkeys(
        ("ana", "ben", "cai"), "the disk is full"
    )


def test_a_lost_cluster_ends_the_batch_and_is_the_fault_of_no_row(course: Class) -> None:
    with pytest.raises(ExecutorLost, match="the scheduler is gone"):
        course.grade(FailingCrew(ExecutorLost("the scheduler is gone")))
    assert not any(entry.fault for entry in course.ledger.read().entries)
    assert not course.written()
    assert {item.result is not None for item in course.grade(course.executor()).values()} == {True}


def test_a_batch_of_another_assignment_replaces_no_grades(course: Class) -> None:
    course.grade(course.executor())
    before = course.written()
    course.hand_in("dee", "third")
    other = course.folder / "other"
    other.mkdir()
    (other / "assignment.yaml").write_text(YAML.replace("id: lesson", "id: other"))
    with pytest.raises(UsageError, match="holds the grades of lesson; use a new folder"):
        Batch(load_assignment(other), course.ledger, frozenset({"all"})).read(
            collect(course.folder / "class", course.folder)
        )
    assert course.written() == before
    assert course.ledger.read().assignment == "lesson"


def test_who_was_graded_with_another_version_is_named(course: Class) -> None:
    course.grade(course.executor())
    yaml = course.folder / "lesson" / "assignment.yaml"
    yaml.write_text(YAML.replace("points: 1", "points: 2"))
    course.loaded = load_assignment(yaml.parent)
    with pytest.raises(UsageError, match=r"2 \(ana, ben\) graded with another version of lesson"):
        course.grade(course.executor())
    with pytest.raises(UsageError, match=r"1 \(ben\) graded with another version of lesson"):
        course.grade(course.executor(), "cai")
    done = course.grade(course.executor(), "ana", "ben")
    assert {item.result.max_score for item in done.values() if item.result} == {2}


def test_what_is_gone_has_no_grade(course: Class) -> None:
    course.grade(course.executor())
    shutil.rmtree(course.folder / "class" / "ben")
    with course.ledger.opened():
        batch = Batch(course.loaded, course.ledger)
        rows = collect(course.folder / "class", course.folder)
        batch.read([*rows, Collected("ben", problem="handed in nothing")])
        done = {item.entry.key: item for item in batch.grade({}, None)}
    assert done["ben"].result is None and done["ana"].result is not None
    assert [folder.name for folder in find_reports(course.ledger.out)] == ["ana", "cai"]


def test_a_recording_that_is_damaged_costs_only_the_twin_its_grade(course: Class) -> None:
    course.grade(course.executor())
    record = course.ledger.folder("ana") / RECORDINGS_FOLDER / SUBMISSION_FILE
    record.write_text("{}")
    course.hand_in("dee", "first")
    done = course.grade(course.executor())
    assert done["dee"].result is None
    assert done["dee"].entry.fault.endswith("`--retry ana` grades both again")
    assert {key for key, item in done.items() if item.result} == {"ana", "ben", "cai"}
    again = course.grade(course.executor(), "ana")
    assert not again["dee"].entry.fault and again["dee"].result is not None


def test_an_interrupted_batch_knows_what_it_has_not_come_to(course: Class) -> None:
    course.grade(course.executor())
    course.hand_in("dee", "third")
    (course.folder / "class" / "ben" / "notes.txt").write_text("handed in again")
    with course.ledger.opened():
        batch = Batch(course.loaded, course.ledger, frozenset({"ana"}))
        _, to_do = batch.read(collect(course.folder / "class", course.folder))
        assert set(to_do) == {"ana", "ben", "dee"}
        left = {item.entry.key: item for item in all_standing(course.ledger)}
    graded = {key for key, item in left.items() if item.result is not None}
    assert graded == {"ana", "ben (attempt 1)", "cai"}
    assert left["ben"].entry.problem == left["dee"].entry.problem == NO_RESULT


@pytest.mark.parametrize(("team", "same_as"), [("red", "ana"), ("blue", "")])
def test_the_same_submission_of_another_team_is_graded_with_the_names_of_that_team(
    course: Class, team: str, same_as: str
) -> None:
    variables = {"team": Variable(column="Team", example="red")}
    assignment = course.loaded.assignment.model_copy(update={"variables": variables})
    roster = parse_roster(f"login,team\nana,red\nben,\ncai,{team}\n", "class.csv")
    rows = collect(course.folder / "class", course.folder, roster)
    with course.ledger.opened():
        batch = Batch(replace(course.loaded, assignment=assignment), course.ledger)
        entries, to_do = batch.read(rows)
        executor = FailingCrew(ExecutorLost("all workers are gone"))
        with pytest.raises(ExecutorLost):
            list(batch.grade(to_do, executor))
    assert [one.same_as for one in entries if one.key == "cai"] == [same_as]
    assert executor.given == {"ana": {"team": "red"}}
