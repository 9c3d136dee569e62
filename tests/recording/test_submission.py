"""The record of a submission is read from JSON, or refused with its place."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from grader.errors import UsageError
from grader.recording.submission import PackageRecord, SubmissionRecord, read_record
from grader.submission import record as old_place

st.register_type_strategy(float, st.floats(allow_nan=False, allow_infinity=False))
st.register_type_strategy(str, st.text(st.characters(blacklist_categories=["Cs"]), max_size=10))


@settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.builds(SubmissionRecord))
def test_a_record_survives_json(tmp_path: Path, record: SubmissionRecord) -> None:
    file = tmp_path / "submission.json"
    file.write_bytes(TypeAdapter(SubmissionRecord).dump_json(record))
    assert read_record(file) == record


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('{"id": "a", "sha256": "0", "packages": [{"name": 1, "path": "."}]}', "packages.0.name"),
        ("{", "EOF"),
    ],
)
def test_a_file_that_holds_no_record_is_refused(tmp_path: Path, text: str, place: str) -> None:
    file = tmp_path / "submission.json"
    file.write_text(text)
    with pytest.raises(UsageError, match=f"is not the record of a submission.*(?s:.*){place}"):
        read_record(file)
    with pytest.raises(UsageError, match="is not the record of a submission"):
        read_record(tmp_path / "none.json")


def test_own_checks_of_before_find_the_record_where_it_was():
    assert old_place.SubmissionRecord is SubmissionRecord
    assert old_place.PackageRecord is PackageRecord
