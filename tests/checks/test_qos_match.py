"""qos.compatible."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import Kind, Qos
from tests.checks.builder import (
    NODE,
    RELIABLE,
    declared,
    endpoint,
    failing,
    judge,
    reader,
    recording,
)

BEST_EFFORT = replace(RELIABLE, reliability="best_effort")
LATCHED = replace(RELIABLE, durability="transient_local")
SLOW = replace(RELIABLE, deadline_s=1.0)


def having(qos, kind=Kind.PUBLISHER, **changes):
    return recording(endpoints=(endpoint(qos=qos, kind=kind), reader()), **changes)


def peer(kind="publisher", **parameters):
    return {"topic": "/cmd_vel", "kind": kind, **parameters}


# The rules of the ROS docs, "QoS compatibilities": (publisher, what a subscription requests).
RULES = [
    (RELIABLE, {"reliability": "reliable"}, True),
    (BEST_EFFORT, {"reliability": "reliable"}, False),
    (BEST_EFFORT, {"reliability": "best_effort"}, True),
    (RELIABLE, {"durability": "transient_local"}, False),
    (LATCHED, {"durability": "transient_local"}, True),
    (LATCHED, {"durability": "volatile"}, True),
    (RELIABLE, {"deadline": "1 s"}, False),
    (SLOW, {"deadline": "1 s"}, True),
    (SLOW, {"deadline": "500 ms"}, False),
    (SLOW, {}, True),
    (RELIABLE, {"liveliness": "manual_by_topic"}, False),
    (replace(RELIABLE, liveliness="manual_by_topic"), {"liveliness": "automatic"}, True),
    (RELIABLE, {"lease": "1 s"}, False),
    (replace(RELIABLE, liveliness_lease_s=1.0), {"lease": "2 s"}, True),
]


@pytest.mark.parametrize(("offered", "requested", "match"), RULES)
def test_the_rules_with_the_student_s_publisher(offered, requested, match):
    run = having(offered)
    finding = judge("qos.compatible", run, **peer(**requested))
    assert (finding.status is Status.PASSED) is match
    refused = judge("qos.compatible", run, **peer(**requested, expect="refuse"))
    assert (refused.status is Status.PASSED) is not match


def test_the_finding_explains_the_rule_in_a_table():
    finding = judge("qos.compatible", having(BEST_EFFORT), **peer(reliability="reliable"))
    assert "reliability best_effort offered, reliable requested" in finding.observed
    table = finding.evidence.tables[0]
    assert table.header == ("policy", "offered", "requested", "compatible", "rule")
    assert table.rows[0] == (
        "reliability", "best_effort", "reliable", "no",
        "a request for reliable needs an offer of reliable",
    )  # fmt: skip


def test_the_student_s_subscription_is_the_one_that_requests():
    picky = having(replace(LATCHED, reliability="best_effort"), Kind.SUBSCRIPTION)
    assert "durability volatile offered, transient_local requested" in failing(
        "qos.compatible", picky, **peer("subscription", durability="volatile")
    )
    finding = judge(
        "qos.compatible", picky, **peer("subscription", durability="volatile", expect="refuse")
    )
    assert finding.status is Status.PASSED
    found = failing(
        "qos.compatible",
        picky,
        **peer("subscription", reliability="best_effort", durability="transient_local",
               expect="refuse"),
    )  # fmt: skip
    assert "no policy that is offered is weaker" in found


class TestTheBestAvailable:
    PICKY = replace(LATCHED, reliability="reliable")

    def run(self, *traced):
        return recording(
            endpoints=(endpoint(qos=self.PICKY, kind=Kind.SUBSCRIPTION), reader()),
            declarations=tuple(
                declared("subscription", topic="/cmd_vel", node=NODE, **policies)
                for policies in traced
            ),
        )

    def volatile_refused(self, run):
        wish = peer("subscription", durability="volatile", expect="refuse")
        return judge("qos.compatible", run, **wish)

    def test_it_matches_every_peer(self):
        found = self.volatile_refused(self.run({"durability": "best_available"}))
        assert found.status is Status.FAILED
        assert "requests the best available durability" in found.observed
        assert "here transient_local" in found.observed

    def test_another_policy_refuses_all_the_same(self):
        run = self.run({"reliability": "best_available", "durability": "transient_local"})
        assert self.volatile_refused(run).status is Status.PASSED

    def test_one_that_was_made_anew_with_names_counts(self):
        run = self.run({"durability": "best_available"}, {"durability": "transient_local"})
        assert self.volatile_refused(run).status is Status.PASSED

    def test_of_another_node_it_says_nothing(self):
        run = replace(
            self.run(),
            declarations=(
                declared(
                    "subscription", topic="/cmd_vel", node="/other", durability="best_available"
                ),
            ),
        )
        assert self.volatile_refused(run).status is Status.PASSED


def test_an_unknown_policy_refuses_nothing():
    assert judge("qos.compatible", having(Qos()), **peer()).status is Status.PASSED
