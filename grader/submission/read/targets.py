"""Whether the ``module:function`` of an executable exists, by the syntax trees.

In doubt (star imports, broken files, modules of others) it exists: a wrong accusation is worse
than a missed one, and the run will show it anyway.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from grader.spec.nearest_name import did_you_mean, nearest
from grader.submission.intake.paths import parents, shown
from grader.submission.read.setup_py import EntryPoint

_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_DEFINITIONS = (*_FUNCTIONS, ast.ClassDef)


@dataclass(frozen=True)
class Modules:
    """The Python modules of a package.

    Attributes:
        trees: Path such as ``bot_publisher/node.py`` -> tree, or None where it does not parse.
        installed: Paths of those that the build installed, or None where nothing was built.
    """

    trees: Mapping[str, ast.Module | None]
    installed: Collection[str] | None = None

    def find(self, module: str) -> str | None:
        """Path of a module given by its dotted name."""
        path = module.replace(".", "/")
        for file in (f"{path}.py", f"{path}/__init__.py"):
            if file in self.trees:
                return file
        return None

    @property
    def top_level(self) -> set[str]:
        """Top-level modules that the package has."""
        return {path.partition("/")[0].removesuffix(".py") for path in self.trees}


def missing_target(
    entry: EntryPoint, modules: Modules, *, elsewhere: Collection[str]
) -> str | None:
    """What an executable's target lacks; None when it exists or may exist.

    Args:
        elsewhere: Top-level modules of other packages.
    """
    path = modules.find(entry.module)
    if path is None:
        top = entry.module.partition(".")[0]
        if top in elsewhere and top not in modules.top_level:
            return None
        return _no_module(f"{entry.module.replace('.', '/')}.py", modules)
    if modules.installed is not None and path not in modules.installed:
        return _why_not_installed(path, modules)
    if not entry.function:
        return f"names no function; write '{entry.name} = {entry.module}:main'"
    tree = modules.trees[path]
    if tree is None:
        return None
    # Of `module:Class.method` the class has to be there.
    function = entry.function.partition(".")[0]
    names = defined_names(tree)
    if names is None or function in names:
        return None
    functions = [node.name for node in tree.body if isinstance(node, _FUNCTIONS)]
    hint = did_you_mean(function, names)
    if not hint and functions:
        hint = f" It has {', '.join(map(repr, functions[:5]))}."
    return f"{shown(path)} has no function {function!r}.{hint}"


def _no_module(path: str, modules: Modules) -> str:
    others = [other for other in modules.trees if not other.endswith("__init__.py")]
    match = nearest(path, others, cutoff=0.0)
    hint = f"; the package has {shown(match)}" if match else ""
    return f"there is no module {path}{hint}"


def _why_not_installed(path: str, modules: Modules) -> str:
    for folder in parents(path):
        if f"{folder}/__init__.py" not in modules.trees:
            return f"{shown(path)} is not installed: there is no {shown(folder)}/__init__.py"
    return f"{shown(path)} is not installed: setup.py's 'packages' leaves it out"


def defined_names(tree: ast.Module) -> set[str] | None:
    """Names that a module defines when it is imported, also below ``if``, ``try`` and loops.

    Returns:
        None where it could define any name (star import, ``__getattr__``, ``globals()``).
    """
    names: set[str] = set()
    used: set[str] = set()
    for node in _top_level(tree):
        if isinstance(node, _DEFINITIONS):
            names.add(node.name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names.update(alias.asname or alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.Name):
            if isinstance(node.ctx, ast.Store):
                names.add(node.id)
            else:
                used.add(node.id)
    in_doubt = names & {"*", "__getattr__"} or used & {"globals", "exec", "setattr"}
    return None if in_doubt else names


def _top_level(tree: ast.Module) -> Iterator[ast.AST]:
    """Everything that runs at import: all nodes but the insides of functions and classes."""
    pending: list[ast.AST] = list(tree.body)
    while pending:
        node = pending.pop()
        yield node
        if not isinstance(node, (*_DEFINITIONS, ast.Lambda)):
            pending.extend(ast.iter_child_nodes(node))
