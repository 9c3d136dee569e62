"""callbacks.*: reports of starts and ends become runs, and runs are judged."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from assignments.executors.checks.callback_run import read_reports
from grader.assignment.load import load_assignment
from grader.findings.finding import Status
from grader.recording.model import Kind
from tests.checks.builder import (
    NODE,
    at,
    declared,
    died,
    endpoint,
    failing,
    judge,
    message,
    output,
    recording,
    taken,
    traceback,
)

EVENTS = "/events"
STRING = "std_msgs/msg/String"
STOP_S = 6.5
TIMERS = ("timer_1", "timer_2")


def report(time_s, text, sequence=1):
    return message(time_s, {"data": text}, sequence=sequence, topic=EVENTS, type=STRING)


def reports(*runs):
    """Messages of runs, each given as (callback, begin, end or None)."""
    texts = [(begin, f"{name} start") for name, begin, _ in runs]
    texts += [(end, f"{name} end") for name, _, end in runs if end is not None]
    return tuple(
        report(time_s, text, number) for number, (time_s, text) in enumerate(sorted(texts), 1)
    )


def run(*runs, sent_s=(), **changes):
    """A run in which callbacks reported, and messages were sent to /chatter at these times."""
    defaults = {
        "messages": {EVENTS: reports(*runs)} if runs else {},
        "endpoints": (endpoint(EVENTS, type=STRING),),
        "sent": {
            "/chatter": tuple(
                message(time_s, {"data": "hello"}, sequence=number, topic="/chatter", type=STRING)
                for number, time_s in enumerate(sent_s, 1)
            )
        },
        "stop_s": STOP_S,
        "end_s": STOP_S + 0.1,
        "declarations": (),
    }
    return recording(**{**defaults, **changes})


def serial():
    """One thread: the second timer waits for the first, a message for both."""
    found = []
    for second in range(1, 6):
        found.append(("timer_1", second, second + 0.4))
        found.append(("timer_2", second + 0.401, second + 0.801))
        if second < 4:
            found.append(("chatter", second + 0.802, second + 0.99))
    return found


def parallel():
    """Several threads: the timers together, messages one after the other."""
    found = []
    for second in range(1, 6):
        found.append(("timer_1", second, second + 0.4))
        found.append(("timer_2", second + 0.001, second + 0.401))
    found += [("chatter", 2.6 + 0.2 * index, 2.8 + 0.2 * index) for index in range(8)]
    return found


def only(runs, *names):
    return [item for item in runs if item[0] in names]


def judged(check, subject, callbacks, **more):
    return judge(f"callbacks.{check}", subject, topic=EVENTS, callbacks=list(callbacks), **more)


def failed(check, subject, callbacks, **more):
    return failing(f"callbacks.{check}", subject, topic=EVENTS, callbacks=list(callbacks), **more)


class TestReports:
    def test_starts_and_ends_of_one_callback_are_paired_in_order(self):
        found = read_reports(reports(("chatter", 1.0, 1.2), ("chatter", 1.1, 1.3)))
        assert [(item.begin_ns, item.end_ns) for item in found.runs] == [
            (at(1.0), at(1.2)),
            (at(1.1), at(1.3)),
        ]

    def test_a_start_without_an_end_and_an_end_without_a_start(self):
        found = read_reports((report(1.0, "timer_1 start"), report(2.0, "chatter end")))
        assert found.runs[0].end_ns is None
        assert found.orphans == ("chatter",)
        assert found.callbacks == ("timer_1", "chatter")

    @pytest.mark.parametrize("text", [" timer_1 start", "timer_1  start", "timer_1 start\n"])
    def test_white_space_does_not_matter(self, text):
        assert read_reports((report(1.0, text),)).callbacks == ("timer_1",)

    @pytest.mark.parametrize("text", ["timer_1 started", "start timer_1", "", "start", "timer_1"])
    def test_what_is_no_report(self, text):
        found = read_reports((report(1.0, text),))
        assert found.strange == (text,)
        assert not found.runs

    @given(st.text())
    def test_any_text_can_be_read(self, text):
        found = read_reports((report(1.0, text), report(2.0, text)))
        assert len(found.strange) + len(found.runs) + len(found.orphans) == 2


class TestRun:
    def test_timers_at_their_period(self):
        for runs in (serial(), parallel()):
            finding = judged("run", run(*runs), TIMERS, period="1 s")
            assert finding.status is Status.PASSED
            assert finding.observed == "`timer_1` ran 5 times and `timer_2` ran 5 times"
            assert len(finding.evidence.spans) == len(runs)

    def test_a_run_that_was_interrupted_at_the_end_counts_as_started(self):
        runs = [*only(parallel(), "timer_1"), ("timer_1", 6.0, None)]
        finding = judged("run", run(*runs), ["timer_1"], period="1 s")
        assert finding.status is Status.PASSED
        assert finding.evidence.spans[-1].end_s == STOP_S

    def test_another_period_loses_points_and_is_reported(self):
        runs = [("timer_1", 0.5 + 2 * index, 0.9 + 2 * index) for index in range(3)]
        words = failed("run", run(*runs), ["timer_1"], period="1 s")
        assert "`timer_1` starts every 2 s (median)" in words
        runs = [("timer_1", 0.5 + 0.5 * index, 0.9 + 0.5 * index) for index in range(10)]
        words = failed("run", run(*runs), ["timer_1"], period="1 s")
        assert "starts every 500 ms" in words

    def test_a_period_that_the_machine_made_long_is_our_fault(self):
        runs = [("timer_1", 1 + 1.3 * index, 1.4 + 1.3 * index) for index in range(4)]
        disturbed = tuple(
            sample for index in range(4)
            for sample in taken(1.5 + 1.3 * index, 1.6 + 1.3 * index, waited_s=0.3)
        )  # fmt: skip
        finding = judged("run", run(*runs, disturbance=disturbed), ["timer_1"], period="1 s")
        assert finding.status is Status.ERROR
        assert finding.disturbed

    def test_a_thread_that_is_never_free_is_not_a_wrong_period(self):
        begins = [1.0 + 0.405 * index for index in range(13)]
        names = ["timer_1", "timer_2", "chatter"] * 4 + ["timer_1"]
        runs = [(name, begin, begin + 0.4) for name, begin in zip(names, begins, strict=True)]
        finding = judged("run", run(*runs), TIMERS, period="1 s")
        assert finding.status is Status.PASSED

    def test_who_comes_first_to_a_lock_may_change(self):
        """As seen of two timers of 1 s that waited for the same lock."""
        begins = [(1.366, 1.767), (2.366, 2.768), (3.371, 3.773), (4.779, 4.375), (5.38, 5.781)]
        runs = [
            (name, begin, begin + 0.4)
            for row in begins
            for name, begin in zip(TIMERS, row, strict=True)
        ]
        messages = [("chatter", begin, begin + 0.2) for begin in (3.17, 4.174, 5.179)]
        runs = sorted([*runs, *messages], key=lambda item: item[1])
        assert "too often" in failed("run", run(*runs), TIMERS, period="1 s")
        right = tuple(declared("timer", node=NODE, period_s=1.0) for _ in TIMERS)
        finding = judged("run", run(*runs, declarations=right), TIMERS, period="1 s")
        assert finding.status is Status.PASSED
        told = run(*runs, declarations=(*right, *right))
        assert "too often" in failed("run", told, TIMERS, period="1 s")

    def test_a_thread_that_is_never_free_hides_a_wrong_period(self):
        begins = [1.0 + 0.405 * index for index in range(13)]
        names = ["timer_1", "timer_2", "chatter"] * 4 + ["timer_1"]
        runs = [(name, begin, begin + 0.4) for name, begin in zip(names, begins, strict=True)]
        told = tuple(declared("timer", node=NODE, period_s=0.5) for _ in TIMERS)
        finding = judged("run", run(*runs, declarations=told), TIMERS, period="1 s")
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        assert "the process declared a timer of 500 ms" in finding.observed
        right = tuple(declared("timer", node=NODE, period_s=1.0) for _ in TIMERS)
        finding = judged("run", run(*runs, declarations=right), TIMERS, period="1 s")
        assert finding.status is Status.PASSED
        free = run(*only(parallel(), "timer_1"), declarations=told)
        assert judged("run", free, ["timer_1"], period="1 s").status is Status.PASSED

    def test_a_short_period_is_reported_where_the_median_is_right_by_chance(self):
        """Two timers of 0.5 s that work 0.4 s, and a message in every second round of them."""
        runs, now_s = [], 1.0
        for number in range(7):
            for name in TIMERS:
                runs.append((name, now_s, now_s + 0.4))
                now_s += 0.4
            if number % 2:
                runs.append(("chatter", now_s, now_s + 0.2))
                now_s += 0.2
        words = failed("run", run(*runs, stop_s=8.0, end_s=8.1), TIMERS, period="1 s")
        assert "`timer_1` starts 7 times in 5.4 s: too often" in words
        busy = run(*runs, stop_s=8.0, end_s=8.1, disturbance=taken(1.0, 3.0, waited_s=0.5))
        finding = judged("run", busy, TIMERS, period="1 s")
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    @given(late_s=st.lists(st.floats(0.0, 0.24), min_size=4, max_size=8))
    def test_starts_that_are_late_are_not_too_often(self, late_s):
        runs = [("timer_1", 1 + i + late, 1.4 + i + late) for i, late in enumerate(late_s)]
        finding = judged("run", run(*runs, stop_s=10.0, end_s=10.1), ["timer_1"], period="1 s")
        assert "too often" not in finding.observed

    @pytest.mark.parametrize("period_s", [1.2, 1.5])
    def test_a_wrong_period_beside_the_work_of_others_is_reported(self, period_s):
        mine = [("timer_1", 1 + period_s * i, 1.4 + period_s * i) for i in range(4)]
        others = [("timer_2", 1.2 + i, 1.6 + i) for i in range(5)]
        words = failed("run", run(*mine, *others), ["timer_1"], period="1 s")
        assert "`timer_1` starts every" in words

    def test_a_period_a_little_longer_beside_messages_is_reported(self):
        """Two timers of 1.1 s in one thread: a message fills what is left but for 0.1 s."""
        runs = []
        for number in range(1, 6):
            now_s = 1.1 * number
            runs += [("timer_1", now_s, now_s + 0.4), ("timer_2", now_s + 0.401, now_s + 0.8)]
            if number < 4:
                runs.append(("chatter", now_s + 0.801, now_s + 1.0))
        told = tuple(declared("timer", node=NODE, period_s=1.1) for _ in TIMERS)
        words = failed("run", run(*runs, declarations=told), TIMERS, period="1 s", tolerance="7 %")
        assert "`timer_1` starts every 1.1 s" in words

    def test_a_node_that_was_made_twice_is_reported(self):
        runs = [
            ("timer_1", at_s + late_s, at_s + 0.4) for at_s in range(1, 6) for late_s in (0, 0.1)
        ]
        node = declared("node", node=NODE)
        words = failed("run", run(*runs, declarations=(node, node)), ["timer_1"], period="1 s")
        assert f"The process made the node `{NODE}` twice" in words
        runs = [("chatter", at_s, at_s + 0.2) for at_s in (1.0, 1.3, 2.0, 2.3)]
        words = failed(
            "run",
            run(*runs, sent_s=(0.9, 1.9), declarations=(node, node)),
            ["chatter"],
            stimulus="/chatter",
        )
        assert f"The process made the node `{NODE}` twice" in words

    def test_too_few_runs_lose_and_are_counted(self):
        words = failed("run", run(*only(serial(), "timer_1")[:2]), ["timer_1"], period="1 s")
        assert "ran only 2 times" in words

    def test_one_run_for_each_message(self):
        subject = run(*parallel(), sent_s=[2.5] * 8)
        finding = judged("run", subject, ["chatter"], stimulus="/chatter")
        assert finding.status is Status.PASSED

    def test_messages_that_were_dropped(self):
        words = failed("run", run(*parallel(), sent_s=[2.5] * 10), ["chatter"], stimulus="/chatter")
        assert "started 8 times and ended 8 times for 10 messages" in words
        assert "queue size" in words
        assert "an `if` that leaves messages out" in words

    def test_messages_that_wait_behind_others_do_not_count(self):
        busy = [("timer_1", 1 + 0.4 * index, 1.4 + 0.4 * index) for index in range(13)]
        runs = [*busy, *(("chatter", 6.2 + 0.05 * i, 6.25 + 0.05 * i) for i in range(4))]
        finding = judged("run", run(*runs, sent_s=[2.5] * 8), ["chatter"], stimulus="/chatter")
        assert finding.status is Status.PASSED

    def test_a_second_run_for_a_message(self):
        words = failed("run", run(*parallel(), sent_s=[2.5] * 4), ["chatter"], stimulus="/chatter")
        assert "for 4 messages" in words
        assert "Create one subscription" in words

    def test_a_message_that_was_never_sent_costs_nothing(self):
        ends = (endpoint("/chatter", kind=Kind.SUBSCRIPTION, type=STRING),)
        subject = run(*parallel(), endpoints=ends)
        assert judged("run", subject, ["chatter"], stimulus="/chatter").status is Status.ERROR
        deaf = failed("run", run(*parallel()), ["chatter"], stimulus="/chatter")
        assert "created no subscription" in deaf

    def test_only_one_thing_calls_them(self):
        with pytest.raises(ValueError, match="either 'period' or 'stimulus'"):
            judged("run", run(*parallel()), TIMERS, period="1 s", stimulus="/chatter")

    def test_without_a_period_or_messages_it_is_enough_that_they_ran(self):
        runs = only(parallel(), "timer_1")[:2]
        assert judged("run", run(*runs), ["timer_1"], at_least=2).status is Status.PASSED
        assert "ran only 2 times" in failed("run", run(*runs), ["timer_1"], at_least=3)
        starved = run(*runs, disturbance=taken(1.0, 7.0, waited_s=5.0))
        assert judged("run", starved, ["timer_1"], at_least=3).status is Status.ERROR


class TestNearMisses:
    def test_no_report_at_all(self):
        assert EVENTS in failed("run", run(), TIMERS, period="1 s")

    def test_another_name_of_a_callback_is_reported(self):
        runs = [("Timer1", *item[1:]) for item in only(parallel(), "timer_1")]
        words = failed("run", run(*runs), ["timer_1"], period="1 s")
        assert "no report of `timer_1`, but reports of `Timer1`" in words

    def test_other_words_in_a_report_are_reported(self):
        subject = run(messages={EVENTS: (report(1.0, "timer_1 started"),)})
        words = failed("run", subject, ["timer_1"], period="1 s")
        assert "no message on `/events` is a report" in words
        assert "there is 'timer_1 started', for example" in words
        assert "such as `timer_1 start`" in words

    def test_starts_without_ends_are_reported(self):
        runs = [(name, begin, None) for name, begin, _ in only(parallel(), "timer_1")]
        words = failed("run", run(*runs), ["timer_1"], period="1 s")
        assert "`timer_1` reported 5 starts, but no ends" in words

    def test_ends_without_starts_are_reported(self):
        subject = run(messages={EVENTS: (report(1.0, "timer_1 end"),)})
        words = failed("run", subject, ["timer_1"], period="1 s")
        assert "reported its end, but never its start" in words

    def test_the_name_of_the_node_before_the_report(self):
        runs = [(f"[executor_demo] {name}", begin, end) for name, begin, end in serial()]
        words = failed("run", run(*runs), ["timer_1"], period="1 s")
        assert "no report of `timer_1`, but reports of `[executor_demo] timer_1`" in words
        assert "`timer_1 start` or `timer_1 end`, exactly so, with nothing before it" in words

    def test_one_callback_never_ran(self):
        words = failed("run", run(*only(parallel(), "timer_1")), TIMERS, period="1 s")
        assert "`timer_2` never ran; reports came of `timer_1`" in words

    def test_a_process_that_ended_is_reported_first(self):
        words = failed(
            "run", run(("timer_1", 1.0, None), processes=(died(1, 1.4),),
                       log=output(traceback("AttributeError: no attribute 'evnts'"))),
            ["timer_1"], period="1 s",
        )  # fmt: skip
        assert "AttributeError" in words
        assert "node.py:14" in words


class TestWork:
    def test_as_long_as_it_should(self):
        assert judged("work", run(*serial()), TIMERS, duration="400 ms").status is Status.PASSED

    def test_milliseconds_in_place_of_seconds_are_reported(self):
        runs = [("timer_1", second, second + 0.0004) for second in (1, 2, 3)]
        words = failed("work", run(*runs), ["timer_1"], duration="400 ms")
        assert "works 400 us (median of 3 runs)" in words
        assert "work with time.sleep(0.4)" in words

    def test_the_work_of_another(self):
        words = failed("work", run(*serial()), ["timer_1"], duration="200 ms")
        assert "works 400 ms" in words
        assert "time.sleep(0.2)" in words
        assert "such as for a lock" in words

    def test_a_little_too_long(self):
        words = failed("work", run(*serial()), ["timer_1"], duration="300 ms")
        assert "time.sleep(0.3)" in words

    def test_what_the_machine_took_is_our_fault(self):
        runs = [("timer_1", second, second + 0.6) for second in (1, 2, 3)]
        disturbed = tuple(
            sample for second in (1, 2, 3)
            for sample in taken(second + 0.1, second + 0.2, waited_s=0.2)
        )  # fmt: skip
        finding = judged("work", run(*runs, disturbance=disturbed), ["timer_1"], duration="400 ms")
        assert finding.status is Status.ERROR
        assert finding.disturbed

    def test_what_the_machine_took_does_not_make_work_short(self):
        runs = [("timer_1", second, second + 0.1) for second in (1, 2, 3)]
        disturbed = taken(1.0, 3.2, waited_s=5.0)
        subject = run(*runs, disturbance=disturbed)
        finding = judged("work", subject, ["timer_1"], duration="400 ms")
        assert finding.status is Status.FAILED


class TestNeverOverlap:
    EVERYBODY = (*TIMERS, "chatter")

    def test_one_after_the_other(self):
        finding = judged("never_overlap", run(*serial()), self.EVERYBODY)
        assert finding.status is Status.PASSED
        assert finding.observed == "13 runs, one after the other"

    def test_end_and_start_at_the_same_instant(self):
        runs = [("timer_1", 1.0, 1.4), ("timer_2", 1.4, 1.8), ("timer_1", 1.8, 2.2),
                ("timer_2", 2.2, 2.6)]  # fmt: skip
        assert judged("never_overlap", run(*runs), TIMERS).status is Status.PASSED

    def test_timers_at_the_same_time(self):
        subject = run(*parallel(), declarations=(
            declared("spin", executor="MultiThreadedExecutor", threads=4),
        ))  # fmt: skip
        words = failed("never_overlap", subject, self.EVERYBODY)
        assert (
            "`timer_1` and `timer_2` ran at the same time for 399 ms, 1.00 s after launch" in words
        )
        assert "the process declared a `MultiThreadedExecutor` with 4 threads" in words

    def test_threads_of_its_own(self):
        """What one thread of an executor cannot do, other threads did."""
        single = declared("spin", executor="SingleThreadedExecutor", threads=1)
        words = failed("never_overlap", run(*parallel(), declarations=(single,)), self.EVERYBODY)
        assert "a thread that a callback starts" in words

    def test_one_exclusive_group_does_not_run_twice_by_itself(self):
        runs = [("chatter", 2.0 + 0.1 * index, 2.2 + 0.1 * index) for index in range(4)]
        several = declared("spin", executor="MultiThreadedExecutor", threads=4)
        for group, words in (
            ("MutuallyExclusiveCallbackGroup", "a thread that a callback starts"),
            ("ReentrantCallbackGroup", "those of one MutuallyExclusiveCallbackGroup"),
        ):
            subscription = declared("subscription", group={"type": group, "id": 1})
            subject = run(*runs, declarations=(several, subscription))
            assert words in failed("never_overlap", subject, ["chatter"])

    def test_the_bars_that_overlap_are_marked(self):
        finding = judged("never_overlap", run(*parallel()), TIMERS)
        wrong = [span.name for span in finding.evidence.spans if span.wrong]
        assert wrong == ["timer_1", "timer_2"] * 5

    def test_a_callback_with_itself(self):
        runs = [("chatter", 2.0 + 0.1 * index, 2.2 + 0.1 * index) for index in range(4)]
        words = failed("never_overlap", run(*runs), ["chatter"])
        assert "`chatter` ran twice at the same time for 100 ms" in words
        assert "MutuallyExclusiveCallbackGroup" in words

    def test_callbacks_that_are_not_named_may_overlap(self):
        assert judged("never_overlap", run(*parallel()), ["chatter"]).status is Status.PASSED

    def test_a_callback_that_never_ran_proves_nothing(self):
        words = failed("never_overlap", run(*only(serial(), "timer_1")), TIMERS)
        assert "`timer_2` never ran" in words

    def test_a_disturbed_machine_is_no_excuse(self):
        subject = run(*parallel(), disturbance=taken(1.0, 5.0, waited_s=4.0))
        assert judged("never_overlap", subject, TIMERS).status is Status.FAILED


class TestOverlap:
    def overlap(self, subject, **more):
        return judged("overlap", subject, ["timer_1"], others=["timer_2"], **more)

    def words(self, subject, **more):
        return failed("overlap", subject, ["timer_1"], others=["timer_2"], **more)

    def of_cpp(self, group):
        """One after the other on a busy machine; the tracer saw the group of each call."""
        made = [declared("timer", number=number, period_s=1.0) for number in (1, 2)]
        calls = [
            declared(
                "ran",
                began_ns=at(begin) - 1000,
                ended_ns=at(end) + 1000,
                serves="/chatter" if name == "chatter" else "1 s",
                group=group,
            )
            for name, begin, end in serial()
        ]
        spun = declared("spin", executor="MultiThreadedExecutor", threads=4)
        busy = taken(1.0, 6.0, waited_s=4.0)
        return run(*serial(), declarations=(*made, spun, *calls), disturbance=busy)

    def test_a_busy_machine_is_no_excuse_where_one_group_keeps_them_apart(self):
        words = self.words(self.of_cpp("MutuallyExclusiveCallbackGroup 7"))
        assert "its timers in one `MutuallyExclusiveCallbackGroup`" in words
        assert "Without callback_group=..." in words
        for group in ("ReentrantCallbackGroup 7", "None"):
            assert self.overlap(self.of_cpp(group)).status is Status.ERROR

    def test_timers_that_run_together_pass(self):
        finding = self.overlap(run(*parallel()))
        assert finding.status is Status.PASSED
        assert finding.observed == "`timer_1` did so 5 times"

    def test_messages_during_timers_pass(self):
        finding = judged("overlap", run(*parallel()), ["chatter"], others=list(TIMERS))
        assert finding.status is Status.PASSED

    def test_a_moment_is_no_overlap(self):
        runs = [("timer_1", 1.0, 1.4), ("timer_2", 1.38, 1.78), ("timer_1", 2.0, 2.4),
                ("timer_2", 2.38, 2.78)]  # fmt: skip
        assert "never ran at the same time" in self.words(run(*runs))
        assert self.overlap(run(*runs), by="10 ms").status is Status.PASSED

    def test_one_thread_loses_and_is_named(self):
        spin = declared("spin", executor="SingleThreadedExecutor", threads=1)
        words = self.words(run(*serial(), declarations=(spin,)))
        assert "`timer_1` never ran at the same time as `timer_2`" in words
        assert "the process declared a `SingleThreadedExecutor`" in words
        assert "Create a MultiThreadedExecutor()" in words

    def test_one_mutually_exclusive_group(self):
        group = {"type": "MutuallyExclusiveCallbackGroup", "id": 7}
        declarations = (
            declared("spin", executor="MultiThreadedExecutor", threads=4),
            declared("timer", period_s=1.0, callback="a", group=group),
            declared("timer", period_s=1.0, callback="b", group=group),
        )
        words = self.words(run(*serial(), declarations=declarations))
        assert "its timers in one `MutuallyExclusiveCallbackGroup`" in words
        assert "Without callback_group=" in words

    def test_what_the_process_declares_proves_nothing(self):
        group = {"type": "ReentrantCallbackGroup", "id": 7}
        declarations = (
            declared("spin", executor="MultiThreadedExecutor", threads=4),
            declared("timer", period_s=1.0, callback="a", group=group),
            declared("timer", period_s=1.0, callback="b", group=group),
        )
        assert "look for a lock" in self.words(run(*serial(), declarations=declarations))
        assert "It takes both" in self.words(run(*serial()))

    def test_fewer_threads_than_callbacks(self):
        declarations = (
            declared("spin", executor="MultiThreadedExecutor", threads=2),
            declared("timer", period_s=1.0, callback="a", group={"type": "A", "id": 1}),
            declared("timer", period_s=1.0, callback="b", group={"type": "A", "id": 2}),
        )
        subject = run(*serial(), declarations=declarations)
        words = failed("overlap", subject, ["chatter"], others=list(TIMERS))
        assert "3 callbacks can run at once only if the executor has 3 threads or more" in words

    @pytest.mark.parametrize("cpus", ["1", "2"])
    def test_one_thread_is_the_students_choice(self, cpus):
        spin = declared("spin", executor="MultiThreadedExecutor", threads=1)
        subject = run(*serial(), declarations=(spin,), environment={"cpus": cpus})
        assert self.overlap(subject).status is Status.FAILED

    def test_what_the_machine_took_is_our_fault(self):
        runs = [("timer_1", 1.0, 1.4), ("timer_2", 1.5, 1.9), ("timer_1", 2.0, 2.4),
                ("timer_2", 2.5, 2.9)]  # fmt: skip
        disturbed = (*taken(1.1, 1.3, waited_s=0.45), *taken(2.1, 2.3, waited_s=0.45))
        finding = self.overlap(run(*runs, disturbance=disturbed))
        assert finding.status is Status.ERROR
        assert finding.disturbed

    def test_one_thread_is_no_fault_of_the_machine(self):
        disturbed = (*taken(1.1, 1.3, waited_s=0.45), *taken(2.1, 2.3, waited_s=0.45))
        spin = declared("spin", executor="MultiThreadedExecutor", threads=1)
        subject = run(*serial(), disturbance=disturbed, environment={"cpus": "2"})
        assert self.overlap(subject).status is Status.ERROR
        subject = dataclasses.replace(subject, declarations=(spin,))
        assert self.overlap(subject).status is Status.FAILED
        subject = dataclasses.replace(subject, declarations=(spin, spin))
        assert self.overlap(subject).status is Status.ERROR

    def test_a_little_disturbance_explains_nothing(self):
        subject = run(*serial(), disturbance=taken(1.0, 5.0, waited_s=0.01))
        assert self.overlap(subject).status is Status.FAILED

    @pytest.mark.parametrize(
        "data",
        [
            {"executor": 3, "threads": "many"},
            {"executor": ["MultiThreadedExecutor"], "threads": None},
            {},
        ],
    )
    def test_hostile_declarations_are_ignored(self, data):
        declarations = (declared("spin", **data), declared("timer", group=[1]))
        assert "declared" not in self.words(run(*serial(), declarations=declarations))


class TestTogether:
    ALL = (*TIMERS, "chatter")

    def two_threads(self):
        """Each callback is at the same time as another, but never all three."""
        found = []
        for second in (1, 2, 3):
            found.append(("timer_1", second, second + 0.4))
            found.append(("chatter", second - 0.1, second + 0.1))
            found.append(("timer_2", second + 0.101, second + 0.501))
            found.append(("chatter", second + 0.402, second + 0.602))
        return found

    def test_three_callbacks_at_once(self):
        finding = judged("together", run(*parallel()), self.ALL)
        assert finding.status is Status.PASSED
        # From 3.001 s to 3.4 s messages are worked on one right after the other.
        assert finding.observed == "they did so 3 times"

    def test_two_at_a_time_are_not_three(self):
        subject = run(
            *self.two_threads(),
            declarations=(declared("spin", executor="MultiThreadedExecutor", threads=2),),
        )
        assert judged("overlap", subject, ["timer_1"], others=["timer_2"]).status is Status.PASSED
        words = failed("together", subject, self.ALL)
        assert "`timer_1`, `timer_2` and `chatter` never ran all at the same time" in words
        assert "the process declared a `MultiThreadedExecutor` with 2 threads" in words
        assert "`MultiThreadedExecutor(num_threads=4)`" in words

    def test_a_moment_does_not_count(self):
        runs = [("timer_1", 1.0, 1.4), ("timer_2", 1.0, 1.4), ("chatter", 1.35, 1.55)]
        assert "never ran all" in failed("together", run(*runs), self.ALL)
        assert judged("together", run(*runs), self.ALL, by="40 ms").status is Status.PASSED
        assert "only 1 time ran all" in failed(
            "together", run(*runs), self.ALL, by="40 ms", at_least=2
        )

    def test_what_the_machine_took_is_our_fault(self):
        # Of three that began together, the last one was held back for 0.35 s.
        runs = [("timer_1", 1.0, 1.4), ("chatter", 1.05, 1.45), ("timer_2", 1.35, 1.75)]
        assert judged("together", run(*runs), self.ALL).status is Status.FAILED
        disturbed = taken(1.1, 1.3, waited_s=0.3)
        finding = judged("together", run(*runs, disturbance=disturbed), self.ALL)
        assert finding.status is Status.ERROR
        assert finding.disturbed

    @pytest.mark.parametrize(("threads", "status"), [(2, Status.FAILED), (3, Status.ERROR)])
    def test_two_threads_are_no_fault_of_the_machine(self, threads, status):
        runs = [("timer_1", 1.0, 1.4), ("chatter", 1.05, 1.45), ("timer_2", 1.35, 1.75)]
        spin = declared("spin", executor="MultiThreadedExecutor", threads=threads)
        disturbed = taken(1.1, 1.3, waited_s=0.3)
        subject = run(*runs, disturbance=disturbed, declarations=(spin,))
        assert judged("together", subject, self.ALL).status is status

    def test_what_the_machine_took_at_another_time_explains_nothing(self):
        disturbed = taken(1.55, 1.8, waited_s=0.3)
        subject = run(*self.two_threads(), disturbance=disturbed)
        assert judged("together", subject, self.ALL).status is Status.FAILED

    def test_without_reports_it_says_why(self):
        assert "chatter" in failed("together", run(*only(parallel(), *TIMERS)), self.ALL)

    @given(st.lists(st.tuples(st.sampled_from(ALL), st.integers(0, 60), st.integers(1, 20))))
    def test_as_if_every_moment_was_looked_at(self, drawn):
        runs = [(name, begin / 10, (begin + length) / 10) for name, begin, length in drawn]
        busy = [{name for name, begin, length in drawn if begin <= tick < begin + length}
                for tick in range(81)]  # fmt: skip
        expected = any(len(names) == len(self.ALL) for names in busy)
        subject = run(*runs, stop_s=9.0, end_s=9.1)
        finding = judged("together", subject, self.ALL, by="90 ms")
        assert (finding.status is Status.PASSED) == expected


def test_the_assignment_uses_these_checks():
    used = {check.spec.uses for check in load_assignment("executors").checks}
    assert used >= {
        "callbacks.run", "callbacks.work", "callbacks.never_overlap", "callbacks.overlap",
        "callbacks.together",
    }  # fmt: skip
