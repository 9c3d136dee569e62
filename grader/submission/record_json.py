"""A submission's record read from JSON."""

from __future__ import annotations

from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from grader.errors import UsageError
from grader.submission.record import SubmissionRecord

_RECORD = TypeAdapter(SubmissionRecord)


def read_record(file: Path) -> SubmissionRecord:
    """Read a record from a JSON file.

    Raises:
        UsageError: It cannot be read, or holds no record.
    """
    try:
        return _RECORD.validate_json(file.read_bytes())
    except (OSError, ValidationError) as error:
        raise UsageError(f"{file}: is no record of a submission: {error}") from error
