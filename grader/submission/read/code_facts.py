"""What a student's Python files say, kept as plain facts: classes, functions, hints, prints.

The facts travel in the submission's record, so that a check of the source judges again
without the files.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SourceClass:
    """A class.

    Attributes:
        name: Qualified in its module, such as ``Outer.Inner`` or ``make.<locals>.Bot``.
        bases: As written: ``Node``, ``rclpy.node.Node``; of a call such as ``mixed(Node)`` the
            names in it.
    """

    name: str
    line: int
    bases: tuple[str, ...] = ()
    documented: bool = False


@dataclass(frozen=True)
class SourceFunction:
    """A function or method.

    Attributes:
        name: Qualified in its module, such as ``Bot.callback`` or ``main.<locals>.help``.
        unannotated: Parameters without a type hint; ``self`` and ``cls`` are left out.
    """

    name: str
    line: int
    documented: bool = False
    decorators: tuple[str, ...] = ()
    unannotated: tuple[str, ...] = ()
    returns: bool = False


@dataclass(frozen=True)
class SourceFile:
    """A Python file that runs; at most 2000 of each kind of thing in it.

    Attributes:
        module: Dotted name that it is imported by, such as ``bot.node``.
        names: What imports and plain assignments name: local name -> dotted name.
        stars: Modules of ``from module import *``.
        prints: Lines with ``print`` to the console.
    """

    path: str
    module: str
    documented: bool = False
    classes: tuple[SourceClass, ...] = ()
    functions: tuple[SourceFunction, ...] = ()
    names: tuple[tuple[str, str], ...] = ()
    stars: tuple[str, ...] = ()
    prints: tuple[int, ...] = ()


@dataclass(frozen=True)
class LintFinding:
    """A place that breaks a rule; its code is such as ``F401``."""

    code: str
    file: str
    line: int
    message: str


@dataclass(frozen=True)
class Lint:
    """What ruff says of a package: at most 20 findings of each rule, or why there are none."""

    problem: str | None = None
    findings: tuple[LintFinding, ...] = ()
