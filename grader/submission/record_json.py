"""A submission's record as plain JSON and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from grader.errors import GraderFault, UsageError
from grader.submission.record import SubmissionRecord

_RECORD = TypeAdapter(SubmissionRecord)


def to_plain(record: SubmissionRecord) -> dict[str, Any]:
    """Turn a record into dictionaries, lists and scalars, as :mod:`json` writes them."""
    plain: dict[str, Any] = _RECORD.dump_python(record, mode="json")
    return plain


def from_plain(plain: object) -> SubmissionRecord:
    """Turn what :func:`to_plain` made into a record again.

    Raises:
        GraderFault: It is no record: a field is missing or of a wrong type.
    """
    try:
        return _RECORD.validate_python(plain)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the whole"
        raise GraderFault(f"this is no record of a submission: {place}: {first['msg']}") from error


def read_record(file: Path) -> SubmissionRecord:
    """Read a record from a JSON file.

    Raises:
        UsageError: It cannot be read, or holds no record.
    """
    try:
        return _RECORD.validate_json(file.read_bytes())
    except (OSError, ValidationError) as error:
        raise UsageError(f"{file}: is no record of a submission: {error}") from error
