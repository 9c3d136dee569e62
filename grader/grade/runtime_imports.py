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
    found = {
        Import(str(item.data["module"]), path, item.data["line"])
        for recording in recordings
        for item in recording.declared("imported")
        if str(item.data.get("module")) in PACKAGES
        and isinstance(item.data.get("line"), int)
        and (path := submission_path(str(item.data.get("file")), submission))
    }
    packages = tuple(_with(package, found) for package in submission.packages)
    return replace(submission, packages=packages)


def _with(package: PackageRecord, found: Iterable[Import]) -> PackageRecord:
    files = {path for _, path in package.files}
    named = {item.module for item in (*package.imports, *package.ros_imports)}
    more = [item for item in found if item.file in files and item.module not in named]
    more.sort(key=lambda item: (item.file, item.line, item.module))
    return replace(package, ros_imports=(*package.ros_imports, *more)) if more else package
