"""What is valid in an assignment, but looks like a slip."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.assignment.doubts import doubts
from grader.assignment.load import list_assignments, load_assignment
from tests.assignment.lessons import HEAD


def told(folder: Path, run: str, uses: str) -> list[str]:
    (folder / "lesson").mkdir()
    check = f"  - {{id: some, uses: {uses}, points: 1}}\n"
    text = HEAD.replace("timeout: 5 s", f"timeout: 5 s\n    {run}") + check
    (folder / "lesson" / "assignment.yaml").write_text(text, encoding="utf-8")
    loaded = load_assignment(folder / "lesson")
    return [doubt for doubt in doubts(loaded, []) if doubt.startswith("the check 'some' needs")]


@pytest.mark.parametrize(
    ("run", "uses", "doubt"),
    [
        (
            "until: {messages: 3}",
            "messages.count, with: {topic: /cmd_vel, at_least: 4}",
            "needs 4 messages, but the scenario 'run' ends after 3 messages",
        ),
        (
            "until: {messages: 5}",
            "timing.period, with: {topic: /cmd_vel, period: 300 ms}",
            "needs 6 messages, one every 300 ms, but the scenario 'run' ends after 5 messages",
        ),
        (
            "until: {elapsed: 4 s}",
            "timing.period, with: {topic: /cmd_vel, period: 2 s}",
            "needs 6 messages, one every 2 s, but the scenario 'run' ends after 5 s",
        ),
    ],
)
def test_a_run_that_ends_too_soon_for_its_check_is_told(
    tmp_path: Path, run: str, uses: str, doubt: str
) -> None:
    assert told(tmp_path, run, uses) == [f"the check 'some' {doubt}"]


@pytest.mark.parametrize(
    ("run", "uses"),
    [
        ("until: {messages: 4}", "messages.count, with: {topic: /cmd_vel, at_least: 4}"),
        ("until: {messages: 1, quiet: 2 s}", "messages.count, with: {topic: /cmd_vel, exactly: 2}"),
        ("until: {elapsed: 4 s}", "messages.count, with: {topic: /cmd_vel, at_most: 100}"),
    ],
)
def test_a_run_that_may_go_on_is_not_doubted(tmp_path: Path, run: str, uses: str) -> None:
    assert told(tmp_path, run, uses) == []


@pytest.mark.parametrize("name", list_assignments())
def test_what_is_shipped_leaves_no_doubt(name: str) -> None:
    assert [one for one in doubts(load_assignment(name), None) if "mutants" not in one] == []
