"""The reference's runs beside an assignment: shipped, fresh, read again, refused when damaged."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path

import pytest

from grader.assignment.load import list_assignments, load_assignment
from grader.errors import AssignmentError, UsageError
from grader.grade import judge_all
from grader.grading.reference_run import REFERENCE_FILE, keep_reference, read_references
from tests.grade.sample import FAIL, Told, make_loaded, make_submission
from tests.report.gallery import ahead_until

WORLD = "segments: [[0.6, -1, 0.6, 1]]\n"


def make(folder: Path, says=None):
    """An assignment with a robot, and the run of its reference."""
    (folder / "wall.yaml").write_text(WORLD)
    loaded = make_loaded([Told("node") if says is None else Told("node", says)], ("drive",))
    scenario = loaded.assignment.scenarios[0].model_copy(update={"world": "wall.yaml"})
    assignment = loaded.assignment.model_copy(update={"scenarios": (scenario,)})
    loaded = replace(loaded, assignment=assignment, file=folder / "assignment.yaml")
    return loaded, {"drive": replace(ahead_until(0.2), submission=make_submission())}


def kept(loaded, recordings):
    """Where the runs of a reference with full points are kept."""
    keep_reference(loaded, judge_all(loaded, make_submission(), recordings), recordings)
    return loaded.folder / REFERENCE_FILE


@pytest.mark.parametrize("name", list_assignments())
def test_shipped_runs_are_of_the_scenarios_as_they_are(name):
    loaded = load_assignment(name)
    if (loaded.folder / REFERENCE_FILE).is_file():
        driven = {one.id for one in loaded.assignment.scenarios if one.world is not None}
        again = f"record again: rosgrade selftest --record {name}"
        assert driven <= set(read_references(loaded)), again


def test_what_is_written_is_read_again(tmp_path):
    loaded, recordings = make(tmp_path)
    assert kept(loaded, recordings).parent == tmp_path
    found = read_references(loaded)
    assert list(found) == ["drive"] and len(found["drive"]["x"]) > 20


def test_the_same_runs_are_the_same_bytes(tmp_path):
    loaded, recordings = make(tmp_path)
    first = kept(loaded, recordings).read_bytes()
    assert kept(loaded, recordings).read_bytes() == first


def test_a_run_in_another_world_is_not_shown(tmp_path):
    loaded, recordings = make(tmp_path)
    kept(loaded, recordings)
    (tmp_path / "wall.yaml").write_text(WORLD.replace("0.6", "0.9"))
    assert read_references(loaded) == {}


def test_without_a_file_there_is_no_reference(tmp_path):
    loaded, _ = make(tmp_path)
    assert read_references(loaded) == {}


@pytest.mark.parametrize(
    "content",
    [b"", b"no gzip", gzip.compress(b"{", mtime=0), gzip.compress(b'{"schema":1}', mtime=0)],
)
def test_a_damaged_file_is_refused(tmp_path, content):
    loaded, _ = make(tmp_path)
    (tmp_path / REFERENCE_FILE).write_bytes(content)
    with pytest.raises(
        AssignmentError, match=r"reference\.json\.gz: it cannot be read .* record it"
    ):
        read_references(loaded)


def test_what_is_kept_is_named(tmp_path):
    loaded, recordings = make(tmp_path)
    told = keep_reference(loaded, judge_all(loaded, make_submission(), recordings), recordings)
    assert told.endswith(f"1 run of the reference kept in {tmp_path / REFERENCE_FILE}")


def test_a_reference_that_loses_points_is_not_kept(tmp_path):
    loaded, recordings = make(tmp_path, FAIL)
    result = judge_all(loaded, make_submission(), recordings)
    with pytest.raises(UsageError, match="does not get full points"):
        keep_reference(loaded, result, recordings)
    assert not (tmp_path / REFERENCE_FILE).exists()
