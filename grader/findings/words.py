"""Words that findings are made of: lists, counts and numbers as people read them, and sentences.

A sentence may be said in one way to students of Python, and in another to those of C++. Both are
written where it is written at all, and one of them is said as soon as the text is made:
that of the language of the package that is judged, see :func:`speaking`. A text is never changed
afterwards, so names, numbers and printed lines stand in it as they are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from pydantic.dataclasses import dataclass

from grader.recording.submission import CPP, PYTHON

_SPOKEN = ContextVar("language", default=PYTHON)
_LISTED = 8
_LONGEST_TEXT = 120


def code(text: str) -> str:
    """Mark a name or a piece of code."""
    return f"`{text}`"


def listing(items: Iterable[str], last: str = "and") -> str:
    """Write ``a, b and c``; of a long list the first few and how many more there are."""
    words = list(dict.fromkeys(items))
    if len(words) > _LISTED:
        words = [*words[:_LISTED], f"{len(words) - _LISTED} more"]
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def codes(items: Iterable[str], last: str = "and") -> str:
    """:func:`listing` of names, each marked as code."""
    return listing((code(item) for item in items), last)


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """Write ``1 message`` or ``12 messages``."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def value_text(value: Any) -> str:
    """Write a value of a message field exactly, so that two different ones never look alike."""
    if value is None:
        text = "nothing"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, float):
        text = repr(value) if math.isfinite(value) else str(value)
    elif isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray):
        head = ", ".join(value_text(item) for item in value[:_LISTED])
        text = f"[{head}{', ...' if len(value) > _LISTED else ''}]"
    else:
        text = repr(value)
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."


def percent(ratio: float) -> str:
    """Write a ratio as ``5 %``."""
    return f"{ratio * 100.0:.4g} %"


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


_SIDES = ("ahead", "on its left", "behind it", "on its right")


def metres(length_m: float) -> str:
    """Write a length: ``1.25 m``, ``3.2 cm`` or ``0.4 mm``, three digits."""
    size = abs(length_m)
    if size >= 0.1:
        return f"{length_m:.3g} m"
    if size >= 1e-3:
        return f"{length_m * 1e2:.3g} cm"
    return f"{length_m * 1e3:.2g} mm" if size else "0 m"


def speed(speed_m_s: float) -> str:
    """Write a speed: ``0.1 m/s``."""
    return f"{speed_m_s:.3g} m/s"


def turn(speed_rad_s: float) -> str:
    """Write an angular speed: ``0.5 rad/s``."""
    return f"{round(speed_rad_s, 6) + 0.0:.3g} rad/s"


def degrees(angle_rad: float) -> str:
    """Write an angle: ``90°``, ``2.5°``."""
    shown = math.degrees(angle_rad)
    return f"{shown:.0f}°" if abs(shown) >= 10.0 else f"{shown:.2g}°"


def point(x_m: float, y_m: float) -> str:
    """Write a position in the world's frame: ``(1.20, -0.35) m``."""
    return f"({x_m + 0.0:.2f}, {y_m + 0.0:.2f}) m"


def side(bearing_rad: float) -> str:
    """Write where something is as seen from the robot, by its bearing from straight ahead."""
    return _SIDES[round(math.remainder(bearing_rad, math.tau) / (math.pi / 2.0)) % 4]
