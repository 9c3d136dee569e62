"""Dependencies that package.xml lacks, or that do not exist."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from grader.diagnosis.explanation import mistaken, remedy
from grader.diagnosis.process.exception_table import import_of
from grader.findings.finding import Evidence, Finding, Table
from grader.findings.words import code, codes
from grader.recording.submission import EMPTY, Import, PackageRecord, SourceError, SubmissionRecord
from grader.spec.nearest_name import nearest
from grader.submission.read.dependencies import meant
from grader.submission.read.includes import CODE

# Tags that make a package be there when the code runs or is built (REP-149).
_COUNTING = frozenset(
    {"depend", "exec_depend", "build_depend", "build_export_depend", "run_depend"}
)
# Words for a dependency in a tag that does not count, by the first part of the tag.
_IDLE = {
    "test_depend": " (test_depend counts for tests only)",
    "export": " (package.xml names it inside <export>, where it does not count)",
}


def why_unknown_imports(package: PackageRecord) -> Finding | None:
    """A file whose imports are unknown, since Python cannot parse it."""
    read = {item.file for item in package.imports}
    for error in package.syntax_errors:
        if error.file not in read:
            seen = f"the imports cannot be read: {error}"
            mistake = "empty_file" if error.message == EMPTY else "unknown_imports"
            return mistaken(mistake, seen, Evidence(places=(error,)))
    return None


class _Fault(NamedTuple):
    """One thing that is wrong with the dependencies in package.xml.

    Attributes:
        what: What is there, for the table.
        write: What to write instead.
        hint: What to do; empty where ``write`` is a tag to add.
    """

    seen: str
    place: SourceError
    what: str
    write: str
    hint: str = ""


def why_wrong_dependencies(submission: SubmissionRecord, package: PackageRecord) -> Finding | None:
    """What package.xml lacks, or names although it does not exist; None if it is right."""
    faults = [*_missing(package), *_unknown(submission, package)]
    if not faults:
        return None
    tags = codes(fault.write for fault in faults if not fault.hint)
    hints = [remedy("not_declared", tags=tags)] if tags else []
    hints += [fault.hint for fault in faults if fault.hint]
    rows = tuple((fault.what, fault.write) for fault in faults)
    table = Table("package.xml", ("what", "write"), rows)
    places = tuple(fault.place for fault in faults)
    seen = "; ".join(fault.seen for fault in faults)
    return Finding(seen, " ".join(hints), Evidence(places=places, tables=(table,)))


def _is_elsewhere(package: PackageRecord, item: Import) -> bool:
    """Whether all names that an import takes are known to be another package's."""
    begin = f"from {item.module}."
    names = [
        dotted.rpartition(".")[2]
        for source in package.sources
        if source.path == item.file
        for _, dotted in source.names
        if dotted.startswith(f"{item.module}.")
    ]
    return bool(names) and not any((import_of(name) or begin).startswith(begin) for name in names)


def _missing(package: PackageRecord) -> Iterator[_Fault]:
    """The first import of each ROS package that is needed and not declared."""
    kinds = {item.name: item.kind for item in package.dependencies if item.kind not in _COUNTING}
    declared = {item.name for item in package.dependencies if item.kind in _COUNTING}
    line = max((item.line or 0 for item in package.dependencies), default=0) or None
    needed: dict[str, Import] = {}
    for item in package.ros_imports:
        if item.optional or item.module in declared or item.module == package.name:
            continue
        if not _is_elsewhere(package, item):
            needed.setdefault(item.module, item)
    for item in needed.values():
        idle = _IDLE.get(kinds.get(item.module, "").partition("/")[0], "")
        tag = f"<depend>{item.module}</depend>"
        verb, participle = "imports", "imported"
        if item.file.endswith(CODE):
            verb, participle = "includes", "included"
        elif item.file.endswith("CMakeLists.txt"):
            verb, participle = "uses", "used"
        yield _Fault(
            f"{item.file}:{item.line} {verb} {code(item.module)}{idle}",
            SourceError(package.file("package.xml"), line, f"add {code(tag)} here"),
            what=f"{participle} in {item.file}:{item.line}",
            write=tag,
        )


def _unknown(submission: SubmissionRecord, package: PackageRecord) -> Iterator[_Fault]:
    """The packages that package.xml names and that do not exist."""
    own = {item.name for item in submission.packages}
    imported = {item.module for item in package.ros_imports}
    for entry in package.dependencies:
        if entry.known is not False or entry.name in own:
            continue
        match = nearest(entry.name, imported) or meant(entry.name)
        write, hint = "remove it", remedy("no_such_dependency", name=code(entry.name))
        if match:
            write = f"<{entry.kind}>{match}</{entry.kind}>"
            hint = remedy("misspelt_dependency", match=code(match), name=code(entry.name))
        yield _Fault(
            f"package.xml names {code(entry.name)}, which does not exist",
            SourceError(package.file("package.xml"), entry.line, f"{entry.name} does not exist"),
            what=f"<{entry.kind}>{entry.name}</{entry.kind}> does not exist",
            write=write,
            hint=hint,
        )
