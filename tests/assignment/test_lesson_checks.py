"""A lesson's own checks are a package beside assignment.yaml, of modules that import each other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.lesson_checks import all_checks
from grader.assignment.load import load_assignment
from grader.errors import AssignmentError
from tests.assignment.lessons import HEAD

Write = Callable[..., Path]

TEXTS = 'PASSED = "it is there"\n'
MINE = '''\
from grader.checks.check import Parameters, Subject, check
from grader.findings.finding import Finding
from grader.checks.need import Recorded
from grader.spec.name import TopicName

from .texts import PASSED


class There(Parameters):
    needs = (Recorded(),)
    topic: TopicName


@check("mine.there", Subject.RECORDING, There)
def there(recording, parameters):
    """It is there."""
    return Finding.passed(parameters.topic, PASSED)


@check("mine.handed_in", Subject.SUBMISSION)
def handed_in(submission, parameters):
    """It is handed in."""
    return Finding.passed("a submission", PASSED)
'''
USED = "  - {id: a, uses: mine.there, points: 1, with: {topic: /cmd_vel}}\n"


@pytest.fixture
def lesson(write: Write) -> Callable[..., Path]:
    def make(entry: str = USED, mine: str = MINE) -> Path:
        folder = write(HEAD + entry)
        (folder / "checks").mkdir()
        (folder / "checks/texts.py").write_text(TEXTS)
        (folder / "checks/mine.py").write_text(mine)
        return folder

    return make


def test_checks_of_recordings_and_of_submissions_are_used_by_their_names(lesson) -> None:
    loaded = load_assignment(lesson(USED + "  - {id: b, uses: mine.handed_in, points: 1}\n"))
    titles = [bound.title for bound in loaded.checks]
    assert titles == ["It is there", "It is handed in"]
    found = loaded.checks[0].check.judge(None, loaded.checks[0].parameters)
    assert (found.expected, found.observed) == ("/cmd_vel", "it is there")


def test_the_assignments_folder_stays_as_it_is(lesson) -> None:
    folder = lesson()
    first = load_assignment(folder)
    assert load_assignment(folder).sha256 == first.sha256
    assert not list(folder.rglob("__pycache__"))


def test_a_changed_module_is_another_assignment_and_is_read_again(lesson) -> None:
    folder = lesson()
    before = load_assignment(folder)
    (folder / "checks/texts.py").write_text('PASSED = "here it is"\n')
    after = load_assignment(folder)
    assert after.sha256 != before.sha256
    bound = after.checks[0]
    assert bound.check.judge(None, bound.parameters).observed == "here it is"


@pytest.mark.parametrize(
    ("mine", "told"),
    [
        ("import grader.nothing\n", r"checks/mine\.py:1: ModuleNotFoundError"),
        ("x = 1\ndef :\n", r"checks/mine\.py:2: invalid syntax"),
        ("\nraise SystemExit(3)\n", r"checks/mine\.py:2: SystemExit"),
        (MINE.replace("mine.there", "node.exists"), "rosgrade has a check 'node.exists' too"),
        (MINE.replace("mine.there", "mine.handed_in"), "two checks are called 'mine.handed_in'"),
        ("", "there is no check 'mine.there'"),
    ],
)
def test_a_mistake_in_a_module_is_reported_with_its_file_and_line(lesson, mine, told) -> None:
    with pytest.raises(AssignmentError, match=told):
        load_assignment(lesson(mine=mine))


def test_what_a_check_needs_is_asked_of_the_assignment(lesson) -> None:
    folder = lesson("  - {id: a, uses: mine.there, points: 1, with: {topic: /odom}}\n")
    with pytest.raises(AssignmentError, match="does not record '/odom'"):
        load_assignment(folder)


def test_the_checks_of_rosgrades_own_lessons_are_listed() -> None:
    assert {"rotation.answers", "callbacks.run", "motion.proportional"} <= set(all_checks())
