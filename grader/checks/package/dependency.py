"""Check of package.xml against what the code imports."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Table
from grader.checks.need import Submitted
from grader.checks.wording import code, codes
from grader.diagnosis.not_built import existing_package, why_no_manifest, why_too_new
from grader.spec.name import PackageName
from grader.spec.nearest_name import nearest
from grader.submission.read.dependencies import meant
from grader.submission.record import (
    Dependency,
    Import,
    PackageRecord,
    SourceError,
    SubmissionRecord,
)

INSIDE_EXPORT = "package.xml names it inside <export>, where it does not count"
# Tags that make a package be there when the code runs or is built (REP-149).
_COUNTING = frozenset(
    {"depend", "exec_depend", "build_depend", "build_export_depend", "run_depend"}
)
# What is said of a dependency that is named in a tag that does not count, by its first part.
_IDLE = {
    "test_depend": " (test_depend counts for tests only)",
    "export": f" ({INSIDE_EXPORT})",
}


class Dependencies(Parameters):
    """Parameters of package.dependencies."""

    needs = (Submitted(),)

    package: PackageName = Field(description="Name in package.xml.")


@check("package.dependencies", Subject.SUBMISSION, Dependencies)
def dependencies(submission: SubmissionRecord, parameters: Dependencies) -> Finding:
    """package.xml declares the ROS packages that the code imports.

    Every ROS package that the Python code imports must be named in package.xml by `depend`,
    `exec_depend`, `build_depend`, `build_export_depend` or `run_depend`, and every package that
    is named there must exist. An import that the code can do without (guarded by `try`)
    needs no entry. Modules that the code names in none of its files, but imports in a run, count
    as well.
    """
    expected = f"every ROS package that {code(parameters.package)} imports is in package.xml"
    cause = why_no_manifest(submission, parameters.package)
    if cause is not None:
        return cause.finding(expected)
    package = existing_package(submission, parameters.package)
    newer = why_too_new(package)
    if newer is not None:
        return newer.finding(expected)
    unreadable = _unreadable(package)
    if unreadable is not None:
        return Finding.failed(
            expected,
            f"the imports cannot be read: {unreadable}",
            "Correct the syntax error first.",
            Evidence(places=(unreadable,)),
        )
    missing, unknown = _missing(package), _unknown(submission, package)
    if missing or unknown:
        return _fault(package, expected, missing, unknown)
    imported = sorted({item.module for item in package.ros_imports if item.module != package.name})
    return Finding.passed(expected, f"{codes(imported)} declared" if imported else "none imported")


def _unreadable(package: PackageRecord) -> SourceError | None:
    """A file whose imports nobody could read, since Python cannot parse it."""
    read = {item.file for item in package.imports}
    return next((error for error in package.syntax_errors if error.file not in read), None)


def _missing(package: PackageRecord) -> list[Import]:
    """The first import of each ROS package that is needed and not declared."""
    declared = {item.name for item in package.dependencies if item.kind in _COUNTING}
    found: dict[str, Import] = {}
    for item in package.ros_imports:
        if not item.optional and item.module not in declared and item.module != package.name:
            found.setdefault(item.module, item)
    return list(found.values())


def _unknown(submission: SubmissionRecord, package: PackageRecord) -> list[Dependency]:
    own = {item.name for item in submission.packages}
    return [item for item in package.dependencies if item.known is False and item.name not in own]


def _fault(
    package: PackageRecord, expected: str, missing: list[Import], unknown: list[Dependency]
) -> Finding:
    manifest = "package.xml" if package.path in ("", ".") else f"{package.path}/package.xml"
    idle = {item.name: item.kind for item in package.dependencies if item.kind not in _COUNTING}
    parts, hints = [], []
    places: list[SourceError] = []
    rows: list[tuple[str, str]] = []
    for item in missing:
        why = _IDLE.get(idle.get(item.module, "").partition("/")[0], "")
        parts.append(f"{item.file}:{item.line} imports {code(item.module)}{why}")
        places.append(SourceError(item.file, item.line, f"imports {item.module}"))
        rows.append((f"imported in {item.file}:{item.line}", f"<depend>{item.module}</depend>"))
    if missing:
        tags = codes(f"<depend>{item.module}</depend>" for item in missing)
        hints.append(
            f"Don't forget the dependencies: add {tags} to package.xml, directly below <package>."
        )
    imported = {item.module for item in package.ros_imports}
    for entry in unknown:
        match = nearest(entry.name, imported) or meant(entry.name)
        parts.append(f"package.xml names {code(entry.name)}, which does not exist")
        places.append(SourceError(manifest, entry.line, f"{entry.name} does not exist"))
        remedy = f"<{entry.kind}>{match}</{entry.kind}>" if match else "remove it"
        rows.append((f"<{entry.kind}>{entry.name}</{entry.kind}> does not exist", remedy))
        hints.append(
            f"Did you mean {code(match)} instead of {code(entry.name)}?"
            if match
            else f"Remove {code(entry.name)} from package.xml."
        )
    return Finding.failed(
        expected,
        "; ".join(parts),
        " ".join(hints),
        Evidence(
            places=tuple(places),
            tables=(Table("package.xml", ("what", "write"), tuple(rows)),),
        ),
    )
