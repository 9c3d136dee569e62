"""qos.late_joiner."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import NS
from tests.checks.builder import (
    RELIABLE,
    declarations,
    died,
    endpoint,
    every,
    failing,
    join,
    judge,
    messages,
    reader,
    recording,
    taken,
)

LATCHED = replace(RELIABLE, durability="transient_local")
PERIOD_S = 0.5
JOINED_S = 6.3
LAST_10 = {"topic": "/cmd_vel", "joiner": "late", "last": 10}


def joined(kept, *, qos=LATCHED, depth=10, missed=0, **changes):
    """12 messages before the join; the joiner got so many of them, and what came after."""
    published = messages(every(PERIOD_S, 16))["/cmd_vel"]
    before = [item for item in published if item.stamp_ns <= join(JOINED_S).joined_ns]
    assert len(before) == 12
    live = [item for item in published if item not in before][missed:]
    (late,) = changes.get("joins") or (join(JOINED_S),)
    got = before[len(before) - kept :] if kept else []
    # What is kept arrives with the match.
    got = [replace(item, received_ns=late.matched_ns) for item in got]
    defaults = {
        "messages": {"/cmd_vel": published},
        "joins": (join(JOINED_S),),
        "joined": {"late": (*got, *live)},
        "endpoints": (endpoint(qos=qos), reader()),
        "declarations": declarations(depth=depth),
        "stop_s": 8.4,
        "end_s": 8.5,
    }
    return recording(**{**defaults, **changes})


def verdict(run):
    return judge("qos.late_joiner", run, **LAST_10)


def failure(run):
    return failing("qos.late_joiner", run, **LAST_10)


def test_the_last_ten_messages_pass():
    finding = verdict(joined(10))
    assert finding.status is Status.PASSED
    assert finding.observed == "it got 10 of the 12 messages published before it"
    rows = finding.evidence.tables[0].rows
    assert [row[2] for row in rows] == ["no"] * 2 + ["yes"] * 10


def test_a_message_while_it_is_matched_counts_on_either_side():
    late = join(JOINED_S, matched_s=6.72)
    assert verdict(joined(9, joins=(late,))).status is Status.PASSED
    assert verdict(joined(10, joins=(late,))).status is Status.PASSED


def test_a_message_right_after_the_match_counts_for_nothing_of_the_past():
    late = join(JOINED_S, matched_s=6.69)
    assert verdict(joined(9, joins=(late,))).status is Status.ERROR
    assert "got 9 of the 12" in failure(joined(9, depth=9, joins=(late,)))


def test_a_longer_queue_loses_points_and_is_reported():
    found = failure(joined(12, depth=100))
    assert "it got 12 of the 12 messages published before it: the publisher's depth is 100" in found
    assert "depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL" in found


def test_a_publisher_made_anew_for_each_message():
    own = tuple(endpoint(qos=LATCHED, appeared_s=0.35 + 0.1 * n) for n in range(12))
    found = failure(joined(12, endpoints=(*own, reader())))
    assert "of 12 publishers, each of which keeps its own" in found
    assert "Call create_publisher once" in found


def test_publishers_that_were_destroyed_took_along_what_they_kept():
    own = [endpoint(qos=LATCHED, appeared_s=0.3 + PERIOD_S * n) for n in range(12)]
    gone = [replace(item, vanished_ns=item.appeared_ns + NS // 2) for item in own[:-1]]
    run = joined(1, endpoints=(*gone, own[-1], reader()))
    found = failure(run)
    assert (
        "11 publishers were destroyed before it joined, and what a publisher keeps is lost" in found
    )
    assert "Call create_publisher once" in found


def test_a_publisher_that_was_out_of_sight_is_not_the_student_s_fault():
    seen = replace(endpoint(qos=LATCHED), vanished_ns=join(JOINED_S).joined_ns - NS)
    run = joined(7, endpoints=(seen, reader()))
    assert verdict(run).status is Status.ERROR


def test_a_shorter_queue_loses_points_and_is_reported():
    found = failure(joined(9, depth=9))
    assert "it got 9 of the 12 messages published before it: the publisher's depth is 9" in found


def test_a_queue_that_nothing_declared():
    assert "it got 3 of the 12 messages" in failure(joined(3, declarations=()))


def test_a_history_that_was_lost_is_not_the_student_s_fault():
    finding = verdict(joined(7, depth=10))
    assert finding.status is Status.ERROR and finding.disturbed


def test_a_lifespan_that_is_over():
    short = replace(LATCHED, lifespan_s=1.0)
    found = failure(joined(2, qos=short))
    assert (
        "it got 2 of the 12 messages published before it: the publisher's lifespan is 1 s" in found
    )
    assert "Leave `lifespan` out" in found


def test_a_lifespan_that_is_long_enough_explains_nothing():
    long = replace(LATCHED, lifespan_s=60.0)
    assert verdict(joined(7, qos=long)).status is Status.ERROR


def test_a_volatile_publisher_is_refused_and_the_rule_is_shown():
    late = join(JOINED_S, matched_ns=None)
    run = joined(0, qos=RELIABLE, joins=(late,), joined={})
    finding = verdict(run)
    assert finding.status is Status.FAILED
    assert "durability volatile offered, transient_local requested" in finding.observed
    row = next(row for row in finding.evidence.tables[0].rows if row[0] == "durability")
    assert row[:4] == ("durability", "volatile", "transient_local", "no")


def test_nothing_of_the_past():
    volatile = replace(join(JOINED_S), qos=RELIABLE)
    run = joined(0, qos=RELIABLE, joins=(volatile,))
    nothing = LAST_10 | {"last": 0}
    assert judge("qos.late_joiner", run, **nothing).status is Status.PASSED
    found = failing("qos.late_joiner", joined(10), **nothing)
    assert "it got 10 of the 12 messages published before it" in found
    assert "A volatile publisher keeps nothing" in found


def test_too_few_were_published():
    few = messages(every(2.0, 3))
    found = failure(joined(0, messages=few, joined={}))
    assert "3 messages on `/cmd_vel`" in found


def test_the_node_had_ended():
    run = joined(
        0,
        joins=(),
        joined={},
        processes=(died(1, exited_s=6.5),),
        messages=messages(every(0.4, 14)),
    )
    assert "the run ended before it joined: the process" in failure(run)


def unheard(kept, published, **changes):
    """Nothing was subscribed to the topic until the join: so many had been published by then."""
    times = every(PERIOD_S, published + 3, first_s=JOINED_S - PERIOD_S * published + 0.3)
    sent = messages(times)["/cmd_vel"]
    got = [
        replace(item, received_ns=max(item.received_ns, join(JOINED_S).matched_ns))
        for item in sent[max(published - kept, 0) :]
    ]
    return joined(0, messages={}, joined={"late": tuple(got)}, **changes)


def test_where_nothing_is_subscribed_before_the_messages_numbers_tell_how_many_came():
    finding = verdict(unheard(10, 12))
    assert finding.status is Status.PASSED
    assert finding.observed == "it got 10 of the 12 messages published before it"
    assert "got 9 of the 12 messages" in failure(unheard(9, 12, depth=9))
    assert "got 12 of the 12 messages" in failure(unheard(12, 12, depth=100))


@pytest.mark.parametrize("published", [0, 1, 10])
def test_a_publisher_that_waits_for_a_subscription_fails(published):
    found = failure(unheard(published, published))
    assert f"{published} message" in found
    assert "published before it, while there was no subscription" in found
    assert "whether or not there is a subscription" in found


def test_a_publisher_that_the_machine_held_up_is_not_the_student_s_fault():
    run = unheard(10, 10, disturbance=taken(1.0, 3.0, waited_s=1.0))
    finding = verdict(run)
    assert finding.status is Status.ERROR and finding.disturbed


def test_where_nothing_is_subscribed_before_a_publisher_made_anew_is_named():
    own = [endpoint(qos=LATCHED, appeared_s=0.3 + PERIOD_S * n) for n in range(12)]
    gone = [replace(item, vanished_ns=item.appeared_ns + NS // 2) for item in own[:-1]]
    run = unheard(1, 1, endpoints=(*gone, own[-1], reader()))
    found = failure(run)
    assert "11 publishers were destroyed before it joined" in found
