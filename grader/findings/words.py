"""Words: a sentence that is said in one way to students of Python, and in another to those of C++.

Both are written where it is written at all, and one of them is said as soon as the text is made:
that of the language of the package that is judged, see :func:`speaking`. A text is never changed
afterwards, so names, numbers and printed lines stand in it as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from pydantic.dataclasses import dataclass

from grader.recording.submission import CPP, PYTHON

_SPOKEN = ContextVar("language", default=PYTHON)


@dataclass(
    frozen=True,
    config={"extra": "forbid", "json_schema_extra": {"x-words": "`{python: text, cpp: text}`"}},
)
class Words:
    """A sentence for later: ``str()`` and f-strings say it in the language that is spoken then."""

    python: str
    cpp: str

    def __str__(self) -> str:
        """Say it."""
        return worded(self.python, self.cpp)


def worded(python: str, cpp: str) -> str:
    """A sentence in the language that is spoken now."""
    return cpp if _SPOKEN.get() == CPP else python


def type_in_code(name: str) -> str:
    """How a program names an interface, such as ``std_msgs/msg/String``."""
    package, kind, short = name.split("/")
    return worded(f"from {package}.{kind} import {short}", f"{package}::{kind}::{short}")


@contextmanager
def speaking(language: str) -> Iterator[None]:
    """Say all words in this language meanwhile."""
    token = _SPOKEN.set(language)
    try:
        yield
    finally:
        _SPOKEN.reset(token)


# Terms that stand in many sentences.
INIT = Words("rclpy.init()", "rclcpp::init(argc, argv)")
SPIN = Words("rclpy.spin()", "rclcpp::spin()")
SPIN_NODE = Words("rclpy.spin(node)", "rclcpp::spin(node)")
SLEEP = Words("time.sleep()", "std::this_thread::sleep_for()")
MATH = Words("math.", "std::")
REENTRANT = Words("ReentrantCallbackGroup", "Reentrant callback group")
EXCLUSIVE = Words("MutuallyExclusiveCallbackGroup", "MutuallyExclusive callback group")
TERMS = {name: term for name, term in vars().items() if isinstance(term, Words)} | {
    "ARROW": Words(".", "->"),
    "A_PROFILE": Words("a QoSProfile", "an rclcpp::QoS"),
    "INPUT": Words("input()", "std::cin"),
    "LOG": Words("self.get_logger().info('...')", 'RCLCPP_INFO(get_logger(), "...")'),
    "SILENT_EXCEPT": Words("`except: pass`", "empty `catch (...)`"),
}
"""Terms by the name that they have in the tables of hints."""


def group_class(declared: str) -> str:
    """The class of a callback group; the tracers of both languages declare that of Python."""
    return str(next((one for one in (EXCLUSIVE, REENTRANT) if one.python == declared), declared))
