"""Print what files of C++ say, as JSON; runs in the sandbox, where rosgrade's own code is not.

The parser is tree-sitter's: it reads files that do not compile, and marks what it cannot read.
Nothing is preprocessed, so macros stand for nothing, and of ``#if`` every branch is read but
``#if 0``.
"""

from __future__ import annotations

import json
import os
import re
import resource
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from tree_sitter import Node, Parser, Query

_MEMORY_BYTES = 2 * 2**30
# No person writes more; what a program writes must not make the record of a submission large.
_MOST = 2000
_LONGEST_NAME = 200
_UNREADABLE = "C++ cannot be read from here on"
_TOO_MUCH = "this C++ takes too long to read, is nested too deeply or holds too much"
# Where a macro stands, there is no C++ before it is replaced: in `class ROBOT_PUBLIC Rover`, in
# `ROBOT_EXPORT void drive();`, and alone on a line, as `RCLCPP_SMART_PTR_DEFINITIONS(Rover)`.
_MACROS = re.compile(
    rb"""
    ((?<=class[ ])|(?<=struct[ ])) [A-Z][A-Z0-9_]+ (?=\s+(?!final\b)[A-Za-z_])
    | \b[A-Z][A-Z0-9_]*_(PUBLIC|LOCAL|EXPORT|API)\b
    | ^[ \t]*[A-Z][A-Z0-9_]+\([^()\n]*\)[ \t]*\r?$
    """,
    re.MULTILINE | re.VERBOSE,
)
_LITERAL = re.compile(r"[\w/~{}.-]{1,200}")
_DOXYGEN = re.compile(r"/\*[*!][^/<]|//[/!](?![/<])")
_STREAMS = ("std::cout", "std::cerr", "std::clog", "cout", "cerr", "clog")
_PRINTING = ("printf", "puts", "putchar", "vprintf", "perror", "print", "println")
_TO_FILE = ("fprintf", "fputs", "print", "println")
_CONSOLE = ("stdout", "stderr")
_CLASSES = ("class_specifier", "struct_specifier")
_CONDITIONS = ("preproc_if", "preproc_ifdef")
_BRANCHES = ("preproc_else", "preproc_elif", "preproc_elifdef")
_TEMPLATES = ("template_type", "template_function", "template_method")
# What may stand between a comment and the declaration that it is about.
_AROUND = (
    "template_declaration",
    "field_declaration",
    "declaration",
    "type_definition",
    *_CONDITIONS,
)
_LISTS = "classes functions names stars prints uses sets calls constructs includes"


class Scope(NamedTuple):
    """What is open at a place of a file, and where it ends.

    Attributes:
        prefix: Of the names in it, such as ``robots::Rover::``.
        kind: ``namespace``, ``class`` or ``function``.
        public: Whether what stands here can be used from elsewhere.
        optional: Whether a condition may leave it out.
        dead: Whether ``#if 0`` leaves it out.
        dead_around: Whether what is around the condition is dead, so that every branch of it is.
    """

    end: int
    prefix: str = ""
    kind: str = "namespace"
    public: bool = True
    optional: bool = False
    dead: bool = False
    dead_around: bool = False


class Outline:
    """The facts of one file, collected node by node in the order of the file."""

    def __init__(self, data: bytes) -> None:
        self.facts: dict[str, list[Any]] = {name: [] for name in _LISTS.split()}
        self.unread_from: int | None = None
        self._scopes = [Scope(len(data) + 1)]

    def take(self, node: Node) -> None:
        """Take the facts of a node."""
        while len(self._scopes) > 1 and self._scopes[-1].end <= node.start_byte:
            self._scopes.pop()
        if not self._scope.dead or node.type in _CONDITIONS or node.type in _BRANCHES:
            _TAKERS[node.type](self, node)

    @property
    def _scope(self) -> Scope:
        return self._scopes[-1]

    def _open(self, node: Node, **changed: Any) -> None:
        self._scopes.append(self._scope._replace(end=node.end_byte, **changed))

    def _add(self, what: str, fact: object) -> None:
        if len(self.facts[what]) < _MOST:
            self.facts[what].append(fact)

    def _condition(self, node: Node) -> None:
        is_guard = node.children[0].type == "#ifndef"
        self._open(
            node,
            dead=self._scope.dead or _text(node.child_by_field_name("condition")) == "0",
            dead_around=self._scope.dead,
            optional=self._scope.optional or not is_guard,
        )

    def _branch(self, node: Node) -> None:
        self._open(node, dead=self._scope.dead_around, optional=True)

    def _error(self, node: Node) -> None:
        if self.unread_from is None:
            self.unread_from = _line(node)
        self._open(node, optional=True)

    def _namespace(self, node: Node) -> None:
        is_inline = any(child.type == "inline" for child in node.children)
        name = "" if is_inline else _name(node.child_by_field_name("name")).replace(" ", "")
        prefix = f"{self._scope.prefix}{name}::" if name else self._scope.prefix
        # Nothing outside of the file can name what is in a namespace without a name.
        self._open(node, prefix=prefix, public=self._scope.public and bool(name or is_inline))

    def _class(self, node: Node) -> None:
        name, body = node.child_by_field_name("name"), node.child_by_field_name("body")
        if body is None:
            return
        full_name = f"{self._scope.prefix}{_name(name)}" if name else ""
        if name:
            fact = {
                "name": full_name[-_LONGEST_NAME:],
                "line": _line(node),
                "end": node.end_point[0] + 1,
                "bases": _bases(node),
                "documented": _is_documented(node),
            }
            self._add("classes", fact)
        # What is in a struct without a name is no field of the class around it.
        self._open(
            body,
            prefix=f"{full_name}::",
            kind="class" if name else "function",
            public=node.type == "struct_specifier",
        )

    def _access(self, node: Node) -> None:
        """From ``public:`` on, what stands in the class is public."""
        is_of_base = node.parent is None or node.parent.type == "base_class_clause"
        if self._scope.kind == "class" and not is_of_base:
            self._scopes[-1] = self._scope._replace(public=_text(node) == "public")

    def _declaration(self, node: Node) -> None:
        """A function, or the fields of a class."""
        scope = self._scope
        is_friend = node.parent is not None and node.parent.type == "friend_declaration"
        for written in node.children_by_field_name("declarator"):
            declarator = _unwrapped(written)
            if declarator.type in ("function_declarator", "operator_cast"):
                inner = declarator.child_by_field_name("declarator")
                if inner is not None and inner.type == "parenthesized_declarator":
                    # A pointer to a function: `void (*callback)(int);`.
                    self._field(scope, _text(inner).strip("(*) "), node)
                elif not is_friend and scope.kind != "function":
                    self._function(node, declarator)
            elif declarator.type == "field_identifier":
                self._field(scope, _text(declarator), declarator)
        if node.type == "function_definition":
            self._open(node, kind="function", prefix=f"{scope.prefix}<locals>::")

    def _field(self, scope: Scope, name: str, node: Node) -> None:
        if scope.kind != "class":
            return
        owner = scope.prefix.removesuffix("::")[-_LONGEST_NAME:]
        for fact in reversed(self.facts["classes"]):
            if fact["name"] == owner:
                fields = fact.setdefault("fields", [])
                if len(fields) < _MOST:
                    fields.append([name, _line(node)])
                return

    def _function(self, node: Node, declarator: Node) -> None:
        documented = _is_documented(node)
        kinds = {child.type for child in node.children}
        # Another file that only declares a function says nothing of it, but for its documentation.
        says_something = (
            self._scope.kind == "class" or node.type == "function_definition" or documented
        )
        if "delete_method_clause" in kinds or not says_something:
            return
        marks = {_text(one) for one in declarator.children if one.type == "virtual_specifier"}
        is_zero = _text(node.child_by_field_name("default_value")) == "0"
        if declarator.type == "function_declarator":
            name = _name(declarator.child_by_field_name("declarator"))
        else:
            name = _text(declarator)
        fact = {
            "name": f"{self._scope.prefix}{name}"[-_LONGEST_NAME:],
            "line": _line(node),
            "documented": documented,
            "returns": True,
            "virtual": "virtual" in kinds or bool(marks) or is_zero,
            "pure": is_zero or "pure_virtual_clause" in kinds,
            "overriding": bool(marks & {"override", "final"}),
            "parameters": _number_of_parameters(declarator),
            "public": self._scope.public,
        }
        self._add("functions", fact)

    def _call(self, node: Node) -> None:
        function = node.child_by_field_name("function")
        arguments = node.child_by_field_name("arguments")
        if function is None or arguments is None:
            return
        name = _dotted(function)
        first_arguments = arguments.named_children[:8]
        literals = (
            _text(one).strip('"') for one in first_arguments if one.type == "string_literal"
        )
        literal = next((text for text in literals if _LITERAL.fullmatch(text)), "")
        self._add("calls", {"name": name, "line": _line(node), "literal": literal})
        self._add("uses", re.split(r"\.|::", name)[-1])
        if _is_printing(name, first_arguments):
            self._add("prints", _line(node))

    def _operator(self, node: Node) -> None:
        """``std::cout << x`` prints."""
        if _text(node.child_by_field_name("left")) in _STREAMS:
            self._add("prints", _line(node))

    def _assignment(self, node: Node) -> None:
        left = node.child_by_field_name("left")
        if left is not None and left.type == "field_expression":
            dotted = _dotted(left)
            if "." in dotted:
                self._add("sets", [dotted, _line(node)])

    def _include(self, node: Node) -> None:
        header = _text(node.child_by_field_name("path")).strip('<>"')
        self._add("includes", [header, _line(node), self._scope.optional])

    def _define(self, node: Node) -> None:
        if node.child_by_field_name("value"):
            self._add("constructs", ["#define", _line(node)])

    def _statement(self, node: Node) -> None:
        """``goto``, ``new`` or ``delete``."""
        self._add("constructs", [node.type.partition("_")[0], _line(node)])

    def _using(self, node: Node) -> None:
        used = _name(node.named_children[-1]) if node.named_children else ""
        if any(child.type == "namespace" for child in node.children):
            self._add("stars", used)
            self._add("constructs", [f"using namespace {used}", _line(node)])
        elif self._scope.kind != "class":
            self._add("names", [used.rpartition("::")[2], used])

    def _alias(self, node: Node) -> None:
        """``using Pose = geometry_msgs::msg::Pose;``, or the same as a ``typedef``."""
        alias = node.child_by_field_name("name") or node.child_by_field_name("declarator")
        target = node.child_by_field_name("type")
        if target is not None:
            target = target.child_by_field_name("type") or target
        if alias is not None and target is not None and target.type not in _CLASSES:
            self._add("names", [_name(alias), _name(target)])

    def _namespace_alias(self, node: Node) -> None:
        """``namespace chrono = std::chrono;``."""
        alias = node.child_by_field_name("name")
        if alias is not None:
            self._add("names", [_name(alias), _name(node.named_children[-1])])


_TAKERS: dict[str, Callable[[Outline, Node], None]] = {
    **dict.fromkeys(_CONDITIONS, Outline._condition),
    **dict.fromkeys(_BRANCHES, Outline._branch),
    "ERROR": Outline._error,
    "namespace_definition": Outline._namespace,
    **dict.fromkeys(_CLASSES, Outline._class),
    "access_specifier": Outline._access,
    "function_definition": Outline._declaration,
    "field_declaration": Outline._declaration,
    "declaration": Outline._declaration,
    "call_expression": Outline._call,
    "binary_expression": Outline._operator,
    "assignment_expression": Outline._assignment,
    "preproc_include": Outline._include,
    "preproc_def": Outline._define,
    "preproc_function_def": Outline._define,
    "goto_statement": Outline._statement,
    "new_expression": Outline._statement,
    "delete_expression": Outline._statement,
    "using_declaration": Outline._using,
    "alias_declaration": Outline._alias,
    "type_definition": Outline._alias,
    "namespace_alias_definition": Outline._namespace_alias,
}
"""Kind of a node, as tree-sitter calls it -> what takes its facts."""


def outline(data: bytes) -> dict[str, Any]:
    """What a file of C++ says: the fields of a SourceFile, and the line from which it is unread."""
    from tree_sitter import QueryCursor

    parser, query = _tools()
    # As long as before, so that every line stays where it is.
    cleaned = _MACROS.sub(lambda macro: b" " * len(macro[0]), data)
    collected = Outline(data)
    captured = QueryCursor(query).captures(parser.parse(cleaned).root_node)
    for node in sorted(captured.get("node", []), key=lambda one: (one.start_byte, -one.end_byte)):
        collected.take(node)
    unread_lines = [_line(node) for node in captured.get("lost", [])]
    if collected.unread_from is not None:
        unread_lines.append(collected.unread_from)
    facts: dict[str, Any] = dict(collected.facts)
    for name in ("stars", "uses", "prints"):
        facts[name] = sorted(set(facts[name]))
    facts["unread"] = [min(unread_lines), _UNREADABLE] if unread_lines else None
    return facts


@cache
def _tools() -> tuple[Parser, Query]:
    """The parser, and the query for every node that says something."""
    import tree_sitter_cpp
    from tree_sitter import Language, Parser, Query

    language = Language(tree_sitter_cpp.language())
    kinds = " ".join(f"({kind})" for kind in _TAKERS)
    return Parser(language), Query(language, f'[{kinds}] @node (MISSING "}}") @lost')


def _text(node: Node | None) -> str:
    text = node.text if node else None
    return text.decode("utf-8", "replace") if text else ""


def _line(node: Node) -> int:
    return int(node.start_point[0]) + 1


def _name(node: Node | None) -> str:
    """The name that a node is, without the arguments of templates."""
    parts = []
    while node is not None and node.type == "qualified_identifier":
        parts.append(_last_name(node.child_by_field_name("scope")))
        node = node.child_by_field_name("name")
    parts.append(_last_name(node))
    return "::".join(part for part in parts if part)[:_LONGEST_NAME]


def _last_name(node: Node | None) -> str:
    if node is not None and node.type in _TEMPLATES:
        node = node.child_by_field_name("name")
    return re.sub(r"\s+", " ", _text(node)[:_LONGEST_NAME])


def _dotted(node: Node) -> str:
    """What is called or assigned to, such as ``node.create_client`` of ``node->create_client<T>``.

    Of what is no chain of names, the last name only.
    """
    parts: list[str] = []
    while node.type == "field_expression":
        field, argument = node.child_by_field_name("field"), node.child_by_field_name("argument")
        parts.append(_last_name(field))
        if argument is None or len(parts) > _LONGEST_NAME:
            break
        node = argument
    if node.type in ("identifier", "this", "qualified_identifier", "template_function"):
        parts.append(_name(node))
    return ".".join(reversed(parts))[-_LONGEST_NAME:]


def _unwrapped(declarator: Node) -> Node:
    """The declarator of a function or a name, without pointers, references, arrays, values."""
    while declarator.type.endswith("_declarator") and declarator.type not in (
        "function_declarator",
        "parenthesized_declarator",
    ):
        inner = declarator.child_by_field_name("declarator")
        named = declarator.named_children
        if inner is None and not named:
            break
        declarator = inner or named[-1]
    return declarator


def _number_of_parameters(declarator: Node) -> int:
    parameters = declarator.child_by_field_name("parameters")
    if parameters is None:
        return 0
    written = [_text(one) for one in parameters.named_children if one.type != "comment"]
    return 0 if written == ["void"] else len(written)


def _bases(node: Node) -> list[str]:
    """The names of the classes that a class is derived from."""
    for clause in node.named_children:
        if clause.type == "base_class_clause":
            return [
                _name(base)
                for base in clause.named_children
                if base.type not in ("access_specifier", "virtual", "comment", "attribute")
            ][:_MOST]
    return []


def _is_printing(name: str, arguments: Sequence[Node]) -> bool:
    """Whether a call writes to the console, and not to a file as ``fprintf(file, ...)`` does."""
    function = name.removeprefix("std::")
    if "." in name or function not in (*_PRINTING, *_TO_FILE):
        return False
    if function not in _TO_FILE:
        return True
    file = ""
    if arguments:
        file = _text(arguments[-1 if function == "fputs" else 0]).removeprefix("std::")
    # `std::print` takes a file only if it likes: what else is first there is printed.
    return file in _CONSOLE or not (function.startswith("f") or "stream" in file)


def _is_documented(node: Node) -> bool:
    """Whether a comment for Doxygen stands before a declaration, or before what is around it."""
    while True:
        is_first = node.prev_sibling is None or node.prev_named_sibling is None
        if not is_first and any(_DOXYGEN.match(_text(one)) for one in _comments_before(node)):
            return True
        parent = node.parent
        if parent is None or parent.type not in _AROUND:
            return False
        if parent.type in _CONDITIONS and not is_first:
            # A comment before `#if` is about the first declaration in it.
            return False
        node = parent


def _comments_before(node: Node) -> Iterator[Node]:
    """The comments right before a node, the nearest first."""
    before = node.prev_sibling
    while before is not None and before.type == "comment":
        yield before
        before = before.prev_sibling


def main(list_file: str, file_s: str, total_s: str) -> None:
    """Read the listed files, and print a line of JSON for each.

    Each in a process of its own, which may fail: a file can be made so that any parser does.

    Args:
        list_file: JSON with their paths.
        file_s: CPU time that each may take.
        total_s: CPU time after which no other is begun.
    """
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    paths = json.loads(Path(list_file).read_text(encoding="ascii"))
    _tools()
    for path in paths:
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            _print_outline(path, int(file_s))
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if status:
            print(json.dumps({"unread": [None, _TOO_MUCH]}))
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        if used.ru_utime + used.ru_stime > int(total_s):
            break


def _print_outline(path: str, cpu_s: int) -> NoReturn:
    status = 1
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
        print(json.dumps(outline(Path(path).read_bytes())), flush=True)
        status = 0
    finally:
        os._exit(status)


if __name__ == "__main__":
    main(*sys.argv[1:])
