"""Why a goal that was asked to cancel was not canceled."""

import pytest

from grader.findings.finding import Status
from tests.checks.builder import at, failing, judge, taken
from tests.checks.requests import acting, canceled

FIB = {"action": "/fibonacci"}
UNANSWERED = {"cancel_accepted": None, "cancel_answered_ns": None}


class TestBusyExecutor:
    """One thread cannot take in the request to cancel while the execute callback runs."""

    BLOCKED = canceled(end_s=None, **UNANSWERED)

    @pytest.mark.parametrize(
        "late",
        [
            canceled(cancel_answered_ns=at(2.0), cancel_accepted=False, status="succeeded"),
            canceled(**UNANSWERED, status="succeeded"),
            # An answer at the very end.
            canceled(
                status="succeeded", end_s=1.31, cancel_answered_ns=at(2.3), cancel_accepted=False
            ),
        ],
    )
    def test_it_is_recognised_by_a_late_answer(self, late):
        assert "its executor is busy while" in failing("action.cancels", acting(late), **FIB)

    def test_it_is_the_students_on_any_machine_unless_that_took_all_the_time(self):
        run = acting(self.BLOCKED, calls=(), disturbance=taken(2.0, 2.1, waited_s=0.037))
        found = failing("action.cancels", run, **FIB)
        assert "its executor is busy while" in found and "spins" not in found
        starved = acting(self.BLOCKED, calls=(), disturbance=taken(2.0, 2.1, waited_s=3.0))
        assert judge("action.cancels", starved, **FIB).status is Status.ERROR
