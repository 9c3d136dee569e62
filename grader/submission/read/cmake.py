"""Commands of a CMakeLists.txt, read to explain it and never executed.

A small reader of the language's syntax: comments, quoted and bracket arguments, variables that
``set`` and ``list(APPEND ...)`` fill. What it cannot know (functions, conditions, globs) it
leaves as it is written, so what it says is a hint and no verdict.

Source: https://cmake.org/cmake/help/latest/manual/cmake-language.7.html
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

_TOKEN = re.compile(
    r"""
    (?P<bracket>\#?\[(?P<level>=*)\[)
    |(?P<comment>\#[^\n]*)
    |"(?P<quoted>(?:\\.|[^"\\])*)"
    |(?P<open>\()
    |(?P<close>\))
    |(?P<separator>[\s;]+)
    |(?P<word>(?:\\.|[^\s()"\#;\\])+)
    |(?P<other>.)
    """,
    re.VERBOSE | re.DOTALL,
)
_REFERENCE = re.compile(r"\$\{(\w+)\}")
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
    """The commands of a CMakeLists.txt in their order; what comes after broken syntax is lost."""
    variables: dict[str, str] = {}
    found = []
    for name, written, line in _commands(text):
        arguments = tuple(_expanded(written, variables))
        found.append(CMakeCommand(name, arguments, line))
        if name == "project" and arguments:
            variables["PROJECT_NAME"] = arguments[0]
        elif name == "set" and arguments:
            variables[arguments[0]] = _joined(arguments[1:])
        elif name == "list" and len(arguments) > 2 and arguments[0] == "APPEND":
            known = variables.get(arguments[1])
            variables[arguments[1]] = _joined((*([known] if known else []), *arguments[2:]))
    return tuple(found)


def _joined(values: tuple[str, ...]) -> str:
    return ";".join(values)[:_LONGEST_VALUE]


def _commands(text: str) -> Iterator[tuple[str, list[tuple[str, bool]], int]]:
    """Name, arguments (with whether they are quoted) and line of each command."""
    name, name_line, depth = "", 0, 0
    arguments: list[tuple[str, bool]] = []
    for kind, value, line in _tokens(text):
        if kind == "open":
            depth += 1
        elif kind == "close":
            depth -= 1
            if depth == 0 and name:
                yield name.lower(), arguments, name_line
            if depth <= 0:
                name, arguments, depth = "", [], 0
        elif depth:
            if kind in ("word", "quoted"):
                arguments.append((value, kind == "quoted"))
        elif kind == "word":
            name, name_line = value, line


def _tokens(text: str) -> Iterator[tuple[str, str, int]]:
    """Kind, value and line of everything but comments and blanks."""
    position, line = 0, 1
    while position < len(text):
        match = _TOKEN.match(text, position)
        assert match is not None  # any character is a token
        end = match.end()
        kind, value = match.lastgroup or "", match[0]
        if match["bracket"]:
            closing = f"]{match['level']}]"
            inner_end = text.find(closing, end)
            if inner_end < 0:
                return
            kind, value = "quoted", text[end:inner_end]
            end = inner_end + len(closing)
        elif match["quoted"] is not None:
            kind, value = "quoted", re.sub(r"\\(.)", r"\1", match["quoted"], flags=re.DOTALL)
        if kind in ("open", "close", "word") or (kind == "quoted" and match[0][0] != "#"):
            yield kind, value, line
        line += text.count("\n", position, end)
        position = end


def _expanded(written: list[tuple[str, bool]], variables: Mapping[str, str]) -> Iterator[str]:
    """Fill in the variables that are known; an unquoted list is several arguments."""
    for text, quoted in written:
        filled = _REFERENCE.sub(lambda match: variables.get(match[1], match[0]), text)
        filled = filled[:_LONGEST_VALUE]
        yield from (filled,) if quoted else filter(None, filled.split(";"))
