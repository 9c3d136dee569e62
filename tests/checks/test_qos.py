"""qos.offered, qos.requested and qos.depth."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import Kind, Qos
from tests.checks.builder import (
    RELIABLE,
    declarations,
    declared,
    endpoint,
    every,
    failing,
    judge,
    messages,
    reader,
    recording,
)

BEST_EFFORT = replace(RELIABLE, reliability="best_effort")
LATCHED = replace(RELIABLE, durability="transient_local")


def offering(*profiles: Qos, kind: Kind = Kind.PUBLISHER):
    return recording(
        messages={}, endpoints=(*(endpoint(qos=qos, kind=kind) for qos in profiles), reader())
    )


class TestOffered:
    def test_an_offer_as_asked_for_passes(self):
        finding = judge(
            "qos.offered", recording(), topic="/cmd_vel", reliability="reliable",
            durability="volatile", liveliness="automatic",
        )  # fmt: skip
        assert finding.status is Status.PASSED

    def test_best_effort_against_a_reliable_reader(self):
        run = offering(BEST_EFFORT)
        finding = judge("qos.offered", run, topic="/cmd_vel", reliability="reliable")
        assert finding.status is Status.FAILED
        assert "offers reliability best_effort instead of reliable" in finding.observed
        assert "a subscription that requests the expected profile does not match" in (
            finding.observed
        )
        assert "qos_profile_sensor_data is best_effort" in finding.hint

    def test_a_stronger_offer_is_stated_to_match_all_the_same(self):
        found = failing("qos.offered", offering(LATCHED), topic="/cmd_vel", durability="volatile")
        assert "durability transient_local instead of volatile" in found
        assert "would still match it" in found

    def test_the_hint_names_only_what_is_wrong(self):
        wanted = {"topic": "/cmd_vel", "reliability": "reliable", "durability": "volatile"}
        hint = judge("qos.offered", offering(LATCHED), **wanted).hint
        assert "transient_local" in hint
        assert "best_effort" not in hint

    def test_every_publisher_must_offer_it(self):
        run = offering(RELIABLE, BEST_EFFORT)
        assert "best_effort" in failing(
            "qos.offered", run, topic="/cmd_vel", reliability="reliable"
        )

    def test_only_named_policies_count(self):
        finding = judge("qos.offered", offering(LATCHED), topic="/cmd_vel", reliability="reliable")
        assert finding.status is Status.PASSED

    def test_durations_are_compared_with_their_units(self):
        # A fraction of 2**32 of a second is how DDS writes 300 ms.
        seen = replace(RELIABLE, deadline_s=round(0.3 * 2**32) / 2**32, lifespan_s=1.0)
        run = offering(seen)
        good = judge("qos.offered", run, topic="/cmd_vel", deadline="300 ms", lifespan="1 s")
        assert good.status is Status.PASSED
        found = failing("qos.offered", offering(RELIABLE), topic="/cmd_vel", deadline="300 ms")
        assert "deadline infinite instead of 300 ms" in found
        assert "does not match" in found
        assert "deadline=Duration(seconds=0.3)" in found

    def test_what_dds_did_not_tell_is_not_judged(self):
        finding = judge("qos.offered", offering(Qos()), topic="/cmd_vel", reliability="reliable")
        assert finding.status is Status.ERROR
        assert "reliability of the publisher was not discovered" in finding.observed

    def test_a_publisher_too_short_lived_for_the_graph_counts_as_it_was_declared(self):
        run = recording(endpoints=(reader(),))
        asked = {"topic": "/cmd_vel", "reliability": "reliable"}
        good = judge("qos.offered", run, **asked, durability="volatile")
        assert good.status is Status.PASSED
        assert good.observed == "offered by 1 publisher, declared by the process"
        found = failing("qos.offered", run, topic="/cmd_vel", reliability="best_effort")
        assert "reliability reliable instead of best_effort, declared by the process" in found
        assert judge("qos.offered", run, **asked, deadline="1 s").status is Status.ERROR
        silent = replace(run, declarations=())
        assert judge("qos.offered", silent, **asked).status is Status.ERROR

    def test_how_to_write_another_profile(self):
        found = failing("qos.offered", recording(), topic="/cmd_vel", durability="transient_local")
        assert "durability=DurabilityPolicy.TRANSIENT_LOCAL" in found


class TestRequested:
    def test_a_request_as_asked_for_passes(self):
        run = offering(BEST_EFFORT, kind=Kind.SUBSCRIPTION)
        finding = judge("qos.requested", run, topic="/cmd_vel", reliability="best_effort")
        assert finding.status is Status.PASSED

    def test_a_request_for_more_than_is_offered_gets_nothing(self):
        run = offering(RELIABLE, kind=Kind.SUBSCRIPTION)
        finding = judge("qos.requested", run, topic="/cmd_vel", reliability="best_effort")
        assert "requests reliability reliable instead of best_effort" in finding.observed
        assert "a publisher that offers the expected profile does not match" in finding.observed

    def test_a_request_for_less_matches_all_the_same(self):
        run = offering(BEST_EFFORT, kind=Kind.SUBSCRIPTION)
        found = failing("qos.requested", run, topic="/cmd_vel", reliability="reliable")
        assert "would still match it" in found


class TestDepth:
    def test_passes_and_says_where_it_is_known_from(self):
        finding = judge("qos.depth", recording(), topic="/cmd_vel", depth=10)
        assert finding.status is Status.PASSED
        assert "declared by the process" in finding.observed

    def test_another_depth_is_reported(self):
        run = recording(declarations=declarations(depth=1))
        found = failing("qos.depth", run, topic="/cmd_vel", depth=10)
        assert "depth 1, declared by the process" in found
        assert "third argument of create_publisher" in found

    def test_another_depth_of_a_publisher_that_was_never_seen_points_to_its_messages(self):
        run = recording(declarations=declarations(depth=1), endpoints=())
        finding = judge("qos.depth", run, topic="/cmd_vel", depth=10)
        assert finding.evidence.moments[0].label == "first message on /cmd_vel"

    def test_the_way_to_a_depth_keeps_the_other_policies(self):
        item = declared("subscription", topic="/scan", history="keep_last", depth=5)
        latched = replace(RELIABLE, durability="transient_local")
        run = recording(
            endpoints=(endpoint("/scan", kind=Kind.SUBSCRIPTION, qos=latched),),
            declarations=(item,),
        )
        found = failing("qos.depth", run, topic="/scan", depth=10, kind="subscription")
        assert "QoSProfile(depth=10, ...)" in found and "callback, 10)" not in found

    def test_keep_all_is_no_depth(self):
        item = declared("publisher", topic="/cmd_vel", history="keep_all", depth=10)
        found = failing("qos.depth", recording(declarations=(item,)), topic="/cmd_vel", depth=10)
        assert "history keep_all" in found

    @pytest.mark.parametrize("depth", [None, "10", True, float("nan"), 10**400])
    def test_a_declaration_that_makes_no_sense_is_not_judged(self, depth):
        item = declared("publisher", topic="/cmd_vel", history="keep_last", depth=depth)
        finding = judge("qos.depth", recording(declarations=(item,)), topic="/cmd_vel", depth=10)
        assert finding.status is Status.ERROR

    def test_a_publisher_that_is_not_declared_is_judged_by_its_heartbeats_or_named(self):
        unknown = recording(declarations=())
        found = failing("qos.depth", unknown, topic="/cmd_vel", depth=10)
        assert "the process did not declare the publisher on `/cmd_vel`" in found
        shown = replace(unknown, endpoints=(endpoint(kept=10, heartbeats=2),))
        finding = judge("qos.depth", shown, topic="/cmd_vel", depth=10)
        assert finding.status is Status.PASSED
        assert "as the heartbeats of the publisher show" in finding.observed

    @pytest.mark.parametrize(
        ("kept", "heartbeats", "times_s", "passes"),
        [
            (11, 1, every(0.3), False),
            # After each message, though the queue has room for nine more: it has not.
            (1, 12, every(0.3), False),
            (1, 3, every(0.3), True),
            (7, 2, every(0.3), True),
            # Of a slow publisher each message is acknowledged before the next one.
            (1, 12, every(5.0), True),
        ],
    )
    def test_heartbeats_that_contradict_what_is_declared(self, kept, heartbeats, times_s, passes):
        own = endpoint(kept=kept, heartbeats=heartbeats)
        run = recording(endpoints=(own,), messages=messages(times_s))
        finding = judge("qos.depth", run, topic="/cmd_vel", depth=10)
        assert (finding.status is Status.PASSED) is passes
        assert passes or f"show that it keeps {kept} message" in finding.observed

    def test_the_depth_of_a_subscription_counts_too(self):
        item = declared("subscription", topic="/scan", history="keep_last", depth=5)
        run = recording(
            endpoints=(endpoint("/scan", kind=Kind.SUBSCRIPTION),), declarations=(item,)
        )
        found = failing("qos.depth", run, topic="/scan", depth=10, kind="subscription")
        assert "fourth argument of create_subscription" in found

    def test_a_subscription_that_the_program_destroyed_itself_is_its_own_affair(self):
        traced = [
            declared("subscription", topic="/scan", history="keep_last", depth=depth, number=number)
            for number, depth in enumerate((1, 10))
        ]
        asked = {"topic": "/scan", "depth": 10, "kind": "subscription"}
        seen = recording(endpoints=(endpoint("/scan", kind=Kind.SUBSCRIPTION),))
        for number, time_s, status in (
            (0, 1.0, Status.PASSED),
            (1, 1.0, Status.FAILED),
            (0, 99.0, Status.FAILED),
        ):
            gone = declared("destroyed", time_s, number=number)
            run = replace(seen, declarations=(*traced, gone))
            assert judge("qos.depth", run, **asked).status is status
