"""Which Python modules a package's code imports, read from its syntax trees."""

from __future__ import annotations

import ast
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping

from grader.submission.record import Import

_NOT_CODE = frozenset({"test", "tests", "launch", "doc", "docs"})
_GUARDS = frozenset({"ImportError", "ModuleNotFoundError", "Exception", "BaseException"})


def is_code(path: str) -> bool:
    """Whether a Python file of a package counts as its code.

    Args:
        path: Relative to the package.
    """
    *folders, name = path.split("/")
    if folders and folders[0] in _NOT_CODE:
        return False
    if not folders and name == "setup.py":
        return False
    return name != "conftest.py" and not name.endswith((".launch.py", "_launch.py"))


def find_imports(tree: ast.Module, file: str) -> list[Import]:
    """List the modules that a file imports, each once per line.

    Returns:
        Absolute imports, also ``importlib.import_module("literal")`` and
        ``__import__("literal")``, by line. Relative imports stay within the package and are
        left out.
    """
    found = {
        Import(name.partition(".")[0], file, line, optional)
        for name, line, optional in _walk(tree)
        if name
    }
    return sorted(found, key=lambda item: (item.line, item.module, item.optional))


def _walk(tree: ast.Module) -> Iterator[tuple[str, int, bool]]:
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
        pending.extend(
            (child, optional or id(child) in guarded) for child in ast.iter_child_nodes(node)
        )


def _dynamic(call: ast.Call) -> str:
    function = call.func
    name = function.attr if isinstance(function, ast.Attribute) else ""
    name = function.id if isinstance(function, ast.Name) else name
    if name not in ("import_module", "__import__") or not call.args:
        return ""
    first = call.args[0]
    if isinstance(first, ast.Constant) and isinstance(first.value, str):
        return "" if first.value.startswith(".") else first.value
    return ""


def _guarded(node: ast.AST) -> set[int]:
    """Identities of the children without which the code still runs."""
    if isinstance(node, ast.Try) and any(map(_catches_import_error, node.handlers)):
        return {id(child) for child in (*node.body, *node.handlers)}
    if isinstance(node, ast.If) and _is_type_checking(node.test):
        return {id(child) for child in node.body}
    return set()


def _catches_import_error(handler: ast.ExceptHandler) -> bool:
    kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return any(kind is None or _last_name(kind) in _GUARDS for kind in kinds)


def _is_type_checking(test: ast.expr) -> bool:
    return _last_name(test) == "TYPE_CHECKING"


def _last_name(node: ast.expr) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def ros_imports(
    imports: Iterable[Import],
    *,
    own: Collection[str],
    packages: Mapping[str, str],
) -> list[Import]:
    """Keep the imports that a ROS package must provide."""
    return [
        Import(packages[item.module], item.file, item.line, item.optional)
        for item in imports
        if item.module in packages
        and item.module not in own
        and item.module not in sys.stdlib_module_names
    ]
