"""Mistakes in the files of a package, made in any package that is right.

Each function is called like the mutant that it makes, and its docstring is the mutant's title. It
gets the files of a package and returns only those that the mistake changes, by path: the new text,
or None for a file that is deleted. It returns an empty mapping where the mistake cannot be made.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from grader.diagnosis.not_generated import InterfaceName, used_packages
from grader.recording.submission import Definition
from grader.spec.source import Model, read_source
from grader.submission.read.cmake import read_commands

Files = Mapping[str, str | None]
CMAKE = "CMakeLists.txt"
_CLIENT_LIBRARIES = ("rclpy", "rclcpp")
_GENERATE = "rosidl_generate_interfaces"
_COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_INTERFACES = re.compile(r"\.(msg|srv|action)$")
_NOTHING = "(?!)"
"""A pattern that occurs nowhere."""
_HEADER = re.compile(r"(#include\s*[<\"]\w+/(?:msg|srv|action)/)(\w+)(?=\.hpp)")


@dataclass(frozen=True)
class PackageFiles:
    """The text files of a right reference, and what of them is meant.

    Attributes:
        name: Of the package.
        texts: By path in the reference.
        executables: All of the package that the assignment asks for.
        folder: Where the package is in the reference, with a slash at the end.
        about: The executable or the interface that a check asks for.
    """

    name: str
    texts: Mapping[str, str]
    executables: tuple[str, ...] = ()
    folder: str = ""
    about: str = ""

    def text(self, path: str) -> str:
        """A file of the package; nothing if it is not there. Comments in package.xml are none."""
        text = self.texts.get(f"{self.folder}{path}", "")
        return _COMMENT.sub("", text) if path == "package.xml" else text

    def edited(self, path: str, edit: Callable[[str], str]) -> Files:
        """A file of the package that is different after an edit."""
        text = self.text(path)
        changed = edit(text)
        return {} if changed == text else {f"{self.folder}{path}": changed}

    def deleted(self, path: str) -> Files:
        """A file of the package that is gone."""
        place = f"{self.folder}{path}"
        return {place: None} if place in self.texts else {}

    @property
    def definition(self) -> str:
        """The file of the interface in the package."""
        return InterfaceName.of(self.about).file

    @cached_property
    def used(self) -> tuple[str, ...]:
        """The packages that the definition uses; of another package, all that it depends on."""
        if "/" not in self.about:
            manifest = self.text("package.xml")
            names = re.findall(r"<(?:build_|exec_)?depend\b[^>]*>\s*([^\s<]+)", manifest)
            others = (name for name in names if name not in _CLIENT_LIBRARIES)
            return tuple(others) or tuple(names)
        text = self.text(self.definition)
        return used_packages(InterfaceName.of(self.about), Definition(self.definition, text))

    @cached_property
    def unused(self) -> list[str]:
        """The names in the definition that no other file has."""
        if "/" not in self.about:
            return []
        names = {path: {*re.findall(r"\w+", text)} for path, text in self.texts.items()}
        in_definition = names.pop(f"{self.folder}{self.definition}", set())
        return sorted(in_definition.difference(*names.values()))

    @property
    def sources(self) -> list[str]:
        """The source files of its programs and libraries, by path in the reference."""
        left_out = tuple(f"{self.folder}{name}/" for name in ("launch", "test"))
        return [
            path
            for path in self.texts
            if path.startswith(self.folder)
            and path.endswith((".py", ".cpp", ".hpp"))
            and "/" in path.removeprefix(self.folder)
            and not path.startswith(left_out)
            and not path.endswith("__init__.py")
        ]


class Edit(Model):
    """An entry of the table ``edits.yaml``; see there."""

    checks: tuple[str, ...]
    title: str
    file: str
    find: str = ""
    by: str = ""
    once: bool = False

    def made(self, package: PackageFiles) -> Files:
        """What is different by it."""
        file = self.file.replace("<package>", package.name)
        if "<definition>" in file:
            file = package.definition
        if not self.find:
            return package.deleted(file)
        find, by, used = self.find, self.by, package.used
        for word, names in (("<first>", used[:1]), ("<used>", used), ("<unused>", package.unused)):
            find = find.replace(word, "|".join(map(re.escape, names)) or _NOTHING)
        if used:
            by = by.replace("<misspelt>", misspelt(used[0]))
        pattern = re.compile(find, re.MULTILINE)
        count = 1 if self.once else 0
        return package.edited(file, lambda text: pattern.sub(by, text, count=count))


class Table(Model):
    """The whole of ``edits.yaml``: the id of a mutant -> its edit."""

    edits: dict[str, Edit]


Make = Callable[[PackageFiles], Files]


class Change(NamedTuple):
    """What makes a mutant, with its id and its title, and the checks that fail by it."""

    id: str
    title: str
    checks: tuple[str, ...]
    make: Make


EDITS = read_source(Path(__file__).with_name("edits.yaml")).read(Table).edits
CHANGES = [Change(name, edit.title, edit.checks, edit.made) for name, edit in EDITS.items()]
"""Those of the table, then those of the functions below."""


def breaks(check: str) -> Callable[[Make], Make]:
    """The function is a mutant's, by which a check of the catalogue fails."""

    def added(make: Make) -> Make:
        title = (make.__doc__ or "").removesuffix(".")
        CHANGES.append(Change(make.__name__, title, (check,), make))
        return make

    return added


def misspelt(name: str) -> str:
    """A name without its last letter; the shortest ones get one more."""
    return name[:-1] if len(name.rpartition("/")[2]) > 2 else f"{name}s"


@breaks("package.dependencies")
def dependency_inside_export(package: PackageFiles) -> Files:
    """package.xml names a package that the code uses inside <export>, where it does not count."""
    first = "".join(map(re.escape, package.used[:1]))
    tag = re.compile(rf"<((?:build_|exec_)?depend)\b[^>]*>\s*{first}\s*</\1>")

    def moved(text: str) -> str:
        inside = "".join(found[0] for found in tag.finditer(text))
        return tag.sub("", text).replace("<export>", f"<export>{inside}", 1)

    return package.edited("package.xml", moved)


@breaks("package.found")
def package_misnamed(package: PackageFiles) -> Files:
    """The name of the package lacks its last letter."""
    name, other = package.name, misspelt(package.name)
    if _GENERATE in package.text(CMAKE):
        # Whoever uses its interfaces does so by this name.
        word = re.compile(rf"\b{re.escape(name)}(?=\b|__)")
        renamed = {path: word.sub(other, text) for path, text in package.texts.items()}
        return {path: text for path, text in renamed.items() if text != package.texts[path]}
    tag = re.compile(rf"(<name>\s*){re.escape(name)}\b")
    changed = dict(package.edited("package.xml", lambda text: tag.sub(rf"\1{other}", text)))
    project = re.compile(rf"(project\s*\(\s*){re.escape(name)}\b")
    cmake = package.edited(CMAKE, lambda text: project.sub(rf"\1{other}", text))
    if cmake:
        return {**changed, **cmake}
    # A package of Python names itself in setup.py and by an empty file too.
    marker = f"resource/{name}"
    changed |= package.edited("setup.py", lambda text: _renamed_setup(text, name))
    changed[f"{package.folder}resource/{other}"] = package.text(marker)
    return {**changed, **package.deleted(marker)}


@breaks("package.builds")
def syntax_error(package: PackageFiles) -> Files:
    """A source file ends in the middle of an expression."""
    if package.text("setup.py") and len(package.executables) > 1:
        return {}  # Python installs it all the same, and the others run.
    return {path: f"{package.texts[path]}\n(\n" for path in package.sources[:1]}


@breaks("package.executable")
def entry_point_missing(package: PackageFiles) -> Files:
    """setup.py has no entry point for the executable."""
    return _entry_point(package, lambda _: "*()")


@breaks("package.executable")
def executable_misnamed(package: PackageFiles) -> Files:
    """The executable lacks its last letter."""
    name, other = package.about, misspelt(package.about)
    line = f"set_target_properties({name} PROPERTIES OUTPUT_NAME {other})\n"
    end = re.compile(r"^ament_package\s*\(", re.MULTILINE)
    in_cmake = package.edited(CMAKE, lambda text: end.sub(rf"{line}\g<0>", text))
    if in_cmake:
        return in_cmake
    return _entry_point(package, lambda text: repr(text.replace(name, other, 1)))


@breaks("package.executable")
def entry_point_to_nothing(package: PackageFiles) -> Files:
    """The entry point names a function that does not exist."""
    return _entry_point(package, lambda text: repr(f"{text.rstrip()}_"))


@breaks("node.starts")
def import_misspelt(package: PackageFiles) -> Files:
    """The program imports a message by a name that does not exist."""
    for path in _modules(package):
        text = package.texts[path]
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and _INTERFACES.search(node.module or ""):
                first = node.names[0]
                # What uses it stays as it is.
                other = f"{misspelt(first.name)} as {first.asname or first.name}"
                return {path: _replaced(text, first, other)}
    return {}


@breaks("interface.found")
def definition_in_wrong_folder(package: PackageFiles) -> Files:
    """The folder of the definition has another name."""
    return _redefined(package, package.definition.replace("/", "s/"))


@breaks("interface.found")
def definition_in_lower_case(package: PackageFiles) -> Files:
    """The file of the definition has a name in lower case."""
    return _redefined(package, re.sub(r"(?<=\w)(?=[A-Z])", "_", package.definition).lower())


@breaks("interface.generated")
def interface_not_listed(package: PackageFiles) -> Files:
    """CMakeLists.txt generates another interface only."""
    other = _redefined(package, package.definition.replace("/", "/Other"))
    if not other:
        return {}
    return {**other, f"{package.folder}{package.definition}": package.text(package.definition)}


@breaks("interface.manifest")
def ament_package_missing(package: PackageFiles) -> Files:
    """CMakeLists.txt ends without ament_package()."""
    found = re.compile(rf"find_package\s*\(\s*{re.escape(package.name)}\b")
    if any(found.search(text) for text in package.texts.values()):
        return {}  # Whoever asks CMake for it does not build then.
    return package.edited(CMAKE, lambda text: re.sub(r"(?m)^\s*ament_package\s*\(.*", "", text))


@breaks("package.executable")
def not_installed(package: PackageFiles) -> Files:
    """CMakeLists.txt does not install the executable."""
    rule = re.compile(r"install\s*\(\s*TARGETS\b([^)]*?)(\b[A-Z]+\b[^)]*)\)")

    def without(found: re.Match[str]) -> str:
        targets = found[1].split()
        if package.about not in targets:
            return found[0]
        others = " ".join(name for name in targets if name != package.about)
        return f"install(TARGETS {others} {found[2]})" if others else ""

    return package.edited(CMAKE, lambda text: rule.sub(without, text))


@breaks("package.builds")
def header_misspelt(package: PackageFiles) -> Files:
    """The header of a message is written like its class."""

    def like_the_class(found: re.Match[str]) -> str:
        return found[1] + "".join(word.capitalize() for word in found[2].split("_"))

    for path in package.sources:
        text = _HEADER.sub(like_the_class, package.texts[path], count=1)
        if text != package.texts[path]:
            return {path: text}
    return {}


@breaks("node.starts")
def never_initialised(package: PackageFiles) -> Files:
    """main() does not call rclcpp::init."""
    call = re.compile(r"rclcpp::init\s*\([^;]*;")
    for command in read_commands(package.text(CMAKE)):
        if command.name == "add_executable" and command.arguments[:1] == (package.about,):
            for path in command.arguments[1:]:
                without_call = package.edited(path, lambda text: call.sub("", text))
                if without_call:
                    return without_call
    return {}


def _redefined(package: PackageFiles, to: str) -> dict[str, str | None]:
    """The definition has another place, which CMakeLists.txt names."""
    text = package.text(package.definition)
    listed = package.edited(CMAKE, lambda cmake: cmake.replace(package.definition, to))
    gone = package.deleted(package.definition)
    return {**gone, f"{package.folder}{to}": text, **listed} if gone and listed else {}


def _replaced(text: str, node: ast.expr | ast.alias, by: str) -> str:
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


def _entry_point(package: PackageFiles, change: Callable[[str], str]) -> Files:
    def edit(text: str) -> str:
        for node, value in _texts(ast.parse(text)):
            if re.match(rf"\s*{re.escape(package.about)}\s*=", value):
                return _replaced(text, node, change(value))
        return text

    return package.edited("setup.py", edit)


def _modules(package: PackageFiles) -> Iterator[str]:
    """The modules of a program: that of its entry point, then those that it names."""
    entry_point = re.compile(rf"\s*{re.escape(package.about)}\s*=\s*([\w.]+)")
    for _, value in _texts(ast.parse(package.text("setup.py"))):
        match = entry_point.match(value)
        if match:
            main = f"{package.folder}{match[1].replace('.', '/')}.py"
            names = {*re.findall(r"\w+", package.texts.get(main, ""))}
            others = [path for path in package.sources if path != main and Path(path).stem in names]
            yield from [main, *others] if main in package.sources else others


def _setup_call(tree: ast.AST) -> ast.Call | None:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "setup":
            return node
    return None


def _renamed_setup(text: str, name: str) -> str:
    """setup.py with another name of the package; its modules keep theirs.

    One text is replaced at a time, and the rest after that: the places of the others move by it.
    """
    tree = ast.parse(text)
    call = _setup_call(tree)
    packages = [one.value for one in call.keywords if one.arg == "packages"] if call else []
    in_packages = [*ast.walk(packages[0])] if packages else []
    for node in in_packages:
        # A variable with the name, such as [package_name]; find_packages(...) may stay.
        if isinstance(node, ast.Name) and not isinstance(packages[0], ast.Call):
            return _renamed_setup(_replaced(text, node, repr(name)), name)
    for constant, value in _texts(tree):
        begin = value.removesuffix(name)
        is_name = value != begin and begin in ("", "resource/", "share/")
        if is_name and constant not in in_packages:
            return _renamed_setup(_replaced(text, constant, repr(begin + misspelt(name))), name)
    return text
