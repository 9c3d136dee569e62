"""The console scripts of a package, as setup.py and setup.cfg declare them."""

from __future__ import annotations

import configparser
import re
from dataclasses import dataclass

from grader.submission.intake.paths import join
from grader.submission.read import source
from grader.submission.read.setup_py import Text, Value, setup_keywords
from grader.submission.record import SourceError

_GROUP = "console_scripts"
_MAX_TEXT = 500
_SPEC = re.compile(
    r"\s*(?P<name>[^=\[\]]+?)\s*=\s*(?P<module>[\w.]+)\s*(:\s*(?P<function>[\w.]+))?"
    r"\s*(\[[^\]]*\])?\s*"
)
# Python before 3.13 raises an AttributeError where a name without a value is followed by an
# indented line (python/cpython#107625).
_UNREADABLE = (configparser.Error, AttributeError)


@dataclass(frozen=True)
class EntryPoint:
    """A console script.

    Attributes:
        function: Dotted name in the module, empty where none is named.
        line: Line there, or None.
    """

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
    """What a package's setup.py and setup.cfg say.

    Attributes:
        name: The distribution's name, or None where it cannot be told.
        entry_points: The console scripts, in order.
        package_dir: Folder of the Python packages below the package, ``.`` or such as ``src``.
    """

    name: str | None = None
    entry_points: tuple[EntryPoint, ...] = ()
    malformed: tuple[SourceError, ...] = ()
    package_dir: str = "."


def read_setup(
    setup_py: bytes | None,
    setup_cfg: bytes | None,
    folder: str,
    allowance: source.Allowance | None = None,
) -> Setup:
    """Read the two files; what setup.py says wins, as for setuptools.

    Args:
        setup_py: Content of setup.py, or None where there is none.
        setup_cfg: Content of setup.cfg, or None.
    """
    file = join(folder, "setup.py")
    keywords: dict[str, Value] = {}
    tree = source.parse(setup_py or b"", file, allowance)
    if not isinstance(tree, SourceError):
        keywords = setup_keywords(tree)
    scripts = _scripts(keywords.get("entry_points"))
    config = _config(setup_cfg)
    if not scripts:
        file = join(folder, "setup.cfg")
        scripts = _lines(Text(_get(config, "options.entry_points", _GROUP), 0))
    name = keywords.get("name")
    found, malformed = [], []
    for script in scripts:
        entry = parse_entry_point(script.value, file, script.line or None)
        if entry is not None:
            found.append(entry)
        else:
            malformed.append(_malformed(script, file))
    return Setup(
        name=name.value if isinstance(name, Text) else _get(config, "metadata", "name") or None,
        entry_points=tuple(found),
        malformed=tuple(malformed),
        package_dir=_package_dir(keywords.get("package_dir")),
    )


def parse_entry_point(text: str, file: str, line: int | None = None) -> EntryPoint | None:
    """Parse ``name = module:function``; None when setuptools would not accept it."""
    match = _SPEC.fullmatch(text) if len(text) <= _MAX_TEXT else None
    if match is None:
        return None
    return EntryPoint(match["name"], match["module"], match["function"] or "", file, line)


def parse_installed(text: str, file: str) -> list[EntryPoint]:
    """Parse the ``entry_points.txt`` of an installed distribution."""
    parser = _Parser()
    try:
        parser.read_string(text)
    except _UNREADABLE:
        return []
    found = []
    for name, value in parser.items(_GROUP) if parser.has_section(_GROUP) else []:
        entry = parse_entry_point(f"{name}={value}", file)
        if entry is not None:
            found.append(entry)
    return found


def _scripts(entry_points: Value | None) -> list[Text]:
    if isinstance(entry_points, Text):
        # The whole of it may be given as the text of an INI file.
        section = re.search(rf"\[{_GROUP}\]([^\[]*)", entry_points.value)
        return _lines(Text(section[1], entry_points.line)) if section else []
    if not isinstance(entry_points, dict):
        return []
    scripts = entry_points.get(_GROUP)
    if isinstance(scripts, Text):
        return _lines(scripts)
    if isinstance(scripts, list):
        return [script for script in scripts if isinstance(script, Text)]
    return []


def _lines(text: Text) -> list[Text]:
    lines = (line.strip() for line in text.value.splitlines())
    return [Text(line, text.line) for line in lines if line and not line.startswith("#")]


def _malformed(script: Text, file: str) -> SourceError:
    message = f"the entry point {script.value!r} is not of the form 'name = module:function'"
    return SourceError(file, script.line or None, message)


def _package_dir(value: Value | None) -> str:
    root = value.get("") if isinstance(value, dict) else None
    return root.value.strip("/") or "." if isinstance(root, Text) else "."


class _Parser(configparser.ConfigParser):
    def __init__(self) -> None:
        super().__init__(interpolation=None, strict=False, delimiters=("=",), allow_no_value=True)

    def optionxform(self, optionstr: str) -> str:
        """Keep the case: executables are told apart by it."""
        return optionstr


def _config(data: bytes | None) -> configparser.ConfigParser:
    parser = _Parser()
    try:
        parser.read_string((data or b"").decode("utf-8", "replace"))
    except _UNREADABLE:
        return _Parser()
    return parser


def _get(parser: configparser.ConfigParser, section: str, option: str) -> str:
    return parser.get(section, option, fallback="") or ""
