"""Read a package.xml: names and lines by a guarded parser, rules by catkin_pkg, as colcon does."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from grader.errors import GraderFault
from grader.recording.submission import EMPTY, Dependency, SourceError

MANIFEST = "package.xml"
_KINDS = """
depend build_depend build_export_depend buildtool_depend buildtool_export_depend exec_depend
run_depend test_depend doc_depend
"""
DEPENDENCY_KINDS = frozenset(_KINDS.split())
"""Tags of package.xml that name another package or a rosdep key (REP-149)."""

_MAX_BYTES = 256 * 1024
_MAX_DEPENDENCIES = 500
_LONGEST_TEXT = 1000
_DEFAULT_BUILD_TYPE = "catkin"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_UNCLOSED = (
    expat.errors.codes[expat.errors.XML_ERROR_TAG_MISMATCH],
    expat.errors.codes[expat.errors.XML_ERROR_NO_ELEMENTS],
)
_UNKNOWN_TAG = re.compile(r"following tags: ([\w-]+)")
_QUOTED = re.compile(r"[\"'](.+?)[\"']")


@dataclass(frozen=True)
class Manifest:
    """What a package.xml says.

    Attributes:
        name: The package's name; None where it names none that could be one.
        build_type: As colcon takes it: without an export it is ``catkin``. None where the XML is
            broken before it says.
        error: Why colcon does not accept it, or None.
        misplaced: Entries inside <export>, where they do not count, of a kind ``export/depend``.
        maintainers: As ``name <e-mail>``.
        groups: Groups that it is a member of (REP-149).
    """

    name: str | None
    build_type: str | None
    error: SourceError | None = None
    dependencies: tuple[Dependency, ...] = ()
    misplaced: tuple[Dependency, ...] = ()
    description: str = ""
    maintainers: tuple[str, ...] = ()
    licenses: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()


@dataclass
class _Element:
    tag: str
    line: int
    attributes: dict[str, str]
    text: str = ""


@dataclass
class _Document:
    """Elements directly below <package>, those of <export> with them as ``export/tag``."""

    elements: list[_Element] = field(default_factory=list)
    error: tuple[int | None, str] | None = None

    def texts(self, tag: str) -> list[str]:
        return [element.text.strip() for element in self.elements if element.tag == tag]


class _Refused(Exception):
    pass


def read_manifest(data: bytes, file: str, environment: Mapping[str, str]) -> Manifest:
    """Read a package.xml; conditions of its entries (REP-149) are judged in ``environment``."""
    document = _parse(data)
    dependencies: list[Dependency] = []
    misplaced: list[Dependency] = []
    for element in document.elements:
        entry = Dependency(element.text.strip(), element.tag, element.line)
        tag = element.tag.removeprefix("export/")
        if element.tag in DEPENDENCY_KINDS and entry.name and _applies(element, environment):
            dependencies.append(entry)
        elif tag != element.tag and tag in (*DEPENDENCY_KINDS, "member_of_group"):
            misplaced.append(entry)
    names = [name for name in document.texts("name") if _NAME.fullmatch(name)]
    build_types = document.texts("export/build_type")
    if not build_types and not document.error:
        build_types = [_DEFAULT_BUILD_TYPE]
    error = document.error or _violation(data, document)
    if error is None and len(dependencies) > _MAX_DEPENDENCIES:
        error = (None, f"names more than {_MAX_DEPENDENCIES} dependencies")
    return Manifest(
        name=names[0] if names else None,
        build_type=build_types[0] if build_types else None,
        error=SourceError(file, *error) if error else None,
        dependencies=tuple(dependencies[:_MAX_DEPENDENCIES]),
        misplaced=tuple(misplaced[:_MAX_DEPENDENCIES]),
        description=" ".join(document.texts("description"))[:_LONGEST_TEXT],
        maintainers=tuple(
            f"{one.text.strip()} <{one.attributes.get('email', '')}>"
            for one in document.elements[:_MAX_DEPENDENCIES]
            if one.tag == "maintainer"
        ),
        licenses=tuple(document.texts("license")[:_MAX_DEPENDENCIES]),
        groups=tuple(document.texts("member_of_group")[:_MAX_DEPENDENCIES]),
    )


def _parse(data: bytes) -> _Document:
    if not data.strip():
        return _Document(error=(None, EMPTY))
    if len(data) > _MAX_BYTES:
        return _Document(error=(None, f"larger than {_MAX_BYTES // 1024} KiB; not read"))
    document = _Document()
    open_elements: list[tuple[str, int]] = []
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def tag_here() -> str:
        return "/".join(tag for tag, _ in open_elements[1:4])

    def start(tag: str, attributes: dict[str, str]) -> None:
        open_elements.append((tag, parser.CurrentLineNumber))
        depth = len(open_elements)
        if depth == 2 or (depth == 3 and open_elements[1][0] == "export"):
            element = _Element(tag_here(), parser.CurrentLineNumber, attributes)
            document.elements.append(element)

    def text(characters: str) -> None:
        if document.elements and document.elements[-1].tag == tag_here():
            document.elements[-1].text += characters

    def refuse_doctype(*_: object) -> None:
        # Entities are declared there; package.xml has no use for any of it.
        raise _Refused("a document type declaration (<!DOCTYPE ...>) is refused")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse_doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        if error.code in _UNCLOSED and open_elements:
            # The place to correct is where the element begins, not where expat noticed.
            tag, line = open_elements[-1]
            document.error = (line, f"invalid XML: <{tag}> is not closed")
        else:
            reason = expat.ErrorString(error.code)
            document.error = (error.lineno, f"invalid XML: {reason} (column {error.offset + 1})")
    except _Refused as error:
        document.error = (parser.CurrentLineNumber, str(error))
    except (ValueError, LookupError) as error:
        document.error = (None, f"invalid XML: {error}")
    return document


def _violation(data: bytes, document: _Document) -> tuple[int | None, str] | None:
    """What catkin_pkg, and with it colcon, does not accept."""
    try:
        from catkin_pkg.package import InvalidPackage, parse_package_string
    except ImportError as error:
        raise GraderFault("catkin_pkg is not installed: pip install catkin-pkg") from error
    try:
        package = parse_package_string(data, warnings=[])
        package.get_build_type()
        package.evaluate_conditions({})
    except (InvalidPackage, AssertionError, ValueError, RecursionError) as error:
        lines = [line.strip("- ") for line in str(error).splitlines()]
        wrong = [line for line in lines if line and not line.startswith("Error(s)")]
        message = "; ".join(wrong) or type(error).__name__
        return _line_of(message, document), message
    return None


def _line_of(message: str, document: _Document) -> int | None:
    """Find the element that a message of catkin_pkg quotes: what stands in it, or its tag."""
    quoted = _UNKNOWN_TAG.findall(message) or _QUOTED.findall(message)
    for value in quoted:
        for element in document.elements:
            if value == element.text.strip() or value in element.attributes.values():
                return element.line
    for value in quoted:
        for element in document.elements:
            if value == element.tag:
                return element.line
    return None


def _applies(element: _Element, environment: Mapping[str, str]) -> bool:
    condition = element.attributes.get("condition")
    if condition is None:
        return True
    try:
        from catkin_pkg.condition import evaluate_condition

        return bool(evaluate_condition(condition, dict(environment)))
    except (ImportError, ValueError):
        return True
