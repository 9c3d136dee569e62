"""Each explanation of order, of derived values, of kept messages and of executors has its case."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from grader.recording.model import NS, Recording
from tests.checks import test_concurrency as concurrency
from tests.checks import test_following as following
from tests.checks import test_late_joiner as late
from tests.checks.builder import declared, endpoint, join, judge, messages, reader, recording, taken
from tests.checks.test_sequence import counting, sequence
from tests.diagnosis.test_every_explanation import answers


def anew(run: Any, *kept: int) -> Recording:
    own = [endpoint(qos=late.LATCHED, appeared_s=0.3 + 0.5 * n) for n in range(12)]
    gone = [replace(item, vanished_ns=item.appeared_ns + NS // 2) for item in own[:-1]]
    return run(*kept, endpoints=(*gone, own[-1], reader()))


def in_turn(executor: str, group: str) -> Recording:
    made = [declared("made", executor=concurrency.MULTI)]
    return concurrency.run(*concurrency.in_turn(group=group), executor=executor, more=made)


UNMATCHED = join(late.JOINED_S, matched_ns=None)
COUNTED = sequence(step=1)
SPEED = {"topic": "/cmd_vel", "value": {"linear": {"x": 1.0}}, "rest": "any"}
GROUPS = concurrency.REENTRANT, concurrency.EXCLUSIVE


@pytest.mark.parametrize(
    ("name", "check", "run", "parameters"),
    [
        ("WrongOrder.never_changes", "messages.sequence", counting(0, 0, 0, 0), COUNTED),
        ("WrongOrder.other_step", "messages.sequence", counting(0, 2, 4, 6), COUNTED),
        ("WrongOrder.starts_again", "messages.sequence", counting(0, 1, 2, 0, 1), COUNTED),
        ("WrongOrder.other_order", "messages.sequence", counting(0, 1, 3, 4), COUNTED),
        (
            "WrongValue.added_up",
            "messages.equal",
            recording(
                messages={
                    "/cmd_vel": tuple(
                        replace(one, value={"linear": {"x": 1.0 + number}})
                        for number, one in enumerate(messages([0.7, 1.0, 1.3])["/cmd_vel"])
                    )
                }
            ),
            SPEED,
        ),
        (
            "NotFollowing.older_values",
            "messages.follows",
            following.run(lambda t: following.right(t - 1.0), times=following.TIMES[20:]),
            None,
        ),
        (
            "NotFollowing.different_moments",
            "messages.follows",
            following.run(
                lambda t: following.status(*following.place(t)[:2], following.place(t - 0.4)[2]),
                times=following.TIMES[10:],
            ),
            None,
        ),
        (
            "NotFollowing.other_values",
            "messages.follows",
            following.run(lambda _: following.status(9.0, 0.0, 0.0)),
            None,
        ),
        (
            "TooFewKept.offers_less",
            "qos.late_joiner",
            late.joined(0, qos=late.RELIABLE, joins=(UNMATCHED,), joined={}),
            late.LAST_10,
        ),
        (
            "TooFewKept.lifespan_over",
            "qos.late_joiner",
            late.joined(2, qos=replace(late.LATCHED, lifespan_s=1.0)),
            late.LAST_10,
        ),
        (
            "TooFewKept.never_matched",
            "qos.late_joiner",
            late.joined(0, joins=(UNMATCHED,), joined={}),
            late.LAST_10,
        ),
        ("TooFewKept.lost_on_the_way", "qos.late_joiner", late.joined(7), late.LAST_10),
        ("TooFewKept.other_depth", "qos.late_joiner", late.joined(9, depth=9), late.LAST_10),
        ("TooFewKept.publisher_destroyed", "qos.late_joiner", anew(late.joined, 1), late.LAST_10),
        ("TooManyKept.several_publishers", "qos.late_joiner", anew(late.joined, 12), late.LAST_10),
        ("TooManyKept.other_depth", "qos.late_joiner", late.joined(12, depth=20), late.LAST_10),
        (
            "UnpublishedBefore.publisher_destroyed",
            "qos.late_joiner",
            anew(late.unheard, 1, 1),
            late.LAST_10,
        ),
        (
            "UnpublishedBefore.no_cpu_time",
            "qos.late_joiner",
            late.unheard(10, 10, disturbance=taken(1.0, 3.0, waited_s=1.0)),
            late.LAST_10,
        ),
        (
            "UnpublishedBefore.waits_for_a_subscription",
            "qos.late_joiner",
            late.unheard(1, 1),
            late.LAST_10,
        ),
        (
            "OtherExecution.other_executor_spins",
            "executor.overlap",
            in_turn(concurrency.SINGLE, f"{GROUPS[0]} 1"),
            concurrency.BOTH,
        ),
        (
            "OtherExecution.one_group",
            "executor.overlap",
            in_turn(concurrency.MULTI, f"{GROUPS[1]} 1"),
            concurrency.BOTH,
        ),
        (
            "OtherExecution.other_executor_or_groups",
            "executor.overlap",
            in_turn(concurrency.MULTI, f"{GROUPS[0]} 1"),
            concurrency.BOTH,
        ),
    ],
)
def test_the_explanation_answers_for_its_case(
    name: str, check: str, run: Recording, parameters: dict[str, Any] | None
) -> None:
    with answers() as found:
        if parameters is None:
            following.verdict(run)
        else:
            judge(check, run, **parameters)
    assert name in found
