"""package.tests, and what pytest prints."""

import pytest

from grader.findings.finding import Status
from grader.recording.submission import BuildRecord, PytestRecord
from grader.submission.build.bounded import Outcome
from grader.submission.build.own_tests import pytest_record
from tests.checks.builder import failing, judge, submission

NAME = "bot_publisher"
ONE_FAILED = ("test/test_a.py::test_b", "assert 1 == 2")


def with_run(**changes):
    run = PytestRecord(NAME, **changes)
    return submission(build=BuildRecord(succeeded=True, duration_s=1.0, tests=(run,)))


def test_enough_tests_that_pass():
    finding = judge("package.tests", with_run(passed=3), package=NAME, at_least=3)
    assert finding.status is Status.PASSED
    assert finding.observed == "3 tests passed"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"passed": 2}, "there are 2 tests"),
        ({"passed": 2, "failed": (ONE_FAILED,)}, "2 tests passed, 1 failed: `test/test_a.py::"),
        ({"problem": "pytest found no test"}, "pytest found no test"),
    ],
)
def test_too_few_failing_and_no_tests_fail(changes, words):
    assert words in failing("package.tests", with_run(**changes), package=NAME, at_least=3)


def test_tests_that_were_not_run_cost_nothing():
    assert judge("package.tests", submission(), package=NAME).status is Status.ERROR


@pytest.mark.parametrize(
    ("status", "ended", "output", "expected"),
    [
        (0, None, "PASSED /w/p/test/a.py::t[x]\n1 passed\n", PytestRecord(NAME, 1)),
        (1, None, "FAILED /w/p/a.py::t - x\n", PytestRecord(NAME, 0, (("a.py::t", "x"),))),
        (2, None, "ERROR /w/p/a.py\n", PytestRecord(NAME, 0, (("a.py", ""),))),
        (5, None, "no tests ran\n", PytestRecord(NAME, problem="pytest found no test")),
        (None, "time", "", PytestRecord(NAME, problem="pytest was ended: time")),
        (3, None, "INTERNAL", PytestRecord(NAME, problem="pytest ended with status 3: INTERNAL")),
    ],
)
def test_what_pytest_prints_is_read(status, ended, output, expected):
    assert pytest_record(NAME, Outcome(status, ended, output, 1.0), "/w/p") == expected
