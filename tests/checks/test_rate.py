"""timing.rate."""

from dataclasses import replace

from grader.findings.finding import Status
from tests.checks.builder import (
    died,
    every,
    failing,
    judge,
    message,
    messages,
    recording,
    taken,
)

PAUSED = {"topic": "/cmd_vel", "at_least": "5 Hz", "pause": "1 s"}


def at_rate(period_s, count=20, **changes):
    return recording(messages=messages(every(period_s, count)), stop_s=12.0, **changes)


def test_a_rate_within_the_bounds_passes():
    finding = judge("timing.rate", at_rate(0.1), topic="/cmd_vel", at_least="9 Hz", at_most="11 Hz")
    assert finding.status is Status.PASSED
    assert finding.expected == "at least 9 Hz and at most 11 Hz on `/cmd_vel`"
    assert finding.observed == "10 Hz: 20 messages in 1.9 s"


def test_a_rate_that_is_too_low_is_reported():
    found = failing("timing.rate", at_rate(0.2), topic="/cmd_vel", at_least="9 Hz")
    assert "5 Hz: 20 messages in 3.8 s" in found
    assert "seconds: 1 / rate" in found


def test_a_rate_that_is_too_high_is_reported():
    found = failing("timing.rate", at_rate(0.05), topic="/cmd_vel", at_most="11 Hz")
    assert "20 Hz" in found
    assert "second timer" in found


def test_a_message_that_was_lost_on_its_way_counts():
    kept = [message(0.7 + 0.1 * n, sequence=n + 1) for n in range(20) if n % 2 == 0 or n == 19]
    run = recording(messages={"/cmd_vel": tuple(kept)})
    finding = judge("timing.rate", run, topic="/cmd_vel", at_least="9 Hz")
    assert finding.status is Status.PASSED


def test_what_the_machine_took_costs_no_point():
    run = at_rate(0.2, disturbance=taken(0.7, 4.0, waited_s=2.5))
    finding = judge("timing.rate", run, topic="/cmd_vel", at_least="9 Hz")
    assert finding.status is Status.ERROR and finding.disturbed


class TestAPause:
    def paused(self, *times_s, stop_s=4.0, **changes):
        sent = messages(times_s)
        return recording(messages=sent, stop_s=stop_s, end_s=stop_s + 0.1, **changes)

    def test_that_is_short_enough(self):
        run = self.paused(*every(0.1, 15), *(2.9 + 0.1 * n for n in range(11)))
        assert judge("timing.rate", run, **PAUSED).status is Status.PASSED

    def test_a_pause_between_messages_is_reported(self):
        run = self.paused(*every(0.1, 10), *(2.9 + 0.1 * n for n in range(11)))
        found = failing("timing.rate", run, **PAUSED)
        assert "no message for 1.3 s, from 1.60 s after launch on, after 10 messages" in found
        assert judge("timing.rate", run, topic="/cmd_vel", at_least="5 Hz").status is Status.PASSED

    def test_a_pause_until_the_end_is_reported(self):
        found = failing("timing.rate", self.paused(*every(0.1, 20)), **PAUSED)
        assert "no message for 1.4 s until the end" in found
        assert "Look for an `if`" in found

    def test_of_a_process_that_ended(self):
        run = self.paused(*every(0.1, 20), processes=(died(1, exited_s=2.7),))
        found = failing("timing.rate", run, **PAUSED)
        assert "ended 2.70 s after launch" in found and "until the end" in found

    def test_in_which_messages_were_lost_on_their_way(self):
        run = self.paused(*every(0.1, 10), *(2.9 + 0.1 * n for n in range(11)))
        kept = run.messages["/cmd_vel"]
        later = tuple(replace(item, sequence=item.sequence + 5) for item in kept[10:])
        lost = replace(run, messages={"/cmd_vel": (*kept[:10], *later)})
        assert judge("timing.rate", lost, **PAUSED).status is Status.PASSED

    def test_that_the_machine_made(self):
        run = self.paused(*every(0.1, 20), disturbance=taken(2.6, 4.0, waited_s=1.0))
        finding = judge("timing.rate", run, **PAUSED)
        assert finding.status is Status.ERROR and finding.disturbed
