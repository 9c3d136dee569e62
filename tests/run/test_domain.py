"""A domain belongs to one holder at a time."""

from __future__ import annotations

import contextlib

import pytest

from grader.errors import GraderFault
from grader.run.cell.domain import DOMAINS, domains_of_ports, lock_domain


def test_two_holders_never_have_the_same_domain() -> None:
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(lock_domain()).domain_id for _ in range(20)]
    assert len(set(held)) == 20
    assert set(held) <= set(range(1, 102))


def test_avoided_domains_are_not_used_and_a_released_one_is_again() -> None:
    for _ in range(2):
        with lock_domain(set(DOMAINS) - {17}) as lock:
            assert lock.domain_id == 17


def test_no_domain_left_is_our_fault() -> None:
    with pytest.raises(GraderFault, match="all ROS domains from 1 to 101 are in use"):
        lock_domain(DOMAINS)


@pytest.mark.parametrize(
    ("ports", "domains"),
    [
        pytest.param((), (), id="nobody"),
        pytest.param((7400, 7410, 7411, 45_123), (0,), id="a participant with a socket to send"),
        pytest.param((7400, 7412, 7413), (0,), id="the second one on this machine"),
        pytest.param((7400, 7410, 7411, 18_150, 18_160, 18_161), (0, 43), id="two domains"),
        pytest.param((44_900, 44_910, 44_911), (150,), id="one among the ephemeral ports"),
        # 34900 is 7400 + 250 * 110, and any socket may get it.
        pytest.param((7400, 7410, 7411, 34_900), (0,), id="a port that the system chose"),
        pytest.param((34_900, 34_911, 34_912), (), id="ports of nobody in particular"),
    ],
)
def test_a_domain_is_joined_by_a_participant_and_not_by_any_socket(
    ports: tuple[int, ...], domains: tuple[int, ...]
) -> None:
    assert domains_of_ports(ports) == domains
