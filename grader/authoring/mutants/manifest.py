"""Mistakes in package.xml, setup.py and CMakeLists.txt, made in any package that is right.

Each function takes the files of a package and gives those that are different, None for one that is
gone; nothing where the package has no place for the mistake.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

Files = Mapping[str, str | None]
_CLIENT_LIBRARIES = ("rclpy", "rclcpp")


@dataclass(frozen=True)
class PackageFiles:
    """The text files of a right package, by their path in it."""

    name: str
    texts: Mapping[str, str]
    executables: tuple[str, ...] = ()


def misspelt(name: str) -> str:
    """A name without its last letter; the shortest ones get one more."""
    return name[:-1] if len(name.rpartition("/")[2]) > 2 else f"{name}s"


def invalid_email(package: PackageFiles) -> Files:
    """The maintainer's e-mail in package.xml is no address."""
    return _manifest(package, _without_address)


def missing_dependency(package: PackageFiles) -> Files:
    """package.xml does not name a package that the code uses."""
    return _manifest(package, _remove)


def misspelt_dependency(package: PackageFiles) -> Files:
    """package.xml names a package that the code uses without its last letter."""
    return _manifest(package, _misspell)


def dependency_inside_export(package: PackageFiles) -> Files:
    """package.xml names a package that the code uses inside <export>, where it does not count."""
    return _manifest(package, _export)


def misnamed_package(package: PackageFiles) -> Files:
    """The name of the package lacks its last letter."""
    other = misspelt(package.name)
    changed = dict(_manifest(package, lambda root: setattr(root.find("name"), "text", other)))
    if "CMakeLists.txt" in package.texts:
        project = re.compile(rf"(project\s*\(\s*){re.escape(package.name)}\b")
        changed |= _edited(package, "CMakeLists.txt", lambda text: project.sub(rf"\1{other}", text))
    elif "setup.py" in package.texts:
        changed |= _edited(package, "setup.py", lambda text: _renamed_setup(text, package.name))
        marker = f"resource/{package.name}"
        changed |= {f"resource/{other}": package.texts.get(marker, ""), **_deleted(package, marker)}
    return changed


def broken_syntax(package: PackageFiles) -> Files:
    """A source file ends in the middle of an expression."""
    sources = [path for path in package.texts if path.endswith((".py", ".cpp"))]
    inner = [path for path in sources if "/" in path and not path.startswith(("launch/", "test/"))]
    own = [path for path in inner if not path.endswith("__init__.py")]
    if "setup.py" in package.texts and len(package.executables) > 1:
        return {}  # Python installs it all the same, and the others run.
    return {path: f"{package.texts[path]}\n(\n" for path in own[:1]}


def broken_setup(package: PackageFiles) -> Files:
    """setup.py names a variable that does not exist."""
    return _edited(package, "setup.py", _with_unknown_name)


def no_marker(package: PackageFiles) -> Files:
    """The file of the package in resource/ is gone."""
    return _deleted(package, f"resource/{package.name}") if "setup.py" in package.texts else {}


def no_setup_cfg(package: PackageFiles) -> Files:
    """setup.cfg is gone, so that `ros2 run` does not find the executable."""
    return _deleted(package, "setup.cfg")


def no_entry_point(package: PackageFiles, executable: str) -> Files:
    """setup.py has no entry point for the executable."""
    return _entry_point(package, executable, lambda _: "*()")


def misnamed_entry_point(package: PackageFiles, executable: str) -> Files:
    """The executable lacks its last letter."""
    other = misspelt(executable)
    if "CMakeLists.txt" in package.texts:
        line = f"set_target_properties({executable} PROPERTIES OUTPUT_NAME {other})\n"
        end = re.compile(r"^ament_package\s*\(", re.MULTILINE)
        return _edited(package, "CMakeLists.txt", lambda text: end.sub(rf"{line}\g<0>", text))
    return _entry_point(package, executable, lambda text: repr(text.replace(executable, other, 1)))


def entry_point_to_nothing(package: PackageFiles, executable: str) -> Files:
    """The entry point names a function that does not exist."""
    return _entry_point(package, executable, lambda text: repr(f"{text.rstrip()}_"))


def not_installed(package: PackageFiles, executable: str) -> Files:
    """CMakeLists.txt does not install the executable."""
    rule = re.compile(r"install\s*\(\s*TARGETS\b([^)]*?)(\b[A-Z]+\b[^)]*)\)")

    def without(found: re.Match[str]) -> str:
        targets = found[1].split()
        if executable not in targets:
            return found[0]
        others = " ".join(name for name in targets if name != executable)
        return f"install(TARGETS {others} {found[2]})" if others else ""

    return _edited(package, "CMakeLists.txt", lambda text: rule.sub(without, text))


def _edited(package: PackageFiles, path: str, edit: Callable[[str], str]) -> Files:
    """A file that is different after an edit."""
    text = package.texts.get(path)
    changed = edit(text) if text is not None else text
    return {} if changed == text else {path: changed}


def _deleted(package: PackageFiles, path: str) -> Files:
    return {path: None} if path in package.texts else {}


def _manifest(package: PackageFiles, edit: Callable[[ElementTree.Element], object]) -> Files:
    text = package.texts["package.xml"]
    root = ElementTree.fromstring(text)
    before = ElementTree.tostring(root)
    edit(root)
    after = ElementTree.tostring(root)
    return {} if after == before else {"package.xml": after.decode()}


def _without_address(root: ElementTree.Element) -> None:
    for one in root.iter("maintainer"):
        one.set("email", "student@laptop")


def _used(root: ElementTree.Element) -> list[ElementTree.Element]:
    """The elements of the first dependency, of a client library where there is no other."""
    depends = [one for one in root if one.tag in ("depend", "exec_depend", "build_depend")]
    names = [(one.text or "").strip() for one in depends]
    others = [name for name in names if name not in _CLIENT_LIBRARIES]
    firsts = (others or names)[:1]
    return [one for one, name in zip(depends, names, strict=True) if name in firsts]


def _remove(root: ElementTree.Element) -> None:
    for one in _used(root):
        root.remove(one)


def _misspell(root: ElementTree.Element) -> None:
    for one in _used(root):
        one.text = misspelt((one.text or "").strip())


def _export(root: ElementTree.Element) -> None:
    for one in _used(root):
        root.remove(one)
        for export in root.iter("export"):
            ElementTree.SubElement(export, one.tag).text = one.text


def _replaced(text: str, node: ast.expr, by: str) -> str:
    """A text of Python with something else for one expression."""
    lines = text.encode().splitlines(keepends=True)
    begin = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    assert node.end_lineno is not None and node.end_col_offset is not None
    end = sum(map(len, lines[: node.end_lineno - 1])) + node.end_col_offset
    data = text.encode()
    return (data[:begin] + by.encode() + data[end:]).decode()


def _texts(tree: ast.AST) -> Iterator[tuple[ast.Constant, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node, node.value


def _entry_point(package: PackageFiles, executable: str, change: Callable[[str], str]) -> Files:
    def edit(text: str) -> str:
        for node, value in _texts(ast.parse(text)):
            if re.match(rf"\s*{re.escape(executable)}\s*=", value):
                return _replaced(text, node, change(value))
        return text

    return _edited(package, "setup.py", edit)


def _setup_call(tree: ast.AST) -> ast.Call | None:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "setup":
            return node
    return None


def _with_unknown_name(text: str) -> str:
    call = _setup_call(ast.parse(text))
    if call is None:
        return text
    lines = text.splitlines(keepends=True)
    return "".join([*lines[: call.lineno - 1], "packagename\n", *lines[call.lineno - 1 :]])


def _renamed_setup(text: str, name: str) -> str:
    """setup.py with another name of the package; its modules keep theirs."""
    tree = ast.parse(text)
    call = _setup_call(tree)
    given = [one.value for one in call.keywords if one.arg == "packages"] if call else []
    modules = [*ast.walk(given[0])] if given else []
    for node in modules:
        if isinstance(node, ast.Name) and not isinstance(given[0], ast.Call):
            return _renamed_setup(_replaced(text, node, repr(name)), name)
    for node, value in _texts(tree):
        begin = value.removesuffix(name)
        if node not in modules and value != begin and begin in ("", "resource/", "share/"):
            return _renamed_setup(_replaced(text, node, repr(begin + misspelt(name))), name)
    return text
