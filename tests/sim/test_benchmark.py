"""The benchmark runs; how fast is for ``make bench`` to say."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy")

from grader.run.cell.domain import lock_domain
from sim.benchmark import share_of_core


@pytest.mark.ros
@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")
def test_the_share_of_a_core_is_a_share() -> None:
    with lock_domain() as lock:
        assert 0.0 < share_of_core(0.2, lock.domain_id) < 8.0
