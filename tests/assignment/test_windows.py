"""Windows in YAML: what cannot be is told with its line, before any run."""

from __future__ import annotations

from collections.abc import Callable

import pytest

LESSON = """\
rosgrade: 1
id: lesson
title: A lesson
packages:
  - {name: bot, executables: [bot]}
scenarios:
  - id: run
    launch: [{executable: bot}]
    record:
      - {topic: /speed, type: std_msgs/msg/Float64}
      - {topic: /bot/transition_event, type: lifecycle_msgs/msg/TransitionEvent}
    stimuli:
      - {publish: /start, type: std_msgs/msg/Float64, message: {data: 1.0}}
    timeout: 9 s
checks:
  - id: it
    uses: USES
    points: 1
"""
COUNT = "messages.count\n    with: {topic: /speed, at_least: 1}"
Found = Callable[..., list[str]]


@pytest.fixture
def found(mistakes: Callable[[str], list[str]], ros_with: Callable[..., None]) -> Found:
    """Load the lesson with a check that has a window."""
    ros_with({"std_msgs/msg/Float64": "float64 data\n", "lifecycle_msgs/msg/TransitionEvent": ""})
    return lambda window, uses=COUNT: mistakes(
        LESSON.replace("USES", uses) + "".join(f"    {line}\n" for line in window.splitlines())
    )


@pytest.mark.parametrize(
    "window",
    [
        "from: 3 s\nto: 8 s",
        "after: {message: /start}\nto: 1 s",
        "after: {message: /speed, fields: {data: '> 0'}}\nbefore: {log: done}",
        "while: {lifecycle: inactive, node: bot}",
    ],
)
def test_a_window_that_can_open_is_accepted(found: Found, window: str) -> None:
    assert found(window) == []


@pytest.mark.parametrize(
    ("window", "said"),
    [
        ("from: 9 s", "checks[0].from: the scenario 'run' ends after 9 s at the latest"),
        ("from: 3 s\nto: 3 s", "'to' is not later than 'from'"),
        ("from: 3", "3 has no unit"),
        ("while: {robot: moves}", "while: the scenario 'run' has no 'world'"),
        ("while: {robot: dances}", "expected 'touches', 'moves' or 'rests', not 'dances'"),
        ("after: {message: /sped}", "after.message: the scenario 'run' does not record '/sped'."),
        ("after: {message: /speed, fields: {dat: 1}}", "after.fields: /speed (std_msgs/msg/Float6"),
        ("after: {message: /start, fields: {data: up}}", "'up' is expected of it"),
        (
            "while: {lifecycle: inactive, node: bod}",
            "does not record '/bod/transition_event'",
        ),
        ("while: {lifecycle: inactive}", "'lifecycle' and 'node' go together"),
        ("while: {lifecycle: idle, node: bot}", "expected 'unconfigured', 'inactive', 'active' or"),
        ("while: {log: a, robot: moves}", "give one of: message, lifecycle, robot, log"),
        ("while: {}", "give one of: message, lifecycle, robot, log"),
        ("while: {log: a, fields: {x: 1}}", "'fields' are those of a 'message'"),
        ("during: {log: a}", "unknown key 'during'"),
    ],
)
def test_a_window_that_cannot_open_is_told_with_its_line(
    found: Found, window: str, said: str
) -> None:
    (mistake,) = found(window)
    assert said in mistake


def test_what_was_handed_in_has_no_windows(found: Found) -> None:
    (mistake,) = found("to: 3 s", "package.builds\n    with: {package: bot}")
    assert "not a run: leave 'from, to, after, before and while' out" in mistake
