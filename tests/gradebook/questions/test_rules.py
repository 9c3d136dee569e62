"""What a student is asked: moments that were recorded and lines that are there, always three."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import pytest

from grader.gradebook.questions import Work, ask
from grader.recording.event import Disturbance
from grader.recording.model import NS, Recording
from tests.checks.builder import (
    after,
    at,
    declarations,
    every,
    message,
    messages,
    recording,
    twist,
)

NODE = """\
import rclpy
from rclpy.node import Node


class Bot(Node):
    def __init__(self):
        super().__init__('bot')
        self.speed = self.declare_parameter('speed', 0.2).value
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.timer = self.create_timer(0.3, self.tick)

    def tick(self):
        command = Twist()
        # command.linear.x = 7.0
        command.linear.x = self.speed
        if self.count > 7 and not self.arrived:
            command.linear.x = 0.0
        self.publisher.publish(command)
"""
FILES = {"src/bot/bot/node.py": NODE, "src/bot/setup.py": "setup(name='bot', zip_safe=True)\n"}


def asked(
    *recordings: Recording, files: dict[str, str] = FILES, usual: Collection[str] = ()
) -> str:
    """The three questions with their evidence, a line each."""
    questions = ask(Work(recordings, files, usual))
    assert len(questions) == 3
    assert questions == ask(Work(recordings, files, usual))
    return "\n".join(" | ".join([one.text, *one.evidence]) for one in questions)


def test_source_alone_gives_three_questions_about_lines_that_are_there() -> None:
    text = asked()
    assert "`node.py:10` creates a timer" in text and "three times as long?" in text
    assert "`node.py:9` creates a publisher. With what QoS?" in text
    assert "`node.py:16` reads `if self.count > 7 and not self.arrived:`" in text
    assert "setup.py" not in text


def test_a_timer_is_asked_about_with_the_period_that_was_recorded() -> None:
    text = asked(recording(declarations=declarations()))
    assert "three times as long?" in text and "every 0.3 s" in text


def test_a_value_that_changes_at_once_is_asked_about_with_its_time_and_its_lines() -> None:
    values = [twist((0.2 if index < 8 else 0.0, 0, 0)) for index in range(12)]
    sent = tuple(
        message(time_s, value, sequence=number)
        for number, (time_s, value) in enumerate(zip(every(0.3), values, strict=True), 1)
    )
    text = asked(recording(messages={"/cmd_vel": sent}))
    first = text.partition("\n")[0]
    assert "3.1 s after launch, `linear.x` on `/cmd_vel` goes from 0.2 to 0." in first
    assert "`src/bot/bot/node.py:15` is `command.linear.x = self.speed`" in first
    assert "node.py:17" in first and "node.py:14" not in first


def test_a_pause_is_asked_about_unless_the_machine_made_it() -> None:
    run = recording(messages=messages(after([0.3] * 6 + [2.0] + [0.3] * 4)))
    assert "2.5 s after launch, `/cmd_vel` falls silent for 2 s" in asked(run)
    busy = Disturbance(at(4.5), waited_ns=2 * NS, late_ns=0)
    assert "silent" not in asked(replace(run, disturbance=(busy,)))


def test_what_few_others_have_is_asked_before_what_all_have() -> None:
    usual = {line.strip() for line in NODE.split("\n")} - {"self.publisher.publish(command)"}
    assert "`self.publisher.publish(command)`" in asked(usual=usual).partition("\n")[0]


def test_cpp_is_asked_about_too() -> None:
    cpp = """\
Bot::Bot() : Node("bot") {
  declare_parameter<double>("speed", 0.2);
  publisher_ = create_publisher<Twist>("/cmd_vel", 10);
  timer_ = create_wall_timer(300ms, [this] { tick(); });
}
"""
    text = asked(files={"src/bot.cpp": cpp})
    assert all(f"`bot.cpp:{line}`" in text for line in (2, 3, 4))


@pytest.mark.parametrize(
    "hostile",
    [
        "self.declare_parameter('a(', 1)\nself.declare_parameter('`', [\n" * 3,
        "create_timer(" * 100_000,
        "x = 1\n" * 100_000 + "if (\n" + "y" * 200_000,
    ],
)
def test_no_source_makes_the_rules_fail(hostile: str) -> None:
    assert isinstance(ask(Work((recording(),), {"a.py": hostile})), list)


def test_where_there_is_no_program_nothing_is_asked() -> None:
    assert ask(Work((), {"README.md": "if only there were a program"})) == []
