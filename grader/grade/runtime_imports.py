"""Imports that only a run shows, because the code computes the names of the modules."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from grader.diagnosis.process.raised import submission_path
from grader.recording.model import Recording
from grader.recording.submission import Import, PackageRecord, SubmissionRecord
from grader.submission.read.rosdistro import PACKAGES


def with_runtime_imports(
    submission: SubmissionRecord, recordings: Iterable[Recording]
) -> SubmissionRecord:
    """The submission with the imports that the runs showed added to those that its code names.

    Imports by a library are left out: the student need not declare them.
    """
    imports: set[Import] = set()
    for recording in recordings:
        for declaration in recording.declared("imported"):
            module, line = str(declaration.data.get("module")), declaration.data.get("line")
            path = submission_path(str(declaration.data.get("file")), submission)
            if module in PACKAGES and isinstance(line, int) and path:
                imports.add(Import(module, path, line))
    packages = tuple(_with(package, imports) for package in submission.packages)
    return replace(submission, packages=packages)


def _with(package: PackageRecord, imports: Iterable[Import]) -> PackageRecord:
    """A package with those of some imports that its files make and its code does not name."""
    files = {path for _, path in package.files}
    named = {item.module for item in (*package.imports, *package.ros_imports)}
    shown = [item for item in imports if item.file in files and item.module not in named]
    shown.sort(key=lambda item: (item.file, item.line, item.module))
    return replace(package, ros_imports=(*package.ros_imports, *shown))
