"""The way of the robot in the attempt before, beside the one of now."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.grading.graded import Graded
from grader.grading.last_attempt import EARLIER, keep_replays, replays_before
from grader.submission.prepare import Prepared
from tests.report.gallery import gallery


@pytest.fixture(scope="module")
def sample():
    return gallery()


def graded(sample, sha256):
    record = replace(sample.grade.submission, sha256=sha256)
    grade = replace(sample.grade, submission=record)
    return Graded(grade, Prepared(record, None), sample.recordings, {}, {}, {})


def test_the_last_other_attempt_is_kept_small(sample, tmp_path):
    for sha256 in ("a", "b", "b"):
        keep_replays(tmp_path, graded(sample, sha256))
    assert list(replays_before(tmp_path, "b")) == ["drive"]
    assert replays_before(tmp_path, "b")["drive"]["x"]
    (file,) = (tmp_path / EARLIER).iterdir()
    assert file.stat().st_size < 20_000


def test_a_first_attempt_has_none_before_it(sample, tmp_path):
    assert replays_before(tmp_path, "a") == {}
    keep_replays(tmp_path, graded(sample, "a"))
    assert replays_before(tmp_path, "a") == {}


@pytest.mark.parametrize("content", ["", "7", "[7]", '[{"sha256": "a"}]'])
def test_a_damaged_file_stops_no_report(tmp_path, content):
    (tmp_path / EARLIER).mkdir()
    (tmp_path / EARLIER / "replays.json").write_text(content)
    assert replays_before(tmp_path, "b") == {}
