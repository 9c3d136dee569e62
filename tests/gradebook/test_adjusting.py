"""What is written down about a class reaches the right rows."""

from pathlib import Path

import pytest

from grader.batch.ledger import Entry, Ledger
from grader.errors import AssignmentError
from grader.gradebook.adjusting import ClassAdjustments
from grader.report.model.result_model import Result
from grader.review.model import Comment, StudentReview
from grader.review.store import ReviewStore
from tests.report.sample import full_points


def result_of(key: str) -> Result:
    result = full_points().result
    return result.model_copy(
        update={"submission": result.submission.model_copy(update={"id": key})}
    )


def test_a_team_has_one_review_that_of_its_first_member(tmp_path: Path) -> None:
    ledger, store = Ledger(tmp_path), ReviewStore(tmp_path)
    rows = [Entry("ana", team="ana"), Entry("ben", team="ana"), Entry("cai")]
    ledger.write(rows, "timed_publisher", "0" * 64)
    for key in ("ana", "ben", "zoe"):
        store.save(StudentReview(key=key, comments=(Comment(text=f"to {key}", by="AB"),)), "")
    adjust = ClassAdjustments(ledger)
    said = {row.key: adjust(result_of(row.key)).comments for row in rows}
    assert {key: [one.text for one in found] for key, found in said.items()} == {
        "ana": ["to ana"],
        "ben": ["to ana"],
        "cai": [],
    }
    # What no row uses is named, and stays.
    assert adjust.vanished() == ("ben", "zoe")
    assert store.student("ben").content.comments[0].text == "to ben"
    # One that cannot be read is an error before anything is written.
    store.file("cai").write_text("key: cai\ncomments: [nice]\n", encoding="utf-8")
    with pytest.raises(AssignmentError):
        adjust.vanished()
