"""service.*: there, answering as it must, and during slow calls."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import Ending
from tests.checks.builder import (
    NODE,
    SOURCE,
    at,
    call,
    declared,
    died,
    failing,
    judge,
    output,
    taken,
    traceback,
)
from tests.checks.requests import SET_BOOL, asked, service, serving

ENABLE = {"service": "/enable"}
TRUE = {**ENABLE, "response": {"success": True}}
REFUSED = {"success": False, "message": "x"}
RANGE = {"contains": {"message": "range"}}
SPIN_OF_OTHERS = declared("spin", executor="MultiThreadedExecutor", threads=4, tells_added=True)
SLOW = {**ENABLE, "takes": "400 ms"}


class TestExists:
    def test_by_name_and_type(self):
        finding = judge("service.exists", serving(), service="/enable", type=SET_BOOL)
        assert finding.status is Status.PASSED
        assert finding.observed.startswith("`/bot_publisher` offers it")

    @pytest.mark.parametrize(
        ("there", "words"),
        [
            ("/enabel", "offers the service `/enabel` instead of `/enable`"),
            ("/Enable", "upper and lower case differ"),
            ("/bot_publisher/enable", "`/bot_publisher` stands in front of the name"),
            ("/robot/enable", "`/robot` stands in front of the name"),
        ],
    )
    def test_near_misses_of_a_service_are_named(self, there, words):
        assert words in failing("service.exists", serving(services=(service(there),)), **ENABLE)

    def test_another_type_of_service_is_named(self):
        run = serving(services=(service(type="std_srvs/srv/Trigger"),))
        found = failing("service.exists", run, service="/enable", type=SET_BOOL)
        assert "has the type `std_srvs/srv/Trigger`" in found
        assert "`from std_srvs.srv import SetBool`" in found

    def test_one_that_is_gone_before_it_answered_anything_is_not_offered(self):
        gone = {"services": (replace(service(), vanished_ns=at(0.9)),)}
        unanswered = asked(answer_s=None, error="no server")
        found = failing("service.exists", serving(unanswered, **gone), **ENABLE)
        assert "the service `/enable` was destroyed 0.90 s after launch" in found
        # A lifecycle node may be asked to destroy it, and what ends with its process is no loss.
        for run in (
            serving(asked(0.5), **gone),
            serving(asked(0.5, name="/bot_publisher/change_state"), **gone),
            serving(**gone, processes=(died(0, 0.9),), ending=Ending.EXITED),
            serving(services=(replace(service(), vanished_ns=at(4.2)),)),
        ):
            assert judge("service.exists", run, **ENABLE).status is Status.PASSED

    def test_parameter_services_are_not_offered_as_what_there_is(self):
        run = serving(services=(service("/bot_publisher/get_parameters"),))
        found = failing("service.exists", run, **ENABLE)
        assert "`/bot_publisher` created no service" in found
        assert "self.create_service(Type, 'enable', self.callback)" in found


class TestResponds:
    def test_in_time_with_the_expected_fields(self):
        finding = judge("service.responds", serving(asked()), **TRUE, contains={"message": "ENABL"})
        assert finding.status is Status.PASSED
        assert finding.observed == "1 call, answered within 10 ms"

    def test_only_calls_with_the_request_are_judged(self):
        calls = (asked(), asked(2.0, request={"data": False}, response={"success": False}))
        assert judge("service.responds", serving(*calls), **TRUE).status is Status.FAILED
        run = serving(*calls)
        finding = judge("service.responds", run, **TRUE, request={"data": True})
        assert finding.status is Status.PASSED

    def test_of_a_long_request_only_fields_that_are_not_zero_are_shown(self):
        zeros = {"header": {"stamp": {"sec": 0}, "frame_id": ""}, "d": [], "k": [0.0] * 9}
        request = {**zeros, "width": 640, "rectify": False, "height": 480}
        run = serving(asked(request=request, response={"success": False}))
        found = failing("service.responds", run, **TRUE)
        assert found.startswith("the call (width = 640, height = 480) was answered")
        run = serving(asked(request={**zeros, "a": 0, "b": 0, "c": 0}, response={"success": False}))
        assert "(every field zero or empty)" in failing("service.responds", run, **TRUE)

    @pytest.mark.parametrize(
        ("call", "words"),
        [
            (
                asked(response={"success": False, "message": "x"}),
                "the call (data = true) was answered with",
            ),
            (asked(response={"success": False, "message": "x"}), "success = false instead of true"),
            (asked(), "message = 'enabled' without “range”"),
            (asked(response=REFUSED), "sets `success` of the response"),
            (asked(response={"success": False, "message": ""}), "the value of a new one"),
            (asked(answer_s=1.5), "was not answered for 1.5 s"),
        ],
    )
    def test_a_wrong_or_late_answer_is_reported_with_the_request(self, call, words):
        assert words in failing("service.responds", serving(call), **TRUE, **RANGE)

    def test_the_process_died_of_the_call(self):
        run = serving(
            asked(answer_s=None), processes=(died(1, 1.1),), ending=Ending.EXITED,
            log=output(traceback("ZeroDivisionError: division by zero")),
        )  # fmt: skip
        found = failing("service.responds", run, **TRUE)
        assert "was not answered: the process" in found
        assert f"ZeroDivisionError: division by zero ({SOURCE}:14)" in found

    @pytest.mark.parametrize(
        ("calls", "declarations", "words"),
        [
            ((), (declared("started"),), "rclpy.spin() was never called"),
            (
                (),
                (declared("started"), declared("node", node=NODE), SPIN_OF_OTHERS),
                "was not added to it",
            ),
            ([call(1.5 + 0.5 * n, None) for n in range(4)], (), "something blocks the executor"),
            ([call(1.5 + 0.5 * n) for n in range(4)], (), "although the node's executor spins"),
            ((), (), "was not answered |"),
        ],
    )
    def test_no_answer_is_explained_by_what_the_executor_does(self, calls, declarations, words):
        more = {"declarations": declarations} if declarations else {}
        run = serving(asked(answer_s=None), *calls, **more)
        assert words in failing("service.responds", run, **TRUE)

    def test_the_machine_took_the_time(self):
        run = serving(asked(answer_s=1.5), disturbance=taken(1.0, 2.5, waited_s=0.8))
        finding = judge("service.responds", run, **TRUE)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_an_answer_that_was_not_due_yet_costs_no_point(self):
        run = serving(asked(4.4, None))
        finding = judge("service.responds", run, **TRUE, within="1 s")
        assert finding.status is Status.ERROR
        assert "the run ended 100 ms later, before the answer was due" in finding.observed

    def test_an_interface_that_is_not_installed_is_our_error(self):
        run = serving(asked(answer_s=None, error="the interface x/srv/Y is not installed"))
        finding = judge("service.responds", run, **TRUE)
        assert finding.status is Status.ERROR
        assert "could not be asked: the interface x/srv/Y is not installed" in finding.observed

    def test_a_field_that_the_response_has_not_is_the_authors_mistake(self):
        finding = judge("service.responds", serving(asked()), **ENABLE, response={"sucess": True})
        assert finding.status is Status.ERROR
        assert "Did you mean 'success'?" in finding.observed

    def test_a_call_that_was_never_made_is_no_students_fault(self):
        assert judge("service.responds", serving(), **TRUE).status is Status.ERROR


class TestConcurrent:
    def test_calls_worked_on_side_by_side_pass(self):
        run = serving(asked(1.0, 0.4), asked(1.001, 0.41))
        assert judge("service.concurrent", run, **SLOW).status is Status.PASSED
        one_after_another = {**SLOW, "calls": "one_after_another"}
        found = failing("service.concurrent", run, **one_after_another)
        assert "both were processed at the same time" in found

    def test_calls_worked_on_one_after_another_pass(self):
        run = serving(asked(1.0, 0.4), asked(1.001, 0.8))
        finding = judge("service.concurrent", run, **SLOW, calls="one_after_another")
        assert finding.status is Status.PASSED
        found = failing("service.concurrent", run, **SLOW)
        assert "the second call waited until the first was answered" in found
        assert "`SingleThreadedExecutor`" in found
        assert "ReentrantCallbackGroup" in found

    def test_a_busy_machine_is_no_students_fault(self):
        run = serving(asked(1.0, 0.4), asked(1.001, 0.8), disturbance=taken(1.0, 1.9, waited_s=0.4))
        assert judge("service.concurrent", run, **SLOW).disturbed

    def test_calls_that_do_not_overlap_say_nothing(self):
        run = serving(asked(1.0, 0.4), asked(2.0, 0.4))
        assert judge("service.concurrent", run, **SLOW).status is Status.ERROR
