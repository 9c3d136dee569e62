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
    from collections.abc import Iterator

    from tree_sitter import Node, Parser, Query

_MEMORY_BYTES = 2 * 2**30
_MOST = 2000
_LONGEST_NAME = 200
_UNREADABLE = "C++ cannot be read from here on"
_TOO_MUCH = "this C++ takes too long to read, is nested too deeply or holds too much"
# A macro in front of a name, or alone on a line, is no C++ before it is replaced.
_MACROS = re.compile(
    rb"(?<=class )[A-Z][A-Z0-9_]+(?=\s+(?!final\b)[A-Za-z_])|(?<=struct )[A-Z][A-Z0-9_]+"
    rb"(?=\s+(?!final\b)[A-Za-z_])|\b[A-Z][A-Z0-9_]*_(?:PUBLIC|LOCAL|EXPORT|API)\b"
    rb"|^[ \t]*[A-Z][A-Z0-9_]+\([^()\n]*\)[ \t]*\r?$",
    re.MULTILINE,
)
_LITERAL = re.compile(r"[\w/~{}.-]{1,200}")
_DOXYGEN = re.compile(r"/\*[*!][^/<]|//[/!](?![/<])")
_PRINTS = ("std::cout", "std::cerr", "std::clog", "cout", "cerr", "clog")
_PRINTING = ("printf", "puts", "putchar", "vprintf", "perror", "print", "println")
_TO_FILE = ("fprintf", "fputs", "print", "println")
_CONSOLE = ("stdout", "stderr")
_WORDS = {"goto_statement": "goto", "new_expression": "new", "delete_expression": "delete"}
_CLASSES = ("class_specifier", "struct_specifier")
_FUNCTIONS = ("function_definition", "field_declaration", "declaration")
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
_OTHERS = (
    "namespace_definition",
    "namespace_alias_definition",
    "alias_declaration",
    "type_definition",
    "using_declaration",
    "access_specifier",
    "call_expression",
    "assignment_expression",
    "binary_expression",
    "preproc_include",
    "preproc_def",
    "preproc_function_def",
    "ERROR",
)


class Scope(NamedTuple):
    """What is open at a place of a file, and where it ends.

    Attributes:
        prefix: Of the names in it, such as ``robots::Rover::``.
        kind: ``namespace``, ``class`` or ``function``.
        public: Whether what stands here can be used from elsewhere.
        optional: Whether a condition may leave it out.
        dead: Whether ``#if 0`` leaves it out.
        around: Whether what is around the condition is dead.
    """

    end: int
    prefix: str = ""
    kind: str = "namespace"
    public: bool = True
    optional: bool = False
    dead: bool = False
    around: bool = False


class Outline:
    """The facts of one file, collected node by node in the order of the file."""

    def __init__(self, data: bytes) -> None:
        self.facts: dict[str, list[Any]] = {
            name: []
            for name in (
                *("classes", "functions", "names", "stars", "prints", "uses", "sets", "calls"),
                *("constructs", "includes"),
            )
        }
        self.unread: int | None = None
        self._scopes = [Scope(len(data) + 1)]

    def take(self, node: Node) -> None:
        """Take the facts of a node."""
        while len(self._scopes) > 1 and self._scopes[-1].end <= node.start_byte:
            self._scopes.pop()
        scope, kind = self._scopes[-1], node.type
        if kind in _CONDITIONS or kind in _BRANCHES:
            self._condition(node, scope)
        elif scope.dead:
            return
        elif kind == "ERROR":
            self.unread = _line(node) if self.unread is None else self.unread
            self._open(node, optional=True)
        elif kind == "namespace_definition":
            is_inline = any(child.type == "inline" for child in node.children)
            name = "" if is_inline else _name(node.child_by_field_name("name")).replace(" ", "")
            inside = f"{scope.prefix}{name}::" if name else scope.prefix
            self._open(node, prefix=inside, public=scope.public and bool(name or is_inline))
        elif kind in _CLASSES:
            self._class(node, scope)
        elif kind in _FUNCTIONS:
            self._declared(node, scope)
        elif kind == "access_specifier":
            if scope.kind == "class" and node.parent and node.parent.type != "base_class_clause":
                self._scopes[-1] = scope._replace(public=_text(node) == "public")
        elif kind == "call_expression":
            self._call(node)
        elif kind in _WORDS:
            self._add("constructs", [_WORDS[kind], _line(node)])
        else:
            self._other(node)

    def _other(self, node: Node) -> None:
        kind, left = node.type, node.child_by_field_name("left")
        if kind == "assignment_expression" and left and left.type == "field_expression":
            dotted = _dotted(left)
            if "." in dotted:
                self._add("sets", [dotted, _line(node)])
        elif kind == "binary_expression" and left and _text(left) in _PRINTS:
            self._add("prints", _line(node))
        elif kind == "preproc_include":
            header = _text(node.child_by_field_name("path")).strip('<>"')
            self._add("includes", [header, _line(node), self._scopes[-1].optional])
        elif kind in ("preproc_def", "preproc_function_def") and node.child_by_field_name("value"):
            self._add("constructs", ["#define", _line(node)])
        else:
            self._name_of_another(node)

    def _name_of_another(self, node: Node) -> None:
        """What ``using``, ``typedef`` and aliases of namespaces name."""
        if node.type == "using_declaration":
            named = _name(node.named_children[-1]) if node.named_children else ""
            if any(child.type == "namespace" for child in node.children):
                self._add("stars", named)
                self._add("constructs", [f"using namespace {named}", _line(node)])
            elif self._scopes[-1].kind != "class":
                self._add("names", [named.rpartition("::")[2], named])
        elif node.type in ("alias_declaration", "type_definition", "namespace_alias_definition"):
            target = node.child_by_field_name("type")
            target = (target and target.child_by_field_name("type")) or target
            own = node.child_by_field_name("name") or node.child_by_field_name("declarator")
            if node.type.startswith("namespace"):
                target = node.named_children[-1]
            if target and own and target.type not in _CLASSES:
                self._add("names", [_name(own), _name(target)])

    def _add(self, what: str, fact: object) -> None:
        if len(self.facts[what]) < _MOST:
            self.facts[what].append(fact)

    def _open(self, node: Node, **changed: Any) -> None:
        self._scopes.append(self._scopes[-1]._replace(end=node.end_byte, **changed))

    def _condition(self, node: Node, scope: Scope) -> None:
        if node.type in _CONDITIONS:
            dead = scope.dead or _text(node.child_by_field_name("condition")) == "0"
            is_guard = node.children[0].type == "#ifndef"
            optional = scope.optional or not is_guard
            self._open(node, dead=dead, around=scope.dead, optional=optional)
        else:
            self._open(node, dead=scope.around, optional=True)

    def _class(self, node: Node, scope: Scope) -> None:
        name, body = node.child_by_field_name("name"), node.child_by_field_name("body")
        if body is None:
            return
        full = f"{scope.prefix}{_name(name)}" if name else ""
        clause = next((one for one in node.named_children if one.type == "base_class_clause"), None)
        bases = (one for one in clause.named_children if clause) if clause else ()
        if name:
            self._add(
                "classes",
                {
                    "name": full[-_LONGEST_NAME:],
                    "line": _line(node),
                    "end": node.end_point[0] + 1,
                    "bases": [
                        _name(one)
                        for one in bases
                        if one.type not in ("access_specifier", "virtual", "comment", "attribute")
                    ][:_MOST],
                    "documented": _is_documented(node),
                },
            )
        # What is in a struct without a name is no field of the class around it.
        self._open(
            body,
            prefix=f"{full}::",
            kind="class" if name else "function",
            public=node.type == "struct_specifier",
        )

    def _declared(self, node: Node, scope: Scope) -> None:
        """A function or the fields that a declaration declares."""
        in_class = scope.kind == "class"
        is_friend = node.parent is not None and node.parent.type == "friend_declaration"
        for written in node.children_by_field_name("declarator"):
            declarator = _unwrapped(written)
            if declarator.type in ("function_declarator", "operator_cast"):
                inner = declarator.child_by_field_name("declarator")
                is_pointer = inner is not None and inner.type == "parenthesized_declarator"
                if not (is_friend or is_pointer or scope.kind == "function"):
                    self._function(node, declarator, in_class=in_class)
                elif is_pointer and in_class:
                    self._field(scope, _text(inner).strip("(*) "), node)
            elif in_class and declarator.type == "field_identifier":
                self._field(scope, _text(declarator), declarator)
        if node.type == "function_definition":
            self._open(node, kind="function", prefix=f"{scope.prefix}<locals>::")

    def _field(self, scope: Scope, name: str, node: Node) -> None:
        owner = scope.prefix.removesuffix("::")[-_LONGEST_NAME:]
        fields = next((o for o in reversed(self.facts["classes"]) if o["name"] == owner), None)
        if fields is not None and len(fields.setdefault("fields", [])) < _MOST:
            fields["fields"].append([name, _line(node)])

    def _function(self, node: Node, declarator: Node, *, in_class: bool) -> None:
        scope = self._scopes[-1]
        kinds = {child.type for child in node.children}
        documented = _is_documented(node)
        is_there = in_class or node.type == "function_definition" or documented
        if "delete_method_clause" in kinds or not is_there:
            return
        marks = {_text(one) for one in declarator.children if one.type == "virtual_specifier"}
        pure = _text(node.child_by_field_name("default_value")) == "0"
        own = declarator.child_by_field_name("declarator")
        name = _name(own) if declarator.type == "function_declarator" else _text(declarator)
        self._add(
            "functions",
            {
                "name": f"{scope.prefix}{name}"[-_LONGEST_NAME:],
                "line": _line(node),
                "documented": documented,
                "returns": True,
                "virtual": "virtual" in kinds or bool(marks) or pure,
                "pure": pure or "pure_virtual_clause" in kinds,
                "overriding": bool(marks & {"override", "final"}),
                "parameters": _number_of_parameters(declarator),
                "public": scope.public,
            },
        )

    def _call(self, node: Node) -> None:
        function = node.child_by_field_name("function")
        arguments = node.child_by_field_name("arguments")
        if function is None or arguments is None:
            return
        name = _dotted(function)
        last = re.split(r"\.|::", name)[-1]
        given = arguments.named_children[:8]
        texts = (_text(one).strip('"') for one in given if one.type == "string_literal")
        literal = next((text for text in texts if _LITERAL.fullmatch(text)), "")
        self._add("calls", {"name": name, "line": _line(node), "literal": literal})
        self._add("uses", last)
        plain = name.removeprefix("std::")
        file = _text(given[-1 if plain == "fputs" else 0]).removeprefix("std::") if given else ""
        to_file = plain in _TO_FILE and file not in _CONSOLE
        to_file = to_file and (plain.startswith("f") or "stream" in file)
        if plain in (*_PRINTING, *_TO_FILE) and "." not in name and not to_file:
            self._add("prints", _line(node))


def outline(data: bytes) -> dict[str, Any]:
    """What a file of C++ says: the fields of a SourceFile, and the line from which it is unread."""
    from tree_sitter import QueryCursor

    parser, query = _tools()
    # As long as before, so that every line stays where it is.
    cleaned = _MACROS.sub(lambda found: b" " * len(found[0]), data)
    found = Outline(data)
    captured = QueryCursor(query).captures(parser.parse(cleaned).root_node)
    for node in sorted(captured.get("node", []), key=lambda one: (one.start_byte, -one.end_byte)):
        found.take(node)
    lost = [_line(node) for node in captured.get("lost", [])]
    lines = [line for line in (found.unread, *lost) if line is not None]
    facts: dict[str, Any] = dict(found.facts)
    for name in ("stars", "uses", "prints"):
        facts[name] = sorted(set(facts[name]))
    facts["unread"] = [min(lines), _UNREADABLE] if lines else None
    return facts


@cache
def _tools() -> tuple[Parser, Query]:
    """The parser, and the query for every node that says something."""
    import tree_sitter_cpp
    from tree_sitter import Language, Parser, Query

    language = Language(tree_sitter_cpp.language())
    kinds = (*_CLASSES, *_FUNCTIONS, *_CONDITIONS, *_BRANCHES, *_WORDS, *_OTHERS)
    wanted = " ".join(f"({kind})" for kind in kinds)
    return Parser(language), Query(language, f'[{wanted}] @node (MISSING "}}") @lost')


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
    listed = declarator.child_by_field_name("parameters")
    given = [one for one in listed.named_children if one.type != "comment"] if listed else []
    return 0 if [_text(one) for one in given] == ["void"] else len(given)


def _is_documented(node: Node) -> bool:
    """Whether a comment for Doxygen stands before a declaration."""
    while (before := node.prev_sibling) is None or node.prev_named_sibling is None:
        parent = node.parent
        if parent is None or parent.type not in _AROUND:
            return False
        node = parent
    for comment in _before(before):
        if _DOXYGEN.match(_text(comment)):
            return True
    parent = node.parent
    is_inner = parent is not None and parent.type in _AROUND and parent.type not in _CONDITIONS
    return is_inner and parent is not None and _is_documented(parent)


def _before(node: Node | None) -> Iterator[Node]:
    """The comments up to a node, the nearest first."""
    while node is not None and node.type == "comment":
        yield node
        node = node.prev_sibling


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
