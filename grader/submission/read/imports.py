"""Which Python modules a package's code imports, read from its syntax trees."""

from __future__ import annotations

import ast
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace

from grader.recording.submission import Import

_NOT_CODE = frozenset({"test", "tests", "launch", "doc", "docs"})
_GUARDS = frozenset({"ImportError", "ModuleNotFoundError", "Exception", "BaseException"})


def is_code(path: str) -> bool:
    """Whether a Python file counts as its package's code; the path is relative to the package."""
    *folders, name = path.split("/")
    if path == "setup.py" or name == "conftest.py" or _NOT_CODE.intersection(folders[:1]):
        return False
    return not name.endswith((".launch.py", "_launch.py"))


def find_imports(tree: ast.Module, file: str) -> list[Import]:
    """List the modules that a file imports, each once per line.

    Returns:
        Absolute imports, also ``importlib.import_module("literal")``, by line. Relative imports
        stay within the package and are left out.
    """
    imports = {
        Import(name.partition(".")[0], file, line, optional)
        for name, line, optional in _walk(tree)
        if name
    }
    return sorted(imports, key=lambda item: (item.line, item.module, item.optional))


def _walk(tree: ast.Module) -> Iterator[tuple[str, int, bool]]:
    """Name and line of each import, and whether the code runs without it; some have no name."""
    # A stack instead of recursion: how deep the tree is, is up to the student.
    pending: list[tuple[ast.AST, bool]] = [(tree, False)]
    while pending:
        node, optional = pending.pop()
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno, optional) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module or "", node.lineno, optional
        elif isinstance(node, ast.Call):
            yield _dynamic(node), node.lineno, optional
        guarded = _guarded(node)
        pending += [(child, optional or child in guarded) for child in ast.iter_child_nodes(node)]


def _dynamic(call: ast.Call) -> str:
    if _last_name(call.func) not in ("import_module", "__import__") or not call.args:
        return ""
    name = getattr(call.args[0], "value", None)
    return name if isinstance(name, str) and not name.startswith(".") else ""


def _guarded(node: ast.AST) -> set[ast.AST]:
    """The children of a node without which the code still runs."""
    if isinstance(node, ast.Try) and any(map(_catches_import_error, node.handlers)):
        return {*node.body, *node.handlers}
    if isinstance(node, ast.If) and _last_name(node.test) == "TYPE_CHECKING":
        return {*node.body}
    return set()


def _catches_import_error(handler: ast.ExceptHandler) -> bool:
    kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return any(kind is None or _last_name(kind) in _GUARDS for kind in kinds)


def _last_name(node: ast.expr) -> str:
    name = getattr(node, "attr", getattr(node, "id", ""))
    assert isinstance(name, str)
    return name


def ros_imports(
    imports: Iterable[Import], *, own: Collection[str], packages: Mapping[str, str]
) -> list[Import]:
    """Keep the imports that a ROS package must provide, named after that package."""
    return [
        replace(item, module=packages[item.module])
        for item in imports
        if item.module in packages
        and item.module not in own
        and item.module not in sys.stdlib_module_names
    ]
