"""Commands of a CMakeLists.txt, read to explain it and never executed.

A small reader of the language's syntax: comments, quoted arguments, variables that ``set`` and
``list(APPEND ...)`` fill. What it cannot know (functions, conditions, globs) it leaves as it is
written, so what it says is a hint and no verdict.

Source: https://cmake.org/cmake/help/latest/manual/cmake-language.7.html
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

_TOKEN = re.compile(
    r"""
    \#?\[(?P<level>=*)\[(?P<bracket>.*?)(\](?P=level)\]|\Z)
    |\#[^\n]*
    |"(?P<quoted>(?:\\.|[^"\\])*)"
    |(?P<parenthesis>[()])
    |(?P<word>(?:\\.|[^\s()"\#;\\])+)
    """,
    re.VERBOSE | re.DOTALL,
)
_REFERENCE = re.compile(r"\$\{(\w+)\}")
_FOLDER = ("CMAKE_CURRENT_SOURCE_DIR", "CMAKE_SOURCE_DIR", "PROJECT_SOURCE_DIR")
# A list may be made of itself again and again.
_LONGEST_VALUE = 10_000


@dataclass(frozen=True)
class CMakeCommand:
    """One command.

    Attributes:
        name: In lower case; CMake does not care.
        arguments: As written, without quotes; variables are filled in where they are known.
        line: Where its name stands, from 1.
    """

    name: str
    arguments: tuple[str, ...]
    line: int

    def after(self, keyword: str, keywords: frozenset[str]) -> tuple[str, ...] | None:
        """The arguments behind a keyword, up to the next one; None where it is not there."""
        if keyword not in self.arguments:
            return None
        rest = self.arguments[self.arguments.index(keyword) + 1 :]
        end = next((i for i, item in enumerate(rest) if item in keywords), len(rest))
        return rest[:end]


def read_commands(text: str) -> tuple[CMakeCommand, ...]:
    """The commands of a CMakeLists.txt in their order."""
    variables = dict.fromkeys(_FOLDER, ".")
    found = []
    for name, written, line in _commands(text):
        arguments = tuple(_expanded(written, variables))
        found.append(CMakeCommand(name, arguments, line))
        if name == "project" and arguments:
            variables["PROJECT_NAME"] = arguments[0]
        elif name == "set" and arguments:
            variables[arguments[0]] = ";".join(arguments[1:])[:_LONGEST_VALUE]
        elif name == "list" and len(arguments) > 2 and arguments[0] == "APPEND":
            parts = (variables.get(arguments[1], ""), *arguments[2:])
            variables[arguments[1]] = ";".join(filter(None, parts))[:_LONGEST_VALUE]
    return tuple(found)


def _commands(text: str) -> Iterator[tuple[str, list[tuple[str, bool]], int]]:
    """Name, arguments (with whether they are quoted) and line of each command."""
    name, line, depth, position = "", 1, 0, 0
    arguments: list[tuple[str, bool]] = []
    for match in _TOKEN.finditer(text):
        quoted = match["bracket"] if match[0][0] == "[" else match["quoted"]
        if match["parenthesis"] == "(":
            depth += 1
        elif match["parenthesis"]:
            depth -= 1
            if depth == 0 and name:
                yield name.lower(), arguments, line
            if depth <= 0:
                name, arguments, depth = "", [], 0
        elif depth and quoted is not None:
            arguments.append((re.sub(r"\\(.)", r"\1", quoted, flags=re.DOTALL), True))
        elif depth and match["word"]:
            arguments.append((match["word"], False))
        elif match["word"]:
            name = match["word"]
            line += text.count("\n", position, match.start())
            position = match.start()


def _expanded(written: list[tuple[str, bool]], variables: Mapping[str, str]) -> Iterator[str]:
    """Fill in the variables that are known; an unquoted list is several arguments."""
    for text, quoted in written:
        filled = _REFERENCE.sub(lambda match: variables.get(match[1], match[0]), text)
        filled = filled[:_LONGEST_VALUE]
        yield from (filled,) if quoted else filter(None, filled.split(";"))
