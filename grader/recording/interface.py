"""What an interface is made of: fields and constants, from the text of its definition.

Sources: https://docs.ros.org/en/jazzy/Concepts/Basic/About-Interfaces.html,
https://mcap.dev/spec/registry, "ros2msg"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

INTEGERS: dict[str, tuple[int, int]] = {
    "byte": (0, 255),
    "char": (0, 255),
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
"""Primitive integers -> lowest and highest value."""
FLOATS = ("float32", "float64")
TEXTS = ("string", "wstring")
PRIMITIVES = ("bool", *INTEGERS, *FLOATS, *TEXTS)

_LINE = re.compile(
    r"(?P<type>(?:[A-Za-z]\w*/)*[A-Za-z]\w*)(?:<=(?P<length>\d+))?"
    r"(?P<array>\[(?P<upto><=)?(?P<count>\d*)\])?\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)"
)
_SEPARATOR = "---"
FEEDBACK = "_FeedbackMessage"
"""What ROS appends to the name of an action for the type of its topic of feedback."""


class DefinitionError(ValueError):
    """A line of a definition is neither a field nor a constant."""

    def __init__(self, line: int, text: str) -> None:
        """Keep the number of the line, from 1."""
        self.line = line
        super().__init__(f"line {line}: {text!r} is neither `type name` nor `type NAME=value`")


@dataclass(frozen=True)
class Field:
    """One field of a message.

    Attributes:
        type: ``float64``, ``string``, ... or the full name of a message.
        count: Values of an array of fixed size, or None.
        most: Largest number of values of a bounded array, or None.
        longest: Largest length of a bounded text, or None.
    """

    name: str
    type: str
    is_array: bool = False
    count: int | None = None
    most: int | None = None
    longest: int | None = None

    @property
    def is_message(self) -> bool:
        """Whether its values are messages themselves."""
        return "/" in self.type

    def __str__(self) -> str:
        """Write it as a definition does, bounds and all: ``float64[2] wheels``."""
        package, _, name = self.type.replace("/msg/", "/").rpartition("/")
        text = f"{package}/{name}" if package else name
        if self.longest is not None:
            text += f"<={self.longest}"
        if self.is_array:
            bound = f"<={self.most}" if self.most is not None else ""
            text += f"[{bound if self.count is None else self.count}]"
        return f"{text} {self.name}"


@dataclass(frozen=True)
class Constant:
    """One constant of a message; a number as its value is as Python writes it."""

    name: str
    type: str
    value: str

    def __str__(self) -> str:
        """Write it as a definition does."""
        return f"{self.type} {self.name}={self.value}"


@dataclass(frozen=True)
class Section:
    """A message, or one part of a service (request, response) or of an action.

    Attributes:
        fields: In their order, which is the order of the bytes too.
        lines: Name of each field and constant -> its line in the definition, from 1.
    """

    fields: tuple[Field, ...]
    constants: tuple[Constant, ...]
    lines: Mapping[str, int]


def sections_of(interface: str, text: str) -> tuple[Section, ...]:
    """The parts of a definition: one of a message, two of a service, three of an action."""
    package = interface.partition("/")[0]
    parts: list[list[tuple[int, Field | Constant]]] = [[]]
    for number, line in enumerate(text.splitlines(), start=1):
        written = line.partition("#")[0].strip()
        if written == _SEPARATOR:
            parts.append([])
        elif written:
            found = _read(written, package)
            if found is None:
                raise DefinitionError(number, written)
            parts[-1].append((number, found))
    return tuple(
        Section(
            tuple(item for _, item in part if isinstance(item, Field)),
            tuple(item for _, item in part if isinstance(item, Constant)),
            {item.name: number for number, item in part},
        )
        for part in parts
    )


def fields_of(interface: str, text: str) -> dict[str, Field]:
    """The fields of a message by name, in their order; constants are none."""
    package = interface.partition("/")[0]
    read = (_read(line.partition("#")[0].strip(), package) for line in text.splitlines())
    return {found.name: found for found in read if isinstance(found, Field)}


def _read(line: str, package: str) -> Field | Constant | None:
    match = _LINE.fullmatch(line)
    if match is None:
        return None
    kind = _full_type(match["type"], package)
    if match["rest"].startswith("="):
        return Constant(match["name"], kind, _plain(kind, match["rest"][1:].strip()))
    count = int(match["count"]) if match["count"] else None
    return Field(
        name=match["name"],
        type=kind,
        is_array=match["array"] is not None,
        count=None if match["upto"] else count,
        most=count if match["upto"] else None,
        longest=int(match["length"]) if match["length"] else None,
    )


def _plain(kind: str, written: str) -> str:
    """The value of a constant, the same however it was written."""
    try:
        if kind in INTEGERS:
            return str(int(written, 0))
        if kind in FLOATS:
            return repr(float(written))
    except ValueError:
        return written
    if kind == "bool":
        return {"1": "true", "0": "false"}.get(written, written.lower())
    return written[1:-1] if len(written) > 1 and written[0] == written[-1] in "\"'" else written


def _full_type(name: str, package: str) -> str:
    if name in PRIMITIVES:
        return name
    parts = name.split("/")
    return f"{parts[0] if len(parts) > 1 else package}/msg/{parts[-1]}"


def definition_finder(prefixes: Iterable[Path]) -> Callable[[str], str]:
    """Make a function from ``package/msg/Name`` to its text; KeyError where there is none."""
    folders = tuple(prefixes)

    def find(interface: str) -> str:
        for prefix in folders:
            file = prefix / "share" / f"{interface}.{interface.split('/')[1]}"
            if file.is_file():
                return file.read_text(encoding="utf-8")
        return feedback_definition(interface, find)

    return find


def feedback_definition(interface: str, find: Callable[[str], str]) -> str:
    """What an action publishes as feedback, of which there is no file; KeyError for all else."""
    package, _, name = interface.split("/")
    action = name.removesuffix(FEEDBACK)
    if action != name:
        find(f"{package}/action/{action}")
        return f"unique_identifier_msgs/UUID goal_id\n{package}/{action}_Feedback feedback\n"
    action = name.removesuffix("_Feedback")
    if action == name:
        raise KeyError(interface)
    lines = find(f"{package}/action/{action}").splitlines()
    starts = [number for number, line in enumerate(lines) if line.strip() == _SEPARATOR]
    return "\n".join(lines[starts[1] + 1 :])


def concatenated_definition(interface: str, find: Callable[[str], str]) -> str:
    """A definition with those of all messages that it contains, as ``ros2msg`` schemas are."""
    texts: dict[str, str] = {}
    queue = [interface]
    while queue:
        name = queue.pop(0)
        if name not in texts:
            texts[name] = find(name)
            inner = fields_of(name, texts[name]).values()
            queue += [field.type for field in inner if field.is_message]
    main, *others = texts.items()
    parts = [f"{'=' * 80}\nMSG: {name.replace('/msg/', '/')}\n{text}" for name, text in others]
    return "\n".join([main[1], *parts])
