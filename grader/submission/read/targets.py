"""Whether the ``module:function`` of an executable exists, told from syntax trees.

In doubt (star imports, broken files, modules of others) it exists: a wrong accusation is worse
than a missed one, and the run will show it anyway.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from grader.spec.nearest_name import did_you_mean, nearest
from grader.submission.intake.paths import shown
from grader.submission.read.entrypoints import EntryPoint
from grader.submission.record import SourceError


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
        return next((p for p in (f"{path}.py", f"{path}/__init__.py") if p in self.trees), None)

    @property
    def folders(self) -> set[str]:
        """Top-level modules that the package has."""
        return {path.partition("/")[0].removesuffix(".py") for path in self.trees}


def missing_target(
    entry: EntryPoint, modules: Modules, *, elsewhere: Collection[str]
) -> SourceError | None:
    """Say what an executable's target lacks.

    Returns:
        None when the target exists or may exist.
    """
    path = modules.find(entry.module)
    if path is None:
        top = entry.module.partition(".")[0]
        if top in elsewhere and top not in modules.folders:
            return None
        return _error(entry, _no_module(entry.module, modules))
    if modules.installed is not None and path not in modules.installed:
        return _error(entry, _not_installed(path, modules))
    if not entry.function:
        return _error(entry, f"names no function; write '{entry.name} = {entry.module}:main'")
    function = entry.function.partition(".")[0]
    tree = modules.trees[path]
    if tree is None:
        return None
    names = defined_names(tree)
    if names is None or function in names:
        return None
    near = did_you_mean(function, names) or _functions(tree)
    return _error(entry, f"{shown(path)} has no function {function!r}.{near}")


def _error(entry: EntryPoint, message: str) -> SourceError:
    return SourceError(entry.file, entry.line, message)


def _no_module(module: str, modules: Modules) -> str:
    path = f"{module.replace('.', '/')}.py"
    message = f"there is no module {path}"
    known = [other for other in modules.trees if not other.endswith("__init__.py")]
    name = path.rpartition("/")[2]
    same_name = sorted(other for other in known if other.rpartition("/")[2] == name)
    match = same_name[0] if same_name else nearest(path, known)
    if match is None and len(known) == 1:
        match = known[0]
    return f"{message}; the package has {shown(match)}" if match else message


def _not_installed(path: str, modules: Modules) -> str:
    folder = path
    while "/" in folder:
        folder = folder.rpartition("/")[0]
        if f"{folder}/__init__.py" not in modules.trees:
            return f"{shown(path)} is not installed: there is no {shown(folder)}/__init__.py"
    return f"{shown(path)} is not installed: setup.py's 'packages' leaves it out"


def _functions(tree: ast.Module) -> str:
    found = [
        node.name for node in tree.body if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
    ]
    return f" It has {', '.join(map(repr, found[:5]))}." if found else ""


def defined_names(tree: ast.Module) -> set[str] | None:
    """List the names that a module defines when it is imported.

    Returns:
        Functions, classes, variables and imports at its top level, also below ``if``, ``try``,
        ``with`` and loops; None where it could define any name (star import, ``__getattr__``,
        ``globals()``, ``exec``).
    """
    names: set[str] = set()
    used: set[str] = set()
    for node in _top_level(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names.update(alias.asname or alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.Name):
            (names if isinstance(node.ctx, ast.Store) else used).add(node.id)
    in_doubt = names & {"*", "__getattr__"} or used & {"globals", "exec", "setattr"}
    return None if in_doubt else names


def _top_level(tree: ast.Module) -> Iterator[ast.AST]:
    """Everything that runs at import: all nodes but the insides of functions and classes."""
    pending: list[ast.AST] = list(tree.body)
    while pending:
        node = pending.pop()
        yield node
        if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)):
            pending.extend(ast.iter_child_nodes(node))
