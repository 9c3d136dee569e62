"""A solution as a student would copy it: other names, another order, another layout."""

from __future__ import annotations

import ast


def renamed(text: str) -> str:
    """Rename what the program itself names, turn its methods round, drop its comments."""
    tree = ast.parse(text)
    own = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("__"):
            own.add(node.name)
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            own.add(node.id if isinstance(node, ast.Name) else node.attr)
        elif isinstance(node, ast.arg):
            own.add(node.arg)
    new = {name: f"my_{number}" for number, name in enumerate(sorted(own - {"self", "main"}))}
    for node in ast.walk(tree):
        for field in ("name", "id", "attr", "arg"):
            name = getattr(node, field, None)
            if isinstance(name, str):
                setattr(node, field, new.get(name, name))
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node):
            node.body = node.body[1:] or [ast.Pass()]
        if isinstance(node, ast.ClassDef):
            node.body.reverse()
    return ast.unparse(tree)
