"""log.contains, log.level, log.rate: what loggers say, once each."""

import itertools
from dataclasses import replace

from grader.checks.log.log_content import logged
from grader.findings.finding import Status
from grader.recording.model import Ending
from tests.checks.builder import (
    at,
    call,
    declarations,
    declared,
    died,
    failing,
    judge,
    output,
    process,
    recording,
    taken,
    traceback,
)
from tests.checks.requests import logs

PASSED = Status.PASSED
READY = {"text": "ready", "level": "INFO"}


def logging(*records, **changes):
    return recording(log=tuple(itertools.chain(*records)), **changes)


class TestRecords:
    def test_rosout_and_the_written_line_are_one(self):
        (record,) = logged(logging(logs("ready")))
        assert (record.text, record.level, record.logger) == ("ready", "INFO", "bot_publisher")
        assert record.time_ns == at(1.0)

    def test_without_rosout_the_written_line_is_read(self):
        (record,) = logged(logging(logs("ready")[1:]))
        assert (record.text, record.level, record.logger) == ("ready", "INFO", "bot_publisher")
        assert record.time_ns == at(1.0)

    def test_printed_lines_are_none(self):
        assert not logged(logging(output("[INFO] not a logger\nready")))


class TestNumbers:
    def test_a_number_in_the_record_is_judged_however_it_is_written(self):
        run = logging(logs("distance=1.37m"))
        assert judge("log.contains", run, text="distance", number="1.3 .. 1.4").status is PASSED
        assert judge("log.contains", run, number="> 1").status is PASSED
        assert "none" in failing("log.contains", run, text="distance", number="< 1").split("|")[0]

    def test_a_printed_number_counts_where_the_assignment_says_so(self):
        run = logging(logs("ready"), output("distance 1.37", stream="stdout"))
        wanted = {"text": "distance", "number": "1.3 .. 1.4"}
        assert "is printed, not logged" in failing("log.contains", run, **wanted)
        found = judge("log.contains", run, **wanted, printed=True)
        assert found.status is PASSED
        assert found.evidence.log == ("distance 1.37",)

    def test_a_logged_line_counts_once_where_printed_lines_count(self):
        run = logging(logs("distance 1.37"))
        assert judge("log.contains", run, number=1.37, printed=True, at_most=1).status is PASSED

    def test_ros2_launch_itself_need_not_spin(self):
        launch = "bringup/robot.launch.py"
        run = logging(
            logs("ready"),
            processes=(process(), process(launch)),
            declarations=(*declarations(), declared("started", 0.1, launch)),
        )
        found = failing("log.contains", run, text="distance", printed=True)
        assert "never called" not in found
        assert "output='screen'" in found


class TestContains:
    def test_upper_and_lower_case_alike(self):
        finding = judge("log.contains", logging(logs("Ready to go")), **READY)
        assert finding.status is Status.PASSED
        assert finding.observed == "1, such as `Ready to go`"

    def test_a_pattern_is_found(self):
        run = logging(logs("x = 1.25"), logs("x = ?", 2.0))
        finding = judge("log.contains", run, pattern=r"x = \d+\.\d+$", at_most=1)
        assert finding.status is Status.PASSED

    def test_another_level_is_reported(self):
        found = failing("log.contains", logging(logs("ready", level="WARN")), **READY)
        assert "`ready` is logged as WARN, not as INFO" in found

    def test_what_is_only_printed_is_reported(self):
        found = failing("log.contains", logging(output("ready", stream="stdout")), **READY)
        assert "`ready` is printed, not logged" in found

    def test_a_similar_line_is_shown(self):
        found = failing("log.contains", logging(logs("reday")), **READY)
        assert "similar is `reday`" in found

    def test_a_timer_that_never_comes_to_log(self):
        blocked = logging(calls=(call(0.5, None), call(1.5, None), call(2.5, None)))
        found = failing("log.contains", blocked, **READY)
        assert "something blocks the executor" in found
        assert "get_logger" not in found
        slow = logging(calls=tuple(call(0.5 + 0.6 * n, 0.55) for n in range(5)))
        found = failing("log.rate", slow, text="ready", at_least="1 Hz")
        assert "the callbacks keep each other waiting" in found
        assert "get_logger" not in found

    def test_an_empty_log_is_reported(self):
        assert "the node logs nothing" in failing("log.contains", recording(), **READY)

    def test_too_many_lines_are_counted(self):
        run = logging(*(logs("ready", 1.0 + n) for n in range(3)))
        found = failing("log.contains", run, **READY, at_most=1)
        assert "3 of them" in found and "once=True" in found

    def test_of_a_node_with_its_children(self):
        run = logging(logs("ready", logger="bot_publisher.arm"), logs("ready", 2.0, logger="other"))
        finding = judge("log.contains", run, **READY, node="bot_publisher", at_most=1)
        assert finding.status is Status.PASSED

    def test_a_process_that_died_first(self):
        run = recording(
            processes=(died(1),), ending=Ending.EXITED, log=output(traceback("KeyError: 'x'"))
        )
        assert "KeyError: 'x'" in failing("log.contains", run, **READY)

    def test_after_sigint_does_not_count(self):
        found = failing("log.contains", logging(logs("ready", 4.55)), **READY)
        assert "logs nothing" in found


class TestLevel:
    def test_a_log_without_higher_levels_passes(self):
        run = logging(logs("a"), logs("b", 2.0, level="WARN"))
        assert judge("log.level", run, at_most="WARN").status is Status.PASSED

    def test_the_first_above_is_named(self):
        run = logging(logs("a"), logs("no map", 2.0, level="ERROR"))
        found = failing("log.level", run, at_most="WARN")
        assert "1 log message above it, the first ERROR: `no map`" in found


class TestRate:
    def test_one_line_a_second_passes(self):
        run = logging(*(logs("tick", 0.5 + n) for n in range(4)))
        finding = judge("log.rate", run, text="tick", rate="1 Hz")
        assert (finding.status, finding.observed) == (Status.PASSED, "1 Hz")

    def test_a_flooded_log_loses(self):
        run = logging(*(logs("tick", 0.5 + 0.1 * n) for n in range(30)))
        found = failing("log.rate", run, text="tick", at_most="2 Hz")
        assert "30 log messages, 10 Hz" in found and "throttle_duration_sec" in found

    def test_falling_silent_costs_as_much_as_too_seldom(self):
        run = logging(*(logs("tick", 0.5 + 0.1 * n) for n in range(10)))
        found = failing("log.rate", run, text="tick", rate="10 Hz")
        assert "10 log messages, but none in the last" in found and "must go on logging" in found
        assert judge("log.rate", run, text="tick", at_most="10 Hz").status is Status.PASSED

    def test_silence_that_the_machine_made_is_no_fault_of_the_node(self):
        stopped = logging(*(logs("tick", 0.5 + 0.1 * n) for n in range(10)))
        end_s = stopped.since_launch_s(stopped.stop_ns)
        run = replace(stopped, disturbance=taken(1.4, end_s, waited_s=end_s - 1.4))
        assert judge("log.rate", run, text="tick", rate="10 Hz").disturbed

    def test_too_seldom_because_of_the_machine(self):
        run = logging(
            *(logs("tick", 0.5 + 1.5 * n) for n in range(3)),
            disturbance=taken(0.5, 3.5, waited_s=1.5),
        )
        assert judge("log.rate", run, text="tick", at_least="1 Hz").disturbed

    def test_a_log_without_such_lines_loses(self):
        found = failing("log.rate", recording(), text="tick", rate="1 Hz")
        assert "the node logs nothing" in found
