from __future__ import annotations

import ast
from collections.abc import Collection

import pytest

from grader.submission.read.setup_py import parse_entry_point
from grader.submission.read.targets import Modules, missing_target

FILES = {
    "bot_publisher/__init__.py": "",
    "bot_publisher/bot_publisher.py": "def main(): pass\nclass Node: pass\n",
}


def missing(
    target: str,
    files: dict[str, str | None] | None = None,
    installed: Collection[str] | None = None,
) -> str | None:
    """What is said of an executable with this target."""
    entry = parse_entry_point(f"bot_pub = {target}", "setup.py", 7)
    assert entry is not None
    chosen: dict[str, str | None] = {**FILES} if files is None else files
    trees = {path: None if text is None else ast.parse(text) for path, text in chosen.items()}
    return missing_target(entry, Modules(trees, installed), elsewhere={"rclpy", "json"})


def with_node(source: str | None) -> dict[str, str | None]:
    return {"bot/__init__.py": "", "bot/node.py": source}


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (
            "bot_publisher.bot_publisher:mian",
            "bot_publisher/bot_publisher.py has no function 'mian'. Did you mean 'main'?",
        ),
        (
            "bot_publisher.publisher_node:main",
            "there is no module bot_publisher/publisher_node.py; "
            "the package has bot_publisher/bot_publisher.py",
        ),
        (
            "my_publisher.bot_publisher:main",
            "there is no module my_publisher/bot_publisher.py; "
            "the package has bot_publisher/bot_publisher.py",
        ),
        (
            "bot_publisher.bot_publisher",
            "names no function; write 'bot_pub = bot_publisher.bot_publisher:main'",
        ),
    ],
)
def test_what_a_target_lacks_is_reported_with_the_nearest(target: str, message: str) -> None:
    assert missing(target) == message


def test_a_function_that_is_not_there_is_reported_with_those_that_are() -> None:
    assert missing("bot.node:main", with_node("def run(): pass\nx = 1\n")) == (
        "bot/node.py has no function 'main'. It has 'run'."
    )


def test_a_folder_without_init_is_why_a_module_is_not_installed() -> None:
    files: dict[str, str | None] = {"bot/__init__.py": "", "bot/nodes/pub.py": "def main(): pass"}
    assert missing("bot.nodes.pub:main", files, installed={"bot/__init__.py"}) == (
        "bot/nodes/pub.py is not installed: there is no bot/nodes/__init__.py"
    )


def test_packages_in_setup_py_may_be_why_a_module_is_not_installed() -> None:
    message = missing("bot.node:main", with_node("def main(): pass"), installed=set())
    assert message == "bot/node.py is not installed: setup.py's 'packages' leaves it out"


@pytest.mark.parametrize(
    "source",
    [
        "async def main(): pass",
        "class main: pass",
        "main = lambda: None",
        "from .other import run as main",
        "try:\n    import x\nexcept ImportError:\n    def main(): pass",
        "with open('x') as main: pass",
        "from .other import *",
        "def __getattr__(name): pass",
        "globals()['main'] = print",
        None,
    ],
)
def test_in_doubt_a_function_exists(source: str | None) -> None:
    assert missing("bot.node:main", with_node(source)) is None


@pytest.mark.parametrize(
    "source", ["class Node:\n    def main(self): pass", "if __name__ == '__main__':\n    main()"]
)
def test_a_method_or_a_call_is_no_function_of_the_module(source: str) -> None:
    message = missing("bot.node:main", with_node(source))
    assert message is not None
    assert message.startswith("bot/node.py has no function 'main'.")


def test_modules_of_others_are_not_looked_into() -> None:
    assert missing("json.tool:main") is None
