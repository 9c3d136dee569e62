"""What setup.py passes to ``setup()``, read from its syntax tree without running it.

Covers what students and ``ros2 pkg create`` write: literals, names assigned at the top, f-strings
and ``+``. What needs running stays unknown, until the build shows it.
"""

from __future__ import annotations

import ast
import contextlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Union

from grader.recording.submission import EMPTY, SourceError
from grader.submission.intake.paths import join, shown
from grader.submission.read import source

_GROUP = "console_scripts"
_MAX_TEXT = 10_000
_MAX_ENTRY = 500
_ENTRY = re.compile(
    r"\s*(?P<name>[^=\[\]]+?)\s*=\s*(?P<module>[\w.]+)\s*(:\s*(?P<function>[\w.]+))?"
    r"\s*(\[[^\]]*\])?\s*"
)
_INSTALLED = re.compile(rf"^\[{_GROUP}\]\s*$(.*?)(?=^\[|\Z)", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class EntryPoint:
    """A console script; its function is empty where none is named."""

    name: str
    module: str
    function: str
    file: str
    line: int | None = None

    @property
    def target(self) -> str:
        """``module:function``, or the module alone."""
        return f"{self.module}:{self.function}" if self.function else self.module


@dataclass(frozen=True)
class Setup:
    """A package's setup.py.

    Attributes:
        name: Of the distribution, if it is known.
        refused: What no build can use: an empty file, entries of console_scripts that ``setup()``
            refuses.
    """

    name: str | None = None
    entry_points: tuple[EntryPoint, ...] = ()
    refused: tuple[SourceError, ...] = ()


class _Text(str):
    """A string and the line where it stands."""

    line: int


_Value = Union[_Text, "list[_Value]", "dict[str, _Value]", None]


def read_setup(
    setup_py: bytes | None, folder: str, allowance: source.Allowance | None = None
) -> Setup:
    """Read a setup.py; None stands for one that is not there."""
    file = join(folder, "setup.py")
    if setup_py is not None and not setup_py.strip():
        return Setup(refused=(SourceError(file, None, EMPTY),))
    tree = source.parse(setup_py or b"", file, allowance)
    keywords: Mapping[str, _Value] = {}
    if not isinstance(tree, SourceError):
        # A value may be nested too deeply; then nothing of the call is known.
        with contextlib.suppress(RecursionError):
            keywords = _setup_keywords(tree)
    entries: list[EntryPoint] = []
    refused: list[SourceError] = []
    for text, line in _console_scripts(keywords.get("entry_points")):
        entry = parse_entry_point(text, file, line)
        if entry is None:
            refused.append(SourceError(file, line, _refusal(text)))
        else:
            entries.append(entry)
    name = keywords.get("name")
    return Setup(str(name) if isinstance(name, _Text) else None, tuple(entries), tuple(refused))


def _console_scripts(entry_points: _Value) -> Iterator[tuple[str, int]]:
    """The entries of console_scripts as they are written, each with its line.

    setuptools takes lines of a text as well, and leaves out empty ones and comments.
    """
    scripts = entry_points.get(_GROUP) if isinstance(entry_points, dict) else None
    for text in scripts if isinstance(scripts, list) else [scripts]:
        if isinstance(text, _Text):
            for line in map(str.strip, text.splitlines()):
                if line and not line.startswith("#"):
                    yield line, text.line


def _refusal(text: str) -> str:
    shown_text = shown(text[:_MAX_ENTRY])
    # Python joins two texts with nothing between them.
    if text.count("=") > 1:
        return f"a comma is missing between two entries of console_scripts: {shown_text}"
    return f"an entry of console_scripts is not 'executable = module:function': {shown_text}"


def parse_entry_point(text: str, file: str, line: int | None = None) -> EntryPoint | None:
    """Parse ``name = module:function``; None when setuptools would not accept it."""
    match = _ENTRY.fullmatch(text) if len(text) <= _MAX_ENTRY else None
    if match is None:
        return None
    return EntryPoint(match["name"], match["module"], match["function"] or "", file, line)


def parse_installed(text: str, file: str) -> list[EntryPoint]:
    """Parse the ``entry_points.txt`` of an installed distribution."""
    section = _INSTALLED.search(text)
    if section is None:
        return []
    entries = (parse_entry_point(line, file) for line in section[1].split("\n"))
    return [entry for entry in entries if entry is not None]


def _setup_keywords(tree: ast.Module) -> dict[str, _Value]:
    """The keyword arguments of the first call of ``setup``, as far as they are known."""
    names: dict[str, _Value] = {}
    for node in tree.body:
        if isinstance(node, ast.Assign):
            value = _value(node.value, names)
            names.update((item.id, value) for item in node.targets if isinstance(item, ast.Name))
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and _is_setup(call.func):
            return {one.arg: _value(one.value, names) for one in call.keywords if one.arg}
    return {}


def _is_setup(function: ast.expr) -> bool:
    return getattr(function, "attr", getattr(function, "id", "")) == "setup"


def _value(node: ast.expr, names: Mapping[str, _Value]) -> _Value:
    """What an expression is; None where it would have to be run."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return _joined([node.value], node)
    if isinstance(node, ast.Name):
        value = names.get(node.id)
        return _joined([value], node) if isinstance(value, str) else value
    if isinstance(node, ast.List | ast.Tuple):
        return [_value(item, names) for item in node.elts]
    if isinstance(node, ast.Dict):
        # `**others` has no key.
        keys = [None if key is None else _value(key, names) for key in node.keys]
        return {
            key: _value(item, names)
            for key, item in zip(keys, node.values, strict=True)
            if isinstance(key, str)
        }
    if isinstance(node, ast.JoinedStr):
        return _joined([_value(part, names) for part in node.values], node)
    if isinstance(node, ast.FormattedValue) and node.format_spec is None:
        return _value(node.value, names)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _joined([_value(node.left, names), _value(node.right, names)], node)
    return None


def _joined(parts: Sequence[_Value | str], node: ast.expr) -> _Text | None:
    texts = [part for part in parts if isinstance(part, str)]
    if len(texts) < len(parts) or sum(map(len, texts)) > _MAX_TEXT:
        return None
    text = _Text("".join(texts))
    text.line = node.lineno
    return text
