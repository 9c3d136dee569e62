"""Checks in windows of a run: what is observed outside does not count, and none is no pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import pytest

from grader.checks.window import Phase, Window
from grader.findings.finding import Finding, Status
from grader.grade.windowed import judged_in
from grader.recording.interaction import Service
from grader.recording.model import NS, Call, Ending, Recording
from grader.recording.simulated import Truth
from grader.recording.window import cut
from tests.checks.builder import (
    CHECKS,
    NODE,
    at,
    died,
    every,
    message,
    messages,
    output,
    recording,
    sent,
    silent,
    stimulus,
    text,
    twist,
)

NAMES = {"configure": 1, "cleanup": 2, "activate": 3, "deactivate": 4}
LEADS_TO = {1: "inactive", 2: "unconfigured", 3: "active", 4: "inactive"}
SILENT = ("messages.count", {"topic": "/cmd_vel", "exactly": 0})
STEADY = ("timing.period", {"topic": "/cmd_vel", "period": "300 ms", "at_least": 4})


def judged(check: tuple[str, Mapping[str, Any]], run: Recording, **window: Any) -> Finding:
    entry = CHECKS[check[0]]
    parameters = entry.parameters.model_validate(check[1])
    phases = {
        key: Phase.model_validate(value) if isinstance(value, dict) else value
        for key, value in window.items()
    }
    return judged_in(Window(**phases), entry.judge, run, parameters)


def change(time_s: float, name: str, success: bool | None = True) -> Call:
    return Call(
        f"{NODE}/change_state",
        "lifecycle_msgs/srv/ChangeState",
        at(time_s),
        None if success is None else at(time_s + 0.1),
        {"transition": {"id": NAMES[name], "label": ""}},
        None if success is None else {"success": success},
    )


def managed(
    *calls: Call, times: Sequence[float] = (), told: bool = True, **changes: Any
) -> Recording:
    """A lifecycle node that tells of each transition twice: when it begins, and at its end."""
    names = (f"{NODE}/change_state", f"{NODE}/get_state")
    services = tuple(Service(name, "x/srv/X", NODE, at(0.4)) for name in names)
    events = []
    for one in calls if told else ():
        began_s = (one.requested_ns - at(0)) / NS
        succeeded = one.response is not None and one.response["success"]
        done = LEADS_TO[(one.request or {})["transition"]["id"]] if succeeded else "errorprocessing"
        events += [message(began_s + 0.01, {"goal_state": {"label": "changing"}})]
        events += [message(began_s + 0.02, {"goal_state": {"label": done}})]
    topics = {f"{NODE}/transition_event": tuple(events), **messages(times)}
    return recording(calls=calls, services=services, messages=topics, **changes)


def inactive(run: Recording, state: str = "inactive") -> list[tuple[float, ...]]:
    window = Window(while_=Phase(lifecycle=state, node=NODE))
    return [
        tuple(round(run.since_launch_s(one), 3) for one in interval)
        for interval in window.intervals(run)
    ]


WHILE_INACTIVE = {"lifecycle": "inactive", "node": NODE}
LIFE = (change(1, "configure"), change(2, "activate"), change(3, "deactivate"))


class TestLifecycle:
    @pytest.mark.parametrize(
        ("state", "wanted"),
        [
            ("unconfigured", [(0.4, 1.01)]),
            ("inactive", [(1.02, 2.01), (3.02, 4.5)]),
            ("active", [(2.02, 3.01)]),
            ("finalized", []),
        ],
    )
    def test_a_state_lasts_as_the_node_itself_tells(self, state, wanted):
        assert inactive(managed(*LIFE), state) == wanted

    def test_an_answer_that_comes_late_moves_no_window(self):
        late = tuple(replace(one, answered_ns=at(4)) for one in LIFE)
        assert inactive(managed(*late), "active") == [(2.02, 3.01)]

    def test_what_the_node_told_but_the_probe_missed_is_no_mistake_of_the_student(self):
        found = judged(SILENT, managed(*LIFE, told=False), while_=WHILE_INACTIVE)
        assert found.status is Status.ERROR and found.disturbed

    def test_silent_while_inactive(self):
        good = managed(*LIFE, times=every(0.1, 8, 2.11))
        found = judged(SILENT, good, while_=WHILE_INACTIVE)
        assert found.status is Status.PASSED
        assert found.expected.startswith(f"while `{NODE}` is inactive: exactly 0 messages")

    @pytest.mark.parametrize("spoken_s", [1.5, 3.2])
    def test_one_message_in_any_of_the_windows_is_one_too_many(self, spoken_s):
        found = judged(SILENT, managed(*LIFE, times=[spoken_s]), while_=WHILE_INACTIVE)
        assert found.status is Status.FAILED
        assert found.observed == "1 message"
        # Times in the report stay those of the run.
        assert [moment.time_s for moment in found.evidence.moments] == [spoken_s]

    def test_a_message_during_the_transition_costs_nothing(self):
        run = managed(*LIFE, times=[1.015, 2.015, 3.015])
        assert judged(SILENT, run, while_=WHILE_INACTIVE).status is Status.PASSED

    @pytest.mark.parametrize(
        ("calls", "words"),
        [
            ((change(1, "configure", success=False),), "was never inactive: configure failed"),
            ((change(1, "configure", success=None),), "never inactive: configure was not answered"),
        ],
    )
    def test_a_state_that_never_comes_is_no_pass(self, calls, words):
        found = judged(SILENT, managed(*calls), while_=WHILE_INACTIVE)
        assert found.status is Status.FAILED
        assert words in found.observed and found.hint
        assert found.expected == f"a time while `{NODE}` is inactive: this is judged then"

    def test_a_node_that_is_not_there_is_the_cause(self):
        other = {"lifecycle": "inactive", "node": "/other"}
        found = judged(SILENT, managed(*LIFE), while_=other)
        assert found.status is Status.FAILED
        assert found.observed == "found the node `/bot_publisher`"

    def test_an_ordinary_node_is_told_from_one_with_other_states(self):
        found = judged(SILENT, recording(), while_=WHILE_INACTIVE)
        assert "is no lifecycle node" in found.observed

    def test_what_came_of_a_failed_transition_is_not_the_cause(self):
        calls = (change(1, "configure", success=False), change(2, "activate", success=None))
        run = managed(*calls, processes=(died(1, exited_s=2.1),), ending=Ending.EXITED)
        found = judged(SILENT, run, while_=WHILE_INACTIVE)
        assert "configure failed then activate was not answered" in found.observed
        assert "ended" not in found.observed

    def test_a_process_that_ended_is_the_cause(self):
        run = managed(change(1, "configure", None), processes=(died(1),), ending=Ending.EXITED)
        assert "ended 1.20 s after launch" in judged(SILENT, run, while_=WHILE_INACTIVE).observed


class TestTimes:
    RUN = recording(messages=messages(every(0.3, 5, 0.7) + every(0.5, 5, 2.4)))

    def test_from_and_to_count_from_the_first_match(self):
        assert judged(STEADY, self.RUN, to_s=1.8).status is Status.PASSED
        assert judged(STEADY, self.RUN).status is Status.FAILED
        found = judged(STEADY, self.RUN, from_s=1.9)
        assert found.status is Status.FAILED
        assert found.expected.startswith("from 1.9 s: ")

    def test_messages_are_counted_in_the_window_alone(self):
        two = ("messages.count", {"topic": "/cmd_vel", "exactly": 2})
        assert judged(two, self.RUN, from_s=0.5, to_s=1.0).status is Status.PASSED
        counting = ("messages.sequence", {"topic": "/cmd_vel", "field": "n", "values": [2, 3]})
        numbered = messages(every(0.3, 5, 0.7))
        numbered = {
            "/cmd_vel": tuple(
                replace(one, value={"n": n}) for n, one in enumerate(numbered["/cmd_vel"])
            )
        }
        run = recording(messages=numbered)
        assert judged(counting, run, from_s=0.7, to_s=1.4).status is Status.PASSED

    def test_what_was_latched_before_the_first_match_belongs_to_the_beginning(self):
        one = ("messages.count", {"topic": "/cmd_vel", "exactly": 1})
        run = recording(messages=messages([0.2]), matched_s=0.4)
        assert judged(one, run, to_s=1.0).status is Status.PASSED
        assert judged(SILENT, run, from_s=0.1).status is Status.PASSED

    def test_static_transforms_hold_in_every_window(self):
        one = ("messages.count", {"topic": "/tf_static", "exactly": 1})
        run = recording(messages=messages([0.5], topic="/tf_static"))
        assert judged(one, run, from_s=1.0).status is Status.PASSED

    def test_of_several_writers_the_numbers_tell_nothing(self):
        one, other = messages([1.0, 1.2])["/cmd_vel"], messages([1.1, 1.3])["/cmd_vel"]
        both = (one[0], replace(other[0], sequence=500), one[1], replace(other[1], sequence=501))
        four = ("messages.count", {"topic": "/cmd_vel", "exactly": 4})
        run = recording(messages={"/cmd_vel": both})
        assert judged(four, run, from_s=0.1).status is Status.PASSED

    def test_a_process_that_ends_after_the_window_has_not_ended_in_it(self):
        run = recording(processes=(died(1, exited_s=3.0),), ending=Ending.EXITED, stop_s=3.0)
        assert judged(("node.alive", {}), run, to_s=2.0).status is Status.PASSED
        assert judged(("node.alive", {}), run, from_s=0.1).status is Status.FAILED

    def test_a_run_that_ends_before_the_window_is_our_fault_unless_the_process_ended(self):
        found = judged(SILENT, recording(), from_s=9.0)
        assert found.status is Status.ERROR
        assert "the run ended 4.50 s after launch" in found.observed
        run = recording(processes=(died(1),), ending=Ending.EXITED, stop_s=1.2)
        assert judged(SILENT, run, from_s=3.0).status is Status.FAILED


class TestEvents:
    def test_a_log_record_counts_when_it_was_logged_not_when_it_was_read(self):
        record = "[INFO] [1700000001.015000000] [bot]: ready"
        run = managed(*LIFE, log=output(record, time_s=1.3))
        never = ("log.contains", {"text": "ready", "at_least": 0, "at_most": 0})
        assert judged(never, run, while_=WHILE_INACTIVE).status is Status.PASSED

    def test_drives_only_after_it_has_turned(self):
        def driving(first_s: float) -> Recording:
            values = [twist((t >= first_s, 0, 0), (0, 0, t < 2.5)) for t in every(0.1, 40)]
            commands = sent(every(0.1, 40), "/cmd_vel", values=values)
            turned = [{"h": t} for t in every(0.1, 40)]
            headings = sent(every(0.1, 40, 0.75), "/heading", values=turned)
            return recording(messages={**commands, **headings})

        still = {"topic": "/cmd_vel", "value": {"linear.x": 0.0}, "rest": "any"}
        turned = {"message": "/heading", "fields": {"h": "> 2.4"}}
        check = ("messages.equal", still)
        assert judged(check, driving(2.6), before=turned).status is Status.PASSED
        found = judged(check, driving(2.0), before=turned)
        assert found.status is Status.FAILED
        assert found.expected.startswith("before `/heading` has h > 2.4: linear.x = 0.0")
        drives = ("messages.equal", {**still, "value": {"linear.x": "> 0"}})
        assert judged(drives, driving(2.6), after=turned, from_s=0.2).status is Status.PASSED

    def test_after_a_contact_of_the_robot(self):
        truth = tuple(
            Truth(at(t), t, 0, 0, 0.2 * (t < 2), 0, 0, 0, "box" if t >= 2 else None)
            for t in every(0.01, 300)
        )
        run = recording(truth=truth, messages=messages(every(0.1, 12, 0.7)))
        assert judged(SILENT, run, after={"robot": "touches"}).status is Status.PASSED
        assert judged(SILENT, run, while_={"robot": "moves"}).status is Status.FAILED
        assert judged(SILENT, run, while_={"robot": "rests"}).status is Status.PASSED
        found = judged(SILENT, recording(truth=truth[:50]), after={"robot": "touches"})
        assert "never: the robot touches something" in found.observed

    def test_from_a_line_of_the_log_on(self):
        run = recording(log=output("[INFO] goal reached", time_s=3.0), messages=messages([1, 2]))
        assert judged(SILENT, run, after={"log": "Goal reached"}).status is Status.PASSED
        assert judged(SILENT, run, before={"log": "goal reached"}).status is Status.FAILED

    def test_while_the_newest_message_has_these_fields(self):
        states = sent([1, 2, 3], "/state", values=[{"data": s} for s in ("idle", "go", "idle")])
        run = recording(messages={**states, **messages([2.5])})
        idle, go = ({"message": "/state", "fields": {"data": s}} for s in ("idle", "go"))
        assert judged(SILENT, run, while_=idle).status is Status.PASSED
        assert judged(SILENT, run, while_=go).status is Status.FAILED

    def test_a_message_that_never_comes_is_explained(self):
        found = judged(SILENT, silent(), after={"message": "/cmd_vel"})
        assert found.status is Status.FAILED
        assert "the publisher on `/cmd_vel` is there but silent" in found.observed
        fast = {"message": "/cmd_vel", "fields": {"linear.x": "> 5"}}
        found = judged(SILENT, recording(), after=fast)
        assert "none of 12 messages on `/cmd_vel`: the last has linear.x = 1.0 instead of > 5" in (
            found.observed
        )

    def test_what_a_stimulus_did_not_send_is_not_the_students_silence(self):
        run = recording(endpoints=(*recording().endpoints, stimulus("/start")))
        found = judged(SILENT, run, after={"message": "/start"})
        assert "no subscription" in found.observed

    def test_events_in_the_wrong_order_are_told(self):
        run = recording(log=output("late", time_s=3.0), messages=messages([1.0]))
        found = judged(SILENT, run, after={"log": "late"}, before={"message": "/cmd_vel"})
        assert found.status is Status.FAILED
        assert "there was none before the run ended" in text(found)


def test_all_that_happens_outside_of_a_window_is_cut_and_facts_stay() -> None:
    stays = {"scenario", "seed", "launched_ns", "end_ns", "submission", "answers", "joined"}
    stays |= {"joins", "pauses", "unreadable", "nodes", "endpoints", "processes", "declarations"}
    stays |= {"services", "clients", "waits", "interventions", "breaches", "disturbance"}
    stays |= {"faults", "scenes", "values", "environment", "names"}
    # Which turtles there are follows from what was before.
    stays |= {"turtles"}
    moment = SimpleNamespace(
        time_ns=at(1), stamp_ns=at(1), requested_ns=at(1), sent_ns=at(1), asked_ns=at(1), text=""
    )
    names = {field.name for field in fields(Recording)} - stays
    cut_by_time = names - {"ending", "matched_ns", "stop_ns", "messages", "sent"}
    run = recording(**{name: (moment,) for name in cut_by_time}, **{"messages": {}, "sent": {}})
    after = cut(run, at(2), at(3))
    assert {name for name in cut_by_time if getattr(after, name)} == set()
    assert (after.matched_ns, after.stop_ns, after.launched_ns) == (at(2), at(3), run.launched_ns)


def test_an_error_in_one_window_is_not_hidden_by_another() -> None:
    def judge(run: Recording, parameters: Any) -> Finding:
        told = {1: Finding.error("", "ours"), 2: Finding.failed("", "wrong")}
        return told.get(len(run.on("/cmd_vel")), Finding.passed("", ""))

    run = managed(*LIFE, times=[1.5, 3.2, 3.3])
    window = Window(while_=Phase(lifecycle="inactive", node=NODE))
    assert judged_in(window, judge, run, None).status is Status.ERROR
