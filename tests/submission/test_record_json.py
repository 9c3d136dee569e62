from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.errors import GraderFault, UsageError
from grader.submission.record import SubmissionRecord
from grader.submission.record_json import from_plain, read_record, to_plain

st.register_type_strategy(float, st.floats(allow_nan=False, allow_infinity=False))
st.register_type_strategy(str, st.text(st.characters(blacklist_categories=["Cs"]), max_size=10))
RECORDS = st.builds(SubmissionRecord)


@settings(max_examples=50, deadline=None)
@given(RECORDS)
def test_a_record_survives_json(record: SubmissionRecord) -> None:
    assert from_plain(json.loads(json.dumps(to_plain(record)))) == record


def test_a_record_is_plain(tmp_path: Path) -> None:
    record = SubmissionRecord(id="alice", sha256="0", problem="the submission is empty")
    assert to_plain(record) == {
        "id": "alice",
        "sha256": "0",
        "problem": "the submission is empty",
        "packages": [],
        "build": None,
    }
    (tmp_path / "submission.json").write_text(json.dumps(to_plain(record)))
    assert read_record(tmp_path / "submission.json") == record


@pytest.mark.parametrize(
    ("plain", "place"),
    [
        ({"id": "a"}, "sha256"),
        ({"id": "a", "sha256": "0", "packages": [{"name": 1, "path": "."}]}, "packages.0.name"),
        ([], "the whole"),
    ],
)
def test_what_is_no_record_is_refused_and_the_place_named(plain: object, place: str) -> None:
    with pytest.raises(GraderFault, match=f"no record of a submission: {place}"):
        from_plain(plain)


def test_a_file_that_holds_no_record_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("{")
    for name in ("x.json", "none.json"):
        with pytest.raises(UsageError, match="is no record of a submission"):
            read_record(tmp_path / name)
