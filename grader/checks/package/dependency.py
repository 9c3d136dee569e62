"""Check of package.xml against what the code imports."""

from __future__ import annotations

from collections.abc import Iterator

from grader.checks.check import Subject, check, stop_if
from grader.checks.finding import Evidence, Finding, Table
from grader.checks.package.package import OfPackage
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.not_built import existing_package, why_no_manifest, why_too_new
from grader.spec.nearest_name import nearest
from grader.submission.read.dependencies import meant
from grader.submission.record import Import, PackageRecord, SourceError, SubmissionRecord

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


class Dependencies(OfPackage):
    """Parameters of package.dependencies."""

    asks = "every ROS package that `{self.package}` imports is in package.xml"


@check("package.dependencies", Subject.SUBMISSION, Dependencies)
def dependencies(submission: SubmissionRecord, parameters: Dependencies) -> Finding:
    """package.xml declares the ROS packages that the code imports.

    Every ROS package that the Python code imports must be named in package.xml by `depend`,
    `exec_depend`, `build_depend`, `build_export_depend` or `run_depend`, and every package that
    is named there must exist. An import that the code can do without (guarded by `try`)
    needs no entry. Modules that the code names in none of its files, but imports in a run, count
    as well.
    """
    stop_if(why_no_manifest(submission, parameters.package))
    package = existing_package(submission, parameters.package)
    stop_if(why_too_new(package))
    stop_if(_why_unreadable(package))
    faults = [*_missing(package), *_unknown(submission, package)]
    if not faults:
        names = sorted({item.module for item in package.ros_imports} - {package.name})
        observed = f"{codes(names)} declared" if names else "none imported"
        return Finding.passed(parameters.asked_for, observed)
    seen, hints, places, rows = zip(*faults, strict=True)
    tags = [write for (_, write), hint in zip(rows, hints, strict=True) if not hint]
    add = (
        [
            f"Don't forget the dependencies: add {codes(tags)} to package.xml, directly below "
            "<package>."
        ]
        if tags
        else []
    )
    return Finding.failed(
        parameters.asked_for,
        "; ".join(seen),
        " ".join([*add, *filter(None, hints)]),
        Evidence(places=places, tables=(Table("package.xml", ("what", "write"), rows),)),
    )


def _why_unreadable(package: PackageRecord) -> Cause | None:
    """A file whose imports are unknown, since Python cannot parse it."""
    read = {item.file for item in package.imports}
    for error in package.syntax_errors:
        if error.file not in read:
            seen = f"the imports cannot be read: {error}"
            return Cause(seen, "Correct the syntax error first.", Evidence(places=(error,)))
    return None


_Fault = tuple[str, str, SourceError, tuple[str, str]]
"""What is seen, what to do (nothing: add a tag), where, and what is there and what to write."""


def _missing(package: PackageRecord) -> Iterator[_Fault]:
    """The first import of each ROS package that is needed and not declared."""
    kinds = {item.name: item.kind for item in package.dependencies if item.kind not in _COUNTING}
    declared = {item.name for item in package.dependencies if item.kind in _COUNTING}
    needed: dict[str, Import] = {}
    for item in package.ros_imports:
        if not item.optional and item.module not in declared and item.module != package.name:
            needed.setdefault(item.module, item)
    for item in needed.values():
        why = _IDLE.get(kinds.get(item.module, "").partition("/")[0], "")
        tag = f"<depend>{item.module}</depend>"
        yield (
            f"{item.file}:{item.line} imports {code(item.module)}{why}",
            "",
            SourceError(item.file, item.line, f"imports {item.module}"),
            (f"imported in {item.file}:{item.line}", tag),
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
            f"Did you mean {code(match)} instead of {code(entry.name)}?"
            if match
            else f"Remove {code(entry.name)} from package.xml.",
            SourceError(package.file("package.xml"), entry.line, f"{entry.name} does not exist"),
            (
                f"<{entry.kind}>{entry.name}</{entry.kind}> does not exist",
                f"<{entry.kind}>{match}</{entry.kind}>" if match else "remove it",
            ),
        )
