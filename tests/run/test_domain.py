"""A domain belongs to one holder at a time."""

from __future__ import annotations

import contextlib

import pytest

from grader.errors import GraderFault
from grader.run.domain import DOMAINS, lock_domain


def test_two_holders_never_have_the_same_domain() -> None:
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(lock_domain()).domain_id for _ in range(20)]
    assert len(set(held)) == 20
    assert set(held) <= set(range(1, 102))


def test_a_released_domain_can_be_locked_again() -> None:
    others = set(DOMAINS) - {lock_and_release()}
    with lock_domain(others) as lock:
        assert lock.domain_id not in others


def lock_and_release() -> int:
    with lock_domain() as lock:
        return lock.domain_id


def test_avoided_domains_are_not_used() -> None:
    with lock_domain(set(DOMAINS) - {17, 18}) as lock:
        assert lock.domain_id in (17, 18)


def test_no_domain_left_is_our_fault() -> None:
    with pytest.raises(GraderFault, match="all ROS domains from 1 to 101 are in use"):
        lock_domain(DOMAINS)
