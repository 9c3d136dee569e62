"""executor.overlap and executor.kind: how callbacks run, as declared and as logged."""

import pytest

from grader.findings.finding import Status
from grader.recording.model import LogLine
from tests.checks.builder import (
    BOT,
    at,
    declarations,
    declared,
    failing,
    judge,
    package,
    recording,
    submission,
    taken,
)

REENTRANT, EXCLUSIVE = "ReentrantCallbackGroup", "MutuallyExclusiveCallbackGroup"
SINGLE, MULTI = "SingleThreadedExecutor", "MultiThreadedExecutor"
HEARD = {"callback": "Worker.heard", "serves": "/chatter"}
TICK = {"callback": "Worker.tick", "serves": "0.5 s"}
BOTH = {"callbacks": ["/chatter", "tick"]}


def ran(begin_s, end_s, of=TICK, group=f"{REENTRANT} 1", thread=1, **changes):
    """One call of a callback, as the tracer declares it."""
    times = {"began_ns": at(begin_s), "ended_ns": at(end_s)}
    return declared("ran", end_s, **{**of, **times, "group": group, "thread": thread, **changes})


def at_once(**changes):
    """Both callbacks twice, at the same time."""
    return [
        ran(begin_s + late_s, begin_s + late_s + 0.2, of, thread=thread, **changes)
        for begin_s in (1.0, 1.5)
        for of, late_s, thread in ((TICK, 0.0, 1), (HEARD, 0.05, 2))
    ]


def in_turn(**changes):
    """Both callbacks twice, one after the other."""
    return [
        ran(begin_s + late_s, begin_s + late_s + 0.2, of, **changes)
        for begin_s in (1.0, 1.5)
        for of, late_s in ((TICK, 0.0), (HEARD, 0.2))
    ]


def run(*runs, executor=MULTI, threads=4, more=(), **changes):
    spin = declared("spin", pid=1, executor=executor, threads=threads)
    known = declarations(spin=False)
    return recording(declarations=(*known, spin, *more, *runs), **changes)


def logged(*texts):
    """Lines that are printed, a tenth of a second apart."""
    return tuple(
        LogLine(at(1 + number / 10), BOT, "stdout", text) for number, text in enumerate(texts)
    )


@pytest.mark.parametrize("name", ["tick", "Worker.tick", "500 ms", "0.51 s"])
def test_a_callback_goes_by_its_function_or_its_period(name):
    finding = judge("executor.overlap", run(*at_once()), callbacks=["heard", name])
    assert finding.status is Status.PASSED
    called = f"the timer of `{name}`" if name.endswith("s") else f"`{name}`"
    assert f"`heard` overlaps 2 times and {called} overlaps 2 times" in finding.observed
    assert {span.name for span in finding.evidence.spans} == {"heard", name}


def test_a_short_run_within_a_long_one_overlaps_it():
    runs = (ran(1.0, 3.0), ran(1.5, 1.50012, HEARD), ran(2.5, 2.50012, HEARD))
    long = run(ran(1.0, 3.0), *runs[1:], ran(3.1, 5.1), ran(3.6, 3.60012, HEARD))
    assert judge("executor.overlap", long, **BOTH).status is Status.PASSED
    failing("executor.overlap", run(*runs), **BOTH, never=True)


@pytest.mark.parametrize("begin_s", [0.9999, 2.9999])
def test_a_clock_that_steps_makes_no_overlap_at_an_edge(begin_s):
    runs = run(ran(1.0, 3.0), ran(begin_s, begin_s + 0.0002, HEARD))
    assert judge("executor.overlap", runs, **BOTH, never=True, at_least=1).status is Status.PASSED


def test_callbacks_that_never_may_overlap_and_do():
    found = failing("executor.overlap", run(*at_once()), **BOTH, never=True)
    assert "4 runs: `/chatter` overlaps 2 times" in found
    assert "only callbacks of one MutuallyExclusiveCallbackGroup wait for each other" in found
    turn = judge("executor.overlap", run(*in_turn()), **BOTH, never=True)
    assert turn.status is Status.PASSED


def test_a_callback_that_overlaps_itself():
    runs = [ran(begin_s, begin_s + 0.3, thread=begin_s) for begin_s in (1.0, 1.2, 1.4)]
    one = {"callbacks": ["tick"]}
    assert judge("executor.overlap", run(*runs), **one).status is Status.PASSED
    failing("executor.overlap", run(*runs), **one, never=True)
    # Of two that are named, each must overlap with the other.
    failing("executor.overlap", run(*runs, ran(2.0, 2.1, HEARD)), **BOTH)


@pytest.mark.parametrize(
    ("executor", "group", "expected"),
    [
        (SINGLE, f"{REENTRANT} 1", "The MultiThreadedExecutor that was made never spins"),
        (MULTI, f"{EXCLUSIVE} 1", "the node's default group if no callback_group=... is given"),
        (MULTI, f"{REENTRANT} 1", "rclpy.spin(node) and a SingleThreadedExecutor run one"),
    ],
)
def test_callbacks_that_run_in_turn_are_told_why(executor, group, expected):
    made = [declared("made", executor=MULTI)]
    one = run(*in_turn(group=group), executor=executor, more=made)
    assert expected in failing("executor.overlap", one, **BOTH)


def test_what_the_machine_may_have_prevented_is_repeated():
    held_up = taken(1.0, 1.2, 0.15), taken(1.5, 1.7, 0.15)
    finding = judge(
        "executor.overlap", run(*in_turn(), disturbance=(*held_up[0], *held_up[1])), **BOTH
    )
    assert finding.status is Status.ERROR and finding.disturbed
    failing("executor.overlap", run(*in_turn(), disturbance=held_up[0]), **BOTH)


def test_a_callback_that_did_not_run_is_named_with_those_that_did():
    found = failing("executor.overlap", run(ran(1.0, 1.1)), **BOTH)
    assert "`/chatter` ran 0 times, of 1 that are needed; `Worker.tick (0.5 s)` ran" in found


def test_who_declares_nothing_of_callbacks_is_not_judged_by_them():
    events = run(executor="EventsExecutor")
    finding = judge("executor.overlap", events, **BOTH)
    assert finding.status is Status.ERROR and "EventsExecutor" in finding.observed
    compiled = recording(declarations=(), submission=submission(package(build_type="ament_cmake")))
    assert judge("executor.overlap", compiled, **BOTH).status is Status.ERROR


def test_starts_and_ends_in_the_log():
    lines = logged(
        "Start of timer_1", "[INFO] [1.0] [bot]: no logger", "chatter: START", "timer_1 end",
        "chatter: end", "timer_12 start", "timer_1 start", "chatter start", "chatter end",
        "timer_1 end", "timer_1 will start and end",
    )  # fmt: skip
    words = {"callbacks": ["timer_1", "chatter"], "log": ["start", "end"]}
    # A program in C++ declares nothing.
    known = {"log": lines, "declarations": ()}
    finding = judge("executor.overlap", recording(**known), **words)
    assert finding.status is Status.PASSED, finding
    failing("executor.overlap", recording(**known), **words, never=True)


def kind(*runs, of=MULTI, **asked):
    return judge("executor.kind", run(*runs, executor=of, threads=1 + 3 * (of == MULTI)), **asked)


def test_the_kind_of_executor_and_its_threads():
    assert kind(executor=MULTI, threads=4).status is Status.PASSED
    assert kind(of=SINGLE, executor=SINGLE).status is Status.PASSED
    for of, asked in ((SINGLE, {"executor": MULTI}), (MULTI, {"executor": SINGLE})):
        finding = kind(of=of, **asked)
        assert finding.status is Status.FAILED
        assert f"a {of} with" in finding.observed
    assert kind(executor=MULTI, threads=5).status is Status.FAILED


def test_a_wait_for_a_service_before_it_spins_does_not_matter():
    first = declared("spin", pid=1, executor=SINGLE, threads=1)
    one = run(more=[first])
    assert judge("executor.kind", one, executor=MULTI).status is Status.PASSED
    failing("executor.kind", one, executor=SINGLE)


@pytest.mark.parametrize(
    ("tick", "heard", "right"),
    [
        (f"{EXCLUSIVE} 7", f"{EXCLUSIVE} 7", {"same"}),
        (f"{EXCLUSIVE} 7", f"{EXCLUSIVE} 8", {"different"}),
        (f"{REENTRANT} 7", f"{REENTRANT} 7", {"reentrant"}),
        (f"{REENTRANT} 7", f"{EXCLUSIVE} 8", {"different"}),
    ],
)
def test_the_groups_of_callbacks(tick, heard, right):
    runs = ran(1.0, 1.1, group=tick), ran(1.2, 1.3, HEARD, group=heard)
    for groups in ("same", "different", "reentrant"):
        finding = kind(*runs, executor=MULTI, groups=groups, **BOTH)
        wanted = Status.PASSED if groups in right else Status.FAILED
        assert finding.status is wanted, finding
        assert f"`tick` is in {tick.split()[0]}" in finding.observed


def test_declarations_that_contradict_each_other_cost_nothing():
    exclusive = {"group": f"{EXCLUSIVE} 7", "pid": 1}
    contradicting = [
        kind(*at_once(pid=1), of=SINGLE, executor=SINGLE),
        kind(*at_once(**exclusive), executor=MULTI, **BOTH),
        kind(*at_once(**exclusive), executor=SINGLE),
    ]
    for finding in contradicting:
        assert finding.status is Status.ERROR
        assert "`Worker.tick` and `Worker.heard` overlap" in finding.observed
    # In one thread a callback that awaits lets others run; in two processes they are apart.
    in_one_thread = [ran(1.0, 1.3, pid=1), ran(1.1, 1.4, HEARD, pid=1)]
    assert kind(*in_one_thread, of=SINGLE, executor=SINGLE).status is Status.PASSED
    in_two = [ran(1.0, 1.3, pid=1), ran(1.1, 1.4, HEARD, thread=2, pid=2)]
    assert kind(*in_two, of=SINGLE, executor=SINGLE).status is Status.PASSED


def test_a_node_that_never_spins_is_told_so():
    one = recording(declarations=declarations(spin=False))
    assert "rclpy.spin() was never called" in failing("executor.kind", one, executor=SINGLE)


@pytest.mark.parametrize(
    "data", [{}, {"began_ns": "1", "ended_ns": []}, {"began_ns": 2, "ended_ns": 1}]
)
def test_runs_that_no_tracer_wrote_count_for_nothing(data):
    one = run(ran(1.0, 1.1, **data) if data else declared("ran"), ran(1.0, 1.1, HEARD))
    assert "`tick` ran 0 times" in failing("executor.overlap", one, **BOTH)
