"""Hostile submissions: the right node, with something added to it."""

from __future__ import annotations

from pathlib import Path

from tests.compiled.packages import write_package
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

COMPILED_NODE = """\
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/uio.h>
#include <unistd.h>
#include <geometry_msgs/msg/twist.h>
#include "before.hpp"
#include "rcl_node.hpp"

class BotPublisher : public Node
{
public:
  BotPublisher(int argc, char ** argv)
  : Node(argc, argv, "NAME")
  {
    publisher = create_publisher(
      ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, Twist), "/cmd_vel", 10);
    create_wall_timer(100, [this] {tick();}, "BotPublisher::tick()");
  }

  void tick()
  {
    geometry_msgs__msg__Twist message{};
    message.linear.x = 1.0;
    check(rcl_publish(publisher, &message, nullptr));
    if (++count == 3) {
      attack();
    }
  }

  void attack()
  {
    ATTACK
  }

  int count = 0;
  rcl_publisher_t * publisher;
};

int main(int argc, char ** argv)
{
  AT_IMPORT
  BotPublisher node(argc, argv);
  node.spin();
}
"""


def compiled_node(attack: str = "", at_import: str = "", name: str = "bot_publisher") -> str:
    """The source of the node in C++."""
    source = COMPILED_NODE.replace("AT_IMPORT", at_import)
    return source.replace("ATTACK", attack).replace("NAME", name)


def write_compiled_submission(
    folder: Path, *, attack: str, at_import: str, at_build: str, name: str, files: dict[str, str]
) -> Path:
    """Make a package in C++.

    Args:
        folder: Where to.
        attack: What the node does after its third message.
        at_import: What main() begins with.
        at_build: Run by CMake before anything is built.
        name: Of the node.
        files: Further files, path -> content; `before.hpp` is included by the node.
    """
    programs = {"bot_pub": compiled_node(attack, at_import, name)}
    write_package(folder, "bot_publisher", programs, ("geometry_msgs",), at_build)
    for path, text in {"src/before.hpp": "", **files}.items():
        (folder / "bot_publisher" / path).write_text(text, encoding="utf-8")
    return folder


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
