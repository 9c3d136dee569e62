"""Executables of setup.py that run each other's function are named, wherever it shows."""

from dataclasses import replace

import pytest

from grader.diagnosis.exchanged_executables import why_exchanged
from tests.checks.builder import (
    BOT,
    failing,
    node,
    package,
    process,
    recording,
    submission,
)


def with_entries(run, **entries):
    packages = (package(entry_points=tuple(entries.items())),)
    return replace(run, submission=submission(*packages))


EXCHANGED = {"bot_pub": "bot_publisher.bot_sub:main", "bot_sub": "bot_publisher.bot_pub:main"}


def test_a_node_of_the_other_executable():
    run = with_entries(recording(nodes=(node("/bot_sub"),), declarations=()), **EXCHANGED)
    said = failing("node.exists", run, name="/bot_pub")
    assert "the executable `bot_pub` runs `bot_publisher.bot_sub:main`" in said
    assert "super().__init__" not in said


@pytest.mark.parametrize(
    "entries",
    [
        {"bot_pub": "bot_publisher.node:main"},
        {"bot_pub": "bot_publisher.bot_pub:main", "bot_sub": "bot_publisher.bot_sub:main"},
        # A module may bear the name of an executable that runs something else of it.
        {"bot_pub": "bot_publisher.bot_sub:publish", "bot_sub": "bot_publisher.bot_sub:main"},
    ],
)
def test_what_runs_its_own_is_not_blamed(entries):
    assert why_exchanged(with_entries(recording(), **entries)) is None


def test_where_both_run_neither_is_blamed():
    both = recording(processes=(process(BOT), process("bot_publisher/bot_sub")))
    assert why_exchanged(with_entries(both, **EXCHANGED)) is None


def test_one_function_for_two_executables():
    both = {"bot_pub": "bot_publisher.bot_sub:main", "bot_sub": "bot_publisher.bot_sub:main"}
    assert why_exchanged(with_entries(recording(), **both)) is not None
