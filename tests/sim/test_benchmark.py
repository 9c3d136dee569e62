"""The benchmark runs; how fast is for ``make bench`` to say."""

from __future__ import annotations

import math

import pytest

from sim.benchmark import random_world, scan_s, share_of_core, step_s


def test_the_world_has_the_walls_that_were_asked_for_and_room_for_the_robot() -> None:
    world = random_world(50)
    assert len(world.shapes) == 50
    assert min(shape.clearance_m(0.0, 0.0) for shape in world.shapes) > 1.0
    assert random_world(50) == world


def test_figures_are_times() -> None:
    for figure in (step_s(10, steps=20), scan_s(10, scans=5)):
        assert 0.0 < figure < math.inf


@pytest.mark.ros
@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")
def test_the_share_of_a_core_is_a_share() -> None:
    pytest.importorskip("rclpy")
    from grader.run.cell.domain import lock_domain

    with lock_domain() as lock:
        assert 0.0 < share_of_core(10, 0.2, lock.domain_id) < 8.0
