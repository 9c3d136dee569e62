"""Whose CPU time is lost when processes end: pure, and of processes of this machine."""

from __future__ import annotations

import random
import select
import subprocess
import sys

import pytest

from grader.sandbox.cpu_time import OrphanCpu
from grader.sandbox.usage import Process, Taken, usage_of

PARENT, CHILD, OTHER = Process(10, 1), Process(11, 2), Process(12, 3)
# Two at a time, each for 100 ms of CPU time.
RELAY = """\
import os, signal, time
signal.signal(signal.SIGCHLD, {action})
for _ in range(5):
    for _ in range(2):
        if os.fork() == 0:
            while time.process_time() < .1:
                pass
            os._exit(0)
    try:
        # Both have ended then, and their parent has their time or none has it.
        os.wait(), os.wait()
    except ChildProcessError:
        pass
print(flush=True)
input()
"""


def looked(*there: dict[Process, Taken]) -> OrphanCpu:
    account = OrphanCpu()
    for one in there:
        account.look(one)
    return account


def test_what_a_child_took_that_was_waited_for_is_its_parent_s() -> None:
    before = {PARENT: Taken(5, 0), CHILD: Taken(30, 10)}
    after = {PARENT: Taken(5, 45)}
    for there in ((before, after, after), (before, {PARENT: Taken(5, 0)}, after)):
        assert (looked(*there).ticks, looked(*there).ended) == (0, 0)


def test_what_a_child_took_without_a_parent_s_wait_is_kept() -> None:
    before, after = {PARENT: Taken(5, 7), CHILD: Taken(30, 10)}, {PARENT: Taken(5, 7)}
    account = looked(before, before, before, after)
    assert account.ticks == 0
    account.look(after)
    assert (account.ticks, account.ended) == (40, 1)
    account.look(after)
    assert (account.ticks, account.ended) == (40, 0)


def test_a_process_that_is_missing_in_a_complete_look_has_ended() -> None:
    account = looked({PARENT: Taken(5, 0), CHILD: Taken(30, 0), OTHER: Taken(0, 0)})
    account.look({PARENT: Taken(5, 0)}, complete=True)
    assert (account.ticks, account.ended) == (30, 2)


def test_one_that_could_not_be_read_once_has_not_ended() -> None:
    both = {PARENT: Taken(5, 0), CHILD: Taken(30, 0)}
    assert looked(both, {PARENT: Taken(5, 0)}, both, both).ticks == 0


def test_what_one_was_waited_for_covers_no_other_one() -> None:
    all_three = {PARENT: Taken(0, 0), CHILD: Taken(30, 0), OTHER: Taken(40, 0)}
    left = {PARENT: Taken(0, 31)}
    assert looked(all_three, left, left).ticks == 70 - 31


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_lost_of_a_tree_in_which_all_are_waited_for(seed: int) -> None:
    """Processes are read at any moment of a look, and end at any moment too."""
    chance = random.Random(seed)
    parents: dict[Process, Process] = {}
    taken = {PARENT: [0, 0]}

    def happen() -> None:
        for one in chance.sample(list(taken), len(taken)):
            taken[one][0] += chance.randrange(9)
            if len(taken) < 12 and chance.random() < 0.3:
                child = Process(len(parents), 0)
                parents[child], taken[child] = one, [0, 0]
            childless = one in parents and not any(parents.get(other) == one for other in taken)
            if childless and chance.random() < 0.5:
                taken[parents[one]][1] += sum(taken.pop(one))

    account, knowing = OrphanCpu(), OrphanCpu()
    for _ in range(60):
        there = {}
        listed = list(taken)
        for one in chance.sample(listed, len(listed)):
            if one in taken:
                there[one] = Taken(*taken[one])
            if chance.random() < 0.2:
                happen()
        account.look(there)
        knowing.look(there, complete=len(there) == len(listed))
        happen()
        assert (account.ticks, account.ended) == (0, 0)
        assert (knowing.ticks, knowing.ended) == (0, 0)


@pytest.mark.parametrize("action", ["signal.SIG_DFL", "signal.SIG_IGN"])
def test_the_time_of_children_counts_whether_they_are_waited_for_or_not(action: str) -> None:
    account = OrphanCpu()
    script = RELAY.format(action=action)
    command = [sys.executable, "-S", "-c", script]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        # The time between two looks; all have ended when it writes a line.
        while not select.select([parent.stdout], [], [], 0.02)[0]:
            account.used_s(usage_of([parent.pid]))
        # A process that is missing twice has ended for certain.
        account.used_s(usage_of([parent.pid]))
        stolen_s = account.used_s(usage_of([parent.pid]))
        parent.communicate(b"\n")
    assert 0.3 < stolen_s < 1.3
