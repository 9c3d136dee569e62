"""The path by which own checks of courses import the record of a submission since their first days.

It lies in :mod:`grader.recording.submission` now: what judges needs nothing else of this room.
"""

from grader.recording.submission import (
    BuildRecord,
    PackageRecord,
    SourceCall,
    SourceClass,
    SourceError,
    SourceFile,
    SourceFunction,
    SubmissionRecord,
)

__all__ = [
    "BuildRecord",
    "PackageRecord",
    "SourceCall",
    "SourceClass",
    "SourceError",
    "SourceFile",
    "SourceFunction",
    "SubmissionRecord",
]
