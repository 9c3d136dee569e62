"""From the syntax tree of a student's Python file to the facts that checks of the source need.

Nothing is imported or run; names are kept as they are written, and the checks find out what they
stand for.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from grader.recording.submission import SourceCall, SourceClass, SourceFile, SourceFunction

_MOST = 2000
_LONGEST_NAME = 200
_CONSOLE = ("sys.stdout", "sys.stderr", "stdout", "stderr", "sys.__stdout__", "sys.__stderr__")

_ABSTRACT = ("abstractmethod", "abstractproperty")
_LITERAL = re.compile(r"[\w/~{}.-]{1,200}")

_Function = ast.FunctionDef | ast.AsyncFunctionDef


class _Scope(NamedTuple):
    prefix: str = ""
    in_class: bool = False
    owner: str = ""
    """The class that it is in, or that its method is of."""


def outline(tree: ast.Module, path: str, module: str) -> SourceFile:
    """Take the facts from a syntax tree."""
    classes: list[SourceClass] = []
    functions: list[SourceFunction] = []
    names: dict[str, str] = {}
    stars: list[str] = []
    prints: dict[ast.expr, int] = {}
    to_file: set[ast.expr] = set()
    uses: set[str] = set()
    sets: list[tuple[str, int]] = []
    calls: list[SourceCall] = []
    constructs: list[tuple[str, int]] = []
    fields: dict[str, dict[str, int]] = {}
    redefined = False
    for node, scope in _walk(tree):
        if isinstance(node, ast.ClassDef):
            classes.append(_class(node, scope))
            redefined |= node.name == "print"
        elif isinstance(node, _Function):
            functions.append(_function(node, scope))
            redefined |= node.name == "print" and not scope.in_class
        elif isinstance(node, ast.Import):
            for alias in node.names:
                # `import a.b` binds a; `import a.b as c` binds c to a.b.
                first = alias.name.partition(".")[0]
                names[alias.asname or first] = alias.name if alias.asname else first
        elif isinstance(node, ast.ImportFrom):
            origin = _origin(node, module, path)
            for alias in node.names:
                if alias.name == "*":
                    stars.append(origin)
                    constructs.append(("import *", node.lineno))
                else:
                    names[alias.asname or alias.name] = f"{origin}.{alias.name}"
        elif isinstance(node, ast.Global):
            constructs.append(("global", node.lineno))
        elif isinstance(node, ast.Assign):
            dotted = _dotted(node.value)
            if dotted and not scope.prefix:
                targets = (item.id for item in node.targets if isinstance(item, ast.Name))
                names.update(dict.fromkeys(targets, dotted))
        elif isinstance(node, ast.Call):
            to_file.update([] if _is_to_console(node) else [node.func])
            calls.append(_call(node))
        elif isinstance(node, ast.Attribute):
            if isinstance(node.ctx, ast.Load):
                uses.add(node.attr[:_LONGEST_NAME])
            elif dotted := _dotted(node):
                sets.append((dotted, node.lineno))
                if dotted == f"self.{node.attr}" and scope.owner:
                    fields.setdefault(scope.owner, {}).setdefault(node.attr, node.lineno)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            # As getattr() takes it.
            is_name = node.value.isidentifier() and len(node.value) <= _LONGEST_NAME
            uses.update([node.value] if is_name else [])
        elif isinstance(node, ast.Name):
            if scope.in_class and isinstance(node.ctx, ast.Store):
                fields.setdefault(scope.owner, {}).setdefault(node.id, node.lineno)
            if node.id == "print":
                prints[node] = node.lineno
                redefined |= isinstance(node.ctx, ast.Store)
    lines = {line for node, line in prints.items() if node not in to_file}
    return SourceFile(
        path=path,
        module=module,
        documented=bool(ast.get_docstring(tree)),
        classes=tuple(
            replace(one, fields=tuple(fields.get(one.name, {}).items())[:_MOST])
            for one in sorted(classes, key=lambda item: item.line)[:_MOST]
        ),
        functions=tuple(sorted(functions, key=lambda item: item.line)[:_MOST]),
        names=tuple(sorted(names.items())[:_MOST]),
        stars=tuple(dict.fromkeys(stars)),
        prints=() if redefined else tuple(sorted(lines)[:_MOST]),
        uses=tuple(sorted(uses)[:_MOST]),
        sets=tuple(sorted(sets, key=lambda item: item[1])[:_MOST]),
        calls=tuple(sorted(calls, key=lambda item: item.line)[:_MOST]),
        constructs=tuple(sorted(constructs, key=lambda item: item[1])[:_MOST]),
    )


def _walk(tree: ast.Module) -> Iterator[tuple[ast.AST, _Scope]]:
    # A stack instead of recursion: how deep the tree is, is up to the student.
    pending: list[tuple[ast.AST, _Scope]] = [(tree, _Scope())]
    while pending:
        node, scope = pending.pop()
        yield node, scope
        if isinstance(node, ast.ClassDef):
            name = scope.prefix + node.name
            scope = _Scope(f"{name}."[-_LONGEST_NAME:], in_class=True, owner=name)
        elif isinstance(node, _Function):
            inside = f"{scope.prefix}{node.name}.<locals>."[-_LONGEST_NAME:]
            scope = _Scope(inside, owner=scope.owner)
        # Reversed, so that the stack gives them in the order of the file.
        pending += [(child, scope) for child in reversed(list(ast.iter_child_nodes(node)))]


def _class(node: ast.ClassDef, scope: _Scope) -> SourceClass:
    bases = tuple(dict.fromkeys(name for base in node.bases for name in _base_names(base)))
    given = (one.value for one in node.keywords if one.arg == "metaclass")
    return SourceClass(
        name=scope.prefix + node.name,
        line=node.lineno,
        bases=bases[:_MOST],
        documented=bool(ast.get_docstring(node)),
        end=node.end_lineno or 0,
        metaclass=next(map(_dotted, given), ""),
    )


def _call(node: ast.Call) -> SourceCall:
    last = node.func.attr[:_LONGEST_NAME] if isinstance(node.func, ast.Attribute) else ""
    texts = (one.value for one in node.args if isinstance(one, ast.Constant))
    names = (text for text in texts if isinstance(text, str) and _LITERAL.fullmatch(text))
    return SourceCall(_dotted(node.func) or last, node.lineno, next(names, ""))


def _base_names(base: ast.expr) -> list[str]:
    """The dotted name of a base class, or the names in an expression that makes one."""
    if isinstance(base, ast.Subscript):
        base = base.value
    dotted = _dotted(base)
    if dotted:
        return [dotted]
    found = (_dotted(node) for node in ast.walk(base) if isinstance(node, ast.Name | ast.Attribute))
    return [name for name in found if name][:_MOST]


def _function(node: _Function, scope: _Scope) -> SourceFunction:
    decorators = [
        _dotted(item.func if isinstance(item, ast.Call) else item) for item in node.decorator_list
    ]
    arguments = node.args
    positional = [*arguments.posonlyargs, *arguments.args]
    if scope.in_class and "staticmethod" not in decorators:
        positional = positional[1:]
    others = [*arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    return SourceFunction(
        name=scope.prefix + node.name,
        line=node.lineno,
        documented=bool(ast.get_docstring(node)),
        decorators=tuple(name for name in decorators if name),
        unannotated=tuple(
            one.arg for one in (*positional, *others) if one is not None and one.annotation is None
        ),
        returns=node.returns is not None,
        pure=any(name.rpartition(".")[2] in _ABSTRACT for name in decorators),
    )


def _origin(node: ast.ImportFrom, module: str, path: str) -> str:
    """The absolute name of the module that is imported from."""
    if not node.level:
        return node.module or ""
    package = module.split(".")
    up = node.level - path.endswith("/__init__.py")
    package = package[: len(package) - up]
    return ".".join([*package, *([node.module] if node.module else [])])


def _is_to_console(call: ast.Call) -> bool:
    """Whether a call of ``print`` would write to the console, and not to a file."""
    files = [keyword.value for keyword in call.keywords if keyword.arg == "file"]
    return all(isinstance(file, ast.Constant) or _dotted(file) in _CONSOLE for file in files)


def _dotted(node: ast.expr) -> str:
    """The dotted name that an expression is, or nothing."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    if not isinstance(node, ast.Name):
        return ""
    name = ".".join(reversed([*parts, node.id]))
    return name if len(name) <= _LONGEST_NAME else ""
