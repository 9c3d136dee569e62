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
    facts = _Facts(path, module)
    for node, scope in _walk(tree):
        visit = getattr(facts, f"visit_{type(node).__name__}", None)
        if visit is not None:
            visit(node, scope)
    return facts.source_file(documented=bool(ast.get_docstring(tree)))


class _Facts:
    """The facts of one file, collected node by node; as ast.NodeVisitor, but without recursion."""

    def __init__(self, path: str, module: str) -> None:
        self._path, self._module = path, module
        self._classes: list[SourceClass] = []
        self._functions: list[SourceFunction] = []
        self._names: dict[str, str] = {}
        self._stars: list[str] = []
        self._uses: set[str] = set()
        self._sets: list[tuple[str, int]] = []
        self._calls: list[SourceCall] = []
        self._constructs: list[tuple[str, int]] = []
        self._fields: dict[str, dict[str, int]] = {}
        self._prints: dict[ast.expr, int] = {}
        self._calls_to_file: set[ast.expr] = set()
        self._redefines_print = False

    def visit_ClassDef(self, node: ast.ClassDef, scope: _Scope) -> None:
        self._classes.append(_class(node, scope))
        self._redefines_print |= node.name == "print"

    def visit_FunctionDef(self, node: _Function, scope: _Scope) -> None:
        self._functions.append(_function(node, scope))
        self._redefines_print |= node.name == "print" and not scope.in_class

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_Import(self, node: ast.Import, _: _Scope) -> None:
        for alias in node.names:
            # `import a.b` binds a; `import a.b as c` binds c to a.b.
            first = alias.name.partition(".")[0]
            self._names[alias.asname or first] = alias.name if alias.asname else first

    def visit_ImportFrom(self, node: ast.ImportFrom, _: _Scope) -> None:
        origin = _origin(node, self._module, self._path)
        for alias in node.names:
            if alias.name == "*":
                self._stars.append(origin)
                self._constructs.append(("import *", node.lineno))
            else:
                self._names[alias.asname or alias.name] = f"{origin}.{alias.name}"

    def visit_Global(self, node: ast.Global, _: _Scope) -> None:
        self._constructs.append(("global", node.lineno))

    def visit_Assign(self, node: ast.Assign, scope: _Scope) -> None:
        """An alias of what was imported: ``Node = rclpy.node.Node``."""
        dotted = _dotted(node.value)
        if dotted and not scope.prefix:
            targets = (item.id for item in node.targets if isinstance(item, ast.Name))
            self._names.update(dict.fromkeys(targets, dotted))

    def visit_Call(self, node: ast.Call, _: _Scope) -> None:
        if not _is_to_console(node):
            self._calls_to_file.add(node.func)
        self._calls.append(_call(node))

    def visit_Attribute(self, node: ast.Attribute, scope: _Scope) -> None:
        if isinstance(node.ctx, ast.Load):
            self._uses.add(node.attr[:_LONGEST_NAME])
            return
        dotted = _dotted(node)
        if dotted:
            self._sets.append((dotted, node.lineno))
        if dotted == f"self.{node.attr}" and scope.owner:
            self._add_field(scope.owner, node.attr, node.lineno)

    def visit_Constant(self, node: ast.Constant, _: _Scope) -> None:
        """A text may be a name for ``getattr()``."""
        text = node.value
        if isinstance(text, str) and text.isidentifier() and len(text) <= _LONGEST_NAME:
            self._uses.add(text)

    def visit_Name(self, node: ast.Name, scope: _Scope) -> None:
        is_set = isinstance(node.ctx, ast.Store)
        if scope.in_class and is_set:
            self._add_field(scope.owner, node.id, node.lineno)
        if node.id == "print":
            self._prints[node] = node.lineno
            self._redefines_print |= is_set

    def _add_field(self, owner: str, name: str, line: int) -> None:
        self._fields.setdefault(owner, {}).setdefault(name, line)

    def source_file(self, *, documented: bool) -> SourceFile:
        """All of them, in the order of the file."""
        prints = {line for node, line in self._prints.items() if node not in self._calls_to_file}
        return SourceFile(
            path=self._path,
            module=self._module,
            documented=documented,
            classes=tuple(
                replace(one, fields=tuple(self._fields.get(one.name, {}).items())[:_MOST])
                for one in sorted(self._classes, key=lambda item: item.line)[:_MOST]
            ),
            functions=tuple(sorted(self._functions, key=lambda item: item.line)[:_MOST]),
            names=tuple(sorted(self._names.items())[:_MOST]),
            stars=tuple(dict.fromkeys(self._stars)),
            prints=() if self._redefines_print else tuple(sorted(prints)[:_MOST]),
            uses=tuple(sorted(self._uses)[:_MOST]),
            sets=tuple(sorted(self._sets, key=lambda item: item[1])[:_MOST]),
            calls=tuple(sorted(self._calls, key=lambda item: item.line)[:_MOST]),
            constructs=tuple(sorted(self._constructs, key=lambda item: item[1])[:_MOST]),
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
