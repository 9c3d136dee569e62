"""Hostile submissions: the right node, with something added to it."""

from __future__ import annotations

from pathlib import Path

from tests.submission.samples import MANIFEST, SETUP_CFG, SETUP_PY

NODE = """\
import os, signal, subprocess, sys, threading, time
import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

{at_import}

class BotPublisher(Node):
    def __init__(self):
        super().__init__({name!r})
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.timer = self.create_timer(0.1, self.tick)
        self.count = 0

    def tick(self):
        self.count += 1
        message = Twist()
        message.linear.x = 1.0
        self.publisher.publish(message)
        if self.count == 3:
            attack(self)


def attack(node):
{attack}


def main():
    rclpy.init()
    node = BotPublisher()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
"""


def indented(source: str) -> str:
    """As the body of a function."""
    return "\n".join(f"    {line}" for line in (source or "pass").splitlines())


def write_submission(
    folder: Path,
    *,
    attack: str = "",
    at_import: str = "",
    at_build: str = "",
    name: str = "bot_publisher",
    files: dict[str, str] | None = None,
) -> Path:
    """Make a package.

    Args:
        folder: Where to.
        attack: Body of what the node does after its third message.
        at_import: Run when the node's module is imported.
        at_build: Run by setup.py before anything else.
        name: Of the node.
        files: Further files, path -> content.
    """
    contents = {
        "package.xml": MANIFEST,
        "setup.py": at_build + "\n" + SETUP_PY,
        "setup.cfg": SETUP_CFG,
        "resource/bot_publisher": "",
        "bot_publisher/__init__.py": "",
        "bot_publisher/node.py": NODE.format(
            name=name, at_import=at_import, attack=indented(attack)
        ),
        **(files or {}),
    }
    for path, text in contents.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return folder
