"""An instructor's own check is a function beside assignment.yaml, validated when it is loaded."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.load import load_assignment
from grader.checks.check import Subject
from grader.errors import AssignmentError
from grader.findings.finding import Status
from tests.assignment.lessons import HEAD

Write = Callable[..., Path]

MINE = """\
from __future__ import annotations

from dataclasses import dataclass

from grader.spec.quantity import Duration
from grader.findings.finding import Finding


@dataclass
class Limit:
    seconds: float


def quick(recording, within: Duration, times: int = 2):
    \"\"\"It is quick.

    Very.
    \"\"\"
    limit = Limit(within * times)
    return Finding.passed(f"within {limit.seconds} s", recording)


SETTING = 3


def anything(recording, **keys):
    pass


def nothing():
    pass


def unclear(recording, a: Missing):
    pass


def positional(recording, a, /):
    pass


def words(recording) -> bool:
    return recording.ok

"""


def yaml(python: str, with_: str = "{}") -> str:
    return HEAD + (f"  - id: mine\n    python: {python}\n    points: 1\n    with: {with_}\n")


def test_an_own_check_judges_with_its_validated_parameters(write: Write) -> None:
    folder = write(yaml("checks.py:quick", "{within: 500 ms}"), checks=MINE)
    (bound,) = load_assignment(folder, {}).checks
    assert bound.check.name == "checks.py:quick"
    assert bound.check.subject is Subject.RECORDING
    assert bound.title == "It is quick"
    finding = bound.check.judge("a recording", bound.parameters)
    assert (finding.status, finding.expected, finding.observed) == (
        Status.PASSED,
        "within 1.0 s",
        "a recording",
    )


def test_loading_leaves_nothing_behind_in_the_folder(write: Write) -> None:
    folder = write(yaml("checks.py:quick", "{within: 1 s}"), checks=MINE)
    before = load_assignment(folder, {}).sha256
    assert sorted(path.name for path in folder.iterdir()) == ["assignment.yaml", "checks.py"]
    (folder / "checks.py").write_text(MINE.replace("times: int = 2", "times: int = 3"))
    again = load_assignment(folder, {})
    assert again.sha256 != before
    assert again.checks[0].check.judge(None, again.checks[0].parameters).expected == "within 3.0 s"


@pytest.mark.parametrize(
    ("python", "said"),
    [
        ("checks.quick", "'checks.quick' does not name a function: write 'file.py:function'"),
        ("check.py:quick", "cannot read check.py: No such file or directory. Did you mean 'checks"),
        ("checks.py:quik", "checks.py has no function 'quik'. Did you mean 'quick'?"),
        (
            "checks.py:zzz",
            "checks.py has no function 'zzz'. Its functions: anything, nothing, positional, ",
        ),
        ("checks.py:SETTING", "checks.py has no function 'SETTING'"),
        ("checks.py:nothing", "must take the recording as its first argument"),
        ("checks.py:positional", "the argument 'a' cannot be a key of 'with'"),
        ("checks.py:unclear", "its annotations cannot be read: name 'Missing' is not defined"),
        ("checks.py:words", "checks.py:words: it returns bool: a check returns a Finding"),
    ],
)
def test_what_cannot_be_loaded_is_reported_at_its_line(
    write: Write, python: str, said: str
) -> None:
    folder = write(yaml(python), checks=MINE)
    with pytest.raises(AssignmentError, match=re.escape(said)) as caught:
        load_assignment(folder, {})
    assert str(caught.value).startswith(f"{folder / 'assignment.yaml'}:14: checks[0].python: ")


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("def quick(recording:\n", "checks.py:1: '(' was never closed"),
        ("import math\n\nmath.nothing\n", "checks.py:3: AttributeError: module 'math' has no"),
        ("\nraise SystemExit(3)\n", "checks.py:2: SystemExit: 3"),
    ],
)
def test_a_file_that_fails_names_its_own_line(write: Write, code: str, said: str) -> None:
    folder = write(yaml("checks.py:quick"), checks=code)
    with pytest.raises(AssignmentError, match=re.escape(said)):
        load_assignment(folder, {})
