"""Dependencies that package.xml lacks, or that do not exist."""

from __future__ import annotations

from collections.abc import Iterator

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


_Fault = tuple[str, str, SourceError, tuple[str, str]]
"""What is seen, what to do (nothing: add a tag), where, and what is there and what to write."""


def why_wrong_dependencies(submission: SubmissionRecord, package: PackageRecord) -> Finding | None:
    """What package.xml lacks, or names although it does not exist; None if it is right."""
    faults = [*_missing(package), *_unknown(submission, package)]
    if not faults:
        return None
    seen, hints, places, rows = zip(*faults, strict=True)
    tags = codes(write for (_, write), hint in zip(rows, hints, strict=True) if not hint)
    add = [remedy("not_declared", tags=tags)] if tags else []
    return Finding(
        "; ".join(seen),
        " ".join([*add, *filter(None, hints)]),
        Evidence(places=places, tables=(Table("package.xml", ("what", "write"), rows),)),
    )


def _is_elsewhere(package: PackageRecord, item: Import) -> bool:
    """Whether all names that an import takes are known to be another package's."""
    source = next((one for one in package.sources if one.path == item.file), None)
    taken = [
        dotted.rpartition(".")[2]
        for _, dotted in (source.names if source else ())
        if dotted.startswith(f"{item.module}.")
    ]
    right = [import_of(name) or f"from {item.module}." for name in taken]
    return bool(right) and not any(line.startswith(f"from {item.module}.") for line in right)


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
        why = _IDLE.get(kinds.get(item.module, "").partition("/")[0], "")
        tag = f"<depend>{item.module}</depend>"
        verb, participle = "imports", "imported"
        if item.file.endswith(CODE):
            verb, participle = "includes", "included"
        elif item.file.endswith("CMakeLists.txt"):
            verb, participle = "uses", "used"
        yield (
            f"{item.file}:{item.line} {verb} {code(item.module)}{why}",
            "",
            SourceError(package.file("package.xml"), line, f"add {code(tag)} here"),
            (f"{participle} in {item.file}:{item.line}", tag),
        )


def _unknown(submission: SubmissionRecord, package: PackageRecord) -> Iterator[_Fault]:
    """The packages that package.xml names and that do not exist."""
    own = {item.name for item in submission.packages}
    imported = {item.module for item in package.ros_imports}
    for entry in package.dependencies:
        if entry.known is not False or entry.name in own:
            continue
        match = nearest(entry.name, imported) or meant(entry.name)
        yield (
            f"package.xml names {code(entry.name)}, which does not exist",
            remedy("misspelt_dependency", match=code(match), name=code(entry.name))
            if match
            else remedy("no_such_dependency", name=code(entry.name)),
            SourceError(package.file("package.xml"), entry.line, f"{entry.name} does not exist"),
            (
                f"<{entry.kind}>{entry.name}</{entry.kind}> does not exist",
                f"<{entry.kind}>{match}</{entry.kind}>" if match else "remove it",
            ),
        )
