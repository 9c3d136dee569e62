"""Whether what a student sends keeps the cell waiting for its own middleware."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from grader.run import stall
from grader.run.stall import Stall


@pytest.fixture
def busy_s(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    """CPU times of the middleware, a second for each look, and a cell that never waits for long."""
    monkeypatch.setattr(stall, "_STILL_S", 0.0)
    seconds = [0.0]
    monkeypatch.setattr(stall, "_received_s", lambda: seconds[0])
    yield seconds


def test_a_middleware_that_works_without_end_is_noticed(busy_s: list[float]) -> None:
    found = Stall()
    assert not found.lasts()
    busy_s[0] = 4.0
    assert not found.lasts()
    busy_s[0] = 6.0
    assert found.lasts()
    # It is rescued once.
    assert not found.lasts()


def test_whoever_goes_on_is_never_stalled(
    busy_s: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Stall()
    assert not found.lasts()
    busy_s[0] = 6.0
    monkeypatch.setattr(stall, "_STILL_S", 1e9)
    found.tick()
    assert not found.lasts()
    monkeypatch.setattr(stall, "_STILL_S", 0.0)
    assert not found.lasts()


def test_a_run_that_is_over_needs_no_rescue(busy_s: list[float]) -> None:
    found = Stall()
    assert not found.lasts()
    found.end()
    busy_s[0] = 60.0
    assert not found.lasts()
