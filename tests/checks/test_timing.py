"""timing.period: robust against the machine, strict with the student."""

from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from grader.findings.finding import Status
from grader.recording.event import Disturbance
from grader.recording.model import NS
from tests.checks.builder import (
    PERIOD_S,
    after,
    at,
    declarations,
    every,
    failing,
    judge,
    message,
    messages,
    recording,
    taken,
)


def period(run, **parameters):
    return judge("timing.period", run, topic="/cmd_vel", **{"period": "300 ms", **parameters})


def spaced(intervals_s, **changes):
    """A run with these intervals between the messages."""
    times = after(intervals_s)
    return recording(**{"messages": messages(times), "stop_s": max(times) + 0.2, **changes})


def wrong(run):
    """The text of the finding about a run at a wrong period."""
    return failing("timing.period", run, topic="/cmd_vel", period="300 ms")


class TestGood:
    def test_the_messages_of_a_timer_pass(self):
        finding = period(recording())
        assert finding.status is Status.PASSED
        assert finding.observed == (
            "median 300 ms, largest deviation from it 0 s, over 11 intervals"
        )
        assert finding.expected == (
            "a message on `/cmd_vel` every 300 ms (median within 5 %, intervals within 10 %)"
        )

    def test_the_plot_shows_every_interval_and_the_allowed_band(self):
        plot = period(recording()).evidence.plots[0]
        assert plot.y == pytest.approx([300.0] * 11)
        assert plot.x[0] == pytest.approx(1.0)
        assert plot.band == pytest.approx((270.0, 330.0))
        assert plot.y_label == "time between messages (ms)"

    def test_one_late_message_is_forgiven_without_any_disturbance(self):
        run = spaced([0.3] * 4 + [0.36, 0.24] + [0.3] * 5)
        assert period(run).status is Status.PASSED

    def test_messages_lost_on_the_way_are_no_long_intervals(self):
        kept = [n for n in range(1, 13) if n not in (4, 8)]
        stream = tuple(message(0.7 + 0.3 * n, sequence=n) for n in kept)
        assert period(recording(messages={"/cmd_vel": stream})).status is Status.PASSED

    def test_what_was_published_before_the_match_may_arrive_all_at_once(self):
        stream = tuple(
            message(t, sequence=n, received_s=max(t, 3.0) + 0.001)
            for n, t in enumerate(every(0.3), 1)
        )
        run = recording(messages={"/cmd_vel": stream}, matched_s=3.0)
        assert period(run).status is Status.PASSED

    @given(st.lists(st.floats(-0.014, 0.014), min_size=5, max_size=40), st.integers(0, 40))
    def test_one_late_message_anywhere_never_decides(self, jitter, index):
        intervals = [0.3 + j / 3 for j in jitter]
        index %= len(intervals) - 1
        intervals[index] += 0.12
        intervals[index + 1] -= 0.12
        run = spaced(intervals)
        assert period(run).status is Status.PASSED


class TestEnds:
    def test_messages_that_stop_long_before_the_end(self):
        run = recording(messages=messages(every(0.3, 9)), stop_s=5.4)
        found = wrong(run)
        assert "9 messages at the right period, but none in the last 2.3 s" in found
        assert "timer.cancel()" in found

    def test_one_message_that_is_still_missing(self):
        run = recording(messages=messages(every(0.3, 9)), stop_s=3.9)
        assert period(run).status is Status.PASSED

    def test_what_the_machine_took_may_be_no_silence(self):
        run = recording(
            messages=messages(every(0.3, 9)), stop_s=5.4, disturbance=taken(3.2, 5.3, 2.0)
        )
        assert (period(run).status, period(run).disturbed) == (Status.ERROR, True)
        assert "but the machine took the time" in period(run).observed


class TestProperties:
    intervals = st.lists(st.floats(0.001, 2.0), min_size=5, max_size=25)

    @given(intervals, st.floats(0.0, 100.0))
    def test_when_it_happened_does_not_matter(self, intervals, shift):
        def status(first_s):
            times = after(intervals, first_s)
            return period(recording(messages=messages(times), stop_s=times[-1] + 0.1)).status

        # Whole nanoseconds, so that shifting rounds nothing.
        intervals = [round(value * 1e9) / 1e9 for value in intervals]
        assert status(0.7) == status(0.7 + round(shift))

    @given(intervals, st.sampled_from([2, 3, 10]))
    def test_scaling_stream_and_period_together_changes_nothing(self, intervals, factor):
        # A figure at the very limit may be rounded to either side.
        middle = sorted(intervals)[len(intervals) // 2]
        assume(all(abs(abs(v - middle) - 0.03) > 1e-4 for v in intervals))
        assume(abs(abs(middle - 0.3) - 0.015) > 1e-4 and len(intervals) % 2)

        def status(scale):
            run = spaced([value * scale for value in intervals], declarations=())
            return period(run, period=f"{300 * scale} ms").status

        assert status(1) == status(factor)

    @given(
        intervals,
        st.lists(st.tuples(st.floats(0.01, 6), st.floats(0, 1), st.floats(0, 1)), max_size=20),
    )
    def test_disturbance_never_turns_a_pass_into_a_failure(self, intervals, samples):
        noise = tuple(
            Disturbance(at(t), round(late * NS), round(waited * NS))
            for t, late, waited in sorted(samples)
        )
        before = period(spaced(intervals)).status
        now = period(spaced(intervals, disturbance=noise)).status
        if before is Status.PASSED:
            assert now is Status.PASSED
        else:
            assert now in (Status.FAILED, Status.ERROR)

    @given(
        st.lists(st.floats(0.0, 0.4), min_size=11, max_size=11),
        st.sets(st.integers(0, 11)),
    )
    def test_what_the_host_took_never_fails_a_right_timer(self, waits, late):
        """Each message may be late by what the host took just before it."""
        grid = every(0.3)
        times, noise, clock = [], [], 0.6
        for index, due in enumerate(grid):
            lateness = waits[min(index, 10)] if index in late else 0.0
            time_s = max(due + lateness, clock)
            times.append(time_s)
            noise.append(Disturbance(at(time_s), 0, round((time_s - due) * NS)))
            clock = time_s + 1e-6
        run = recording(messages=messages(times), stop_s=times[-1] + 0.1, disturbance=tuple(noise))
        assert period(run).status in (Status.PASSED, Status.ERROR)


class TestDisturbance:
    def test_a_late_stretch_that_the_host_explains(self):
        intervals = [0.3] * 3 + [0.5, 0.1, 0.3, 0.45, 0.15, 0.3, 0.42, 0.18]
        run = recording(
            messages=messages(after(intervals)),
            disturbance=(
                Disturbance(at(1.8), 0, 0),
                Disturbance(at(2.05), 0, int(0.2 * NS)),
                Disturbance(at(2.85), 0, int(0.16 * NS)),
                Disturbance(at(3.7), int(0.13 * NS), 0),
            ),
        )
        finding = period(run)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        assert "the machine took up to" in finding.observed

    def test_the_same_stretch_without_disturbance_fails(self):
        found = wrong(spaced([0.3] * 3 + [0.5, 0.1, 0.3, 0.45, 0.15, 0.3, 0.42, 0.18]))
        assert "3 intervals of 11 differ from the median by more than 30 ms" in found

    def test_too_little_disturbance_excuses_nothing(self):
        run = recording(
            messages=messages(every(0.405, 11)), disturbance=taken(1.0, 4.0, waited_s=0.02)
        )
        assert period(run).status is Status.FAILED

    @pytest.mark.parametrize(
        ("timers_s", "status"),
        [
            ([0.316], Status.FAILED),
            ([0.3], Status.ERROR),
            ([0.316, 0.3], Status.ERROR),
            ([1.0], Status.ERROR),
            ([], Status.ERROR),
        ],
    )
    def test_disturbance_explains_no_period_that_the_process_declared(self, timers_s, status):
        timers = [
            item
            for period_s in timers_s
            for item in declarations(timer_s=period_s)
            if item.kind == "timer"
        ]
        run = recording(
            messages=messages(every(0.316, 11)),
            stop_s=4.5,
            declarations=(*declarations(timer_s=None), *timers),
            disturbance=taken(1.0, 4.4, waited_s=0.1),
        )
        assert period(run).status is status

    def test_too_few_messages_on_a_busy_machine(self):
        run = recording(messages=messages(every(0.3, 4)), disturbance=taken(1.5, 4.4, waited_s=2.9))
        finding = period(run)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_so_many_lost_messages_that_nothing_can_be_judged(self):
        stream = tuple(message(0.7 + 0.3 * n, sequence=n) for n in range(1, 24, 2))
        finding = period(recording(messages={"/cmd_vel": stream}, stop_s=9))
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        assert "lost on their way to the probe" in finding.observed


class TestFailures:
    def test_a_pause_that_the_host_made_costs_nothing(self):
        times = after([0.3] * 5 + [1.2] + [0.3] * 5)
        run = recording(
            messages=messages(times), disturbance=taken(times[5], times[6], waited_s=0.9)
        )
        assert period(run).status is Status.PASSED
        assert "the machine took time in" in period(run).observed
        # Where it took time all along, it cannot be told.
        waits = [
            one
            for number, begin_s in enumerate(times)
            for one in taken(begin_s, begin_s + 0.1, waited_s=0.9 if number == 5 else 0.01)
        ]
        busy = recording(messages=messages(times), disturbance=tuple(waits))
        assert (period(busy).status, period(busy).disturbed) == (Status.ERROR, True)

    def test_the_worst_interval_is_a_moment(self):
        times = after([0.3] * 6 + [0.9, 0.7] + [0.3] * 3)
        moment = period(recording(messages=messages(times), stop_s=6)).evidence.moments[0]
        assert moment.label == "worst interval: 900 ms"
        assert moment.time_s == pytest.approx(times[7], abs=1e-6)

    def test_the_spread_of_a_bimodal_stream_is_not_hidden_by_its_median(self):
        assert "differ from the median" in wrong(spaced([0.3, 0.3, 0.3, 0.15, 0.45] * 3))


def arriving(waits_s, sequence=None, **changes):
    """A message every 300 ms, each of which needs so long to arrive."""
    stream = tuple(
        message(0.7 + 0.3 * n, sequence=sequence or n + 1, received_s=0.701 + 0.3 * n + wait_s)
        for n, wait_s in enumerate(waits_s)
    )
    return recording(messages={"/cmd_vel": stream}, **changes)


class TestForgery:
    def forged(self, source_s, arrival_s, **changes):
        stream = tuple(
            message(0.7 + n * source_s, sequence=n + 1, received_s=0.701 + n * arrival_s)
            for n in range(12)
        )
        return recording(messages={"/cmd_vel": stream}, stop_s=8, **changes)

    def test_stamps_that_arrivals_contradict(self):
        asked = {"topic": "/cmd_vel", "period": "300 ms"}
        found = failing("timing.period", self.forged(0.3, 0.5), **asked)
        # It counts if it happens twice.
        assert judge("timing.period", self.forged(0.3, 0.5), **asked).disturbed
        assert "11 messages of 12 came up to 2.2 s earlier or later" in found
        assert "the timestamps are not the times of publishing" in found

    def test_stamps_after_the_arrival(self):
        found = wrong(self.forged(0.3, 0.03))
        assert "not the times of publishing: one lies after its arrival" in found

    def test_stamps_before_the_launch(self):
        stream = tuple(
            message(n * 0.3 - 10, sequence=n + 1, received_s=0.7 + 0.1 * n) for n in range(12)
        )
        found = failing(
            "timing.period",
            recording(messages={"/cmd_vel": stream}),
            topic="/cmd_vel",
            period="300 ms",
        )
        assert "before the launch" in found

    def test_no_stamps_at_all_are_no_forgery(self):
        stream = tuple(
            replace(message(t, sequence=n), stamp_ns=0) for n, t in enumerate(every(0.3))
        )
        finding = period(recording(messages={"/cmd_vel": stream}))
        assert finding.status is Status.ERROR
        assert "no source timestamps" in finding.observed
        stamping = recording(messages={"/cmd_vel": stream}, environment={"rmw": "rmw_fastrtps_cpp"})
        found = wrong(stamping)
        assert "one lies before the launch" in found

    def test_a_busy_machine_may_explain_it(self):
        noise = tuple(Disturbance(at(0.7 + 0.5 * n), 0, int(0.2 * NS)) for n in range(13))
        finding = period(self.forged(0.3, 0.5, disturbance=noise))
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    @pytest.mark.parametrize(
        "waits_s", [[0.0, 0.3] * 6, [0.0, 0.08, 0.0, 0.05] * 3, [0.0] * 8 + [0.1] * 4]
    )
    def test_jitter_that_only_the_arrivals_show(self, waits_s):
        """As with a clock that a library puts on a grid."""
        run = arriving(waits_s, stop_s=5)
        found = wrong(run)
        assert "the timestamps are not the times of publishing" in found
        # Where the machine was busy, messages may wait, and nothing is held against a right node.
        noise = tuple(Disturbance(at(0.5 + 0.5 * n), int(0.3 * NS), 0) for n in range(10))
        assert period(replace(run, disturbance=noise)).status in (Status.PASSED, Status.ERROR)

    @pytest.mark.parametrize(
        ("waits_s", "sequence"),
        [
            # One message was sent again, and one waited behind it.
            ([0.0] * 4 + [0.25, 0.01] + [0.0] * 6, None),
            # Each message has a new publisher, and waits for its match.
            ([0.0, 0.0, 0.08] * 4, 1),
            # A few late arrivals do not matter.
            ([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.2, 0.2] + [0.0] * 4, None),
        ],
    )
    def test_a_few_late_arrivals_are_no_proof(self, waits_s, sequence):
        assert period(arriving(waits_s, sequence)).status is Status.PASSED


class TestParameters:
    @pytest.mark.parametrize(
        ("tolerance", "median_s", "status"),
        [
            ("5 %", 0.314, Status.PASSED),
            ("5 %", 0.316, Status.FAILED),
            (0.05, 0.314, Status.PASSED),
            ("20 ms", 0.319, Status.PASSED),
            ("20 ms", 0.321, Status.FAILED),
            ("20 ms", 0.281, Status.PASSED),
            ("20 ms", 0.279, Status.FAILED),
        ],
    )
    def test_a_tolerance_is_a_share_or_a_time(self, tolerance, median_s, status):
        times = every(median_s)
        run = recording(messages=messages(times), stop_s=max(times) + 0.2)
        assert period(run, tolerance=tolerance).status is status

    @pytest.mark.parametrize(
        ("outliers", "late", "status"),
        [
            ("0 %", 0, Status.PASSED),
            ("0 %", 1, Status.FAILED),
            ("10 %", 1, Status.PASSED),
            ("10 %", 2, Status.PASSED),
            ("10 %", 3, Status.FAILED),
        ],
    )
    def test_outliers_of_twenty_intervals(self, outliers, late, status):
        intervals = [0.3] * 20
        for index in range(late):
            intervals[3 * index + 2] = 0.4
        run = spaced(intervals)
        assert period(run, outliers=outliers).status is status

    def test_a_period_needs_some_intervals(self):
        run = recording(messages=messages(every(PERIOD_S, 6)), stop_s=2.4)
        assert period(run, at_least=5).status is Status.PASSED
        assert "6 messages on `/cmd_vel`" in period(run, at_least=6).observed
