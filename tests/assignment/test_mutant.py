"""A mutant is the reference with one mistake, and says exactly which checks notice it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.assignment.changed_reference import mutate
from grader.assignment.expected_statuses import deviations, expected_statuses
from grader.assignment.model import Assignment
from grader.assignment.mutant import Mutant, Variant
from grader.findings.finding import Status

FILES = {
    "bot/setup.py": b"name = 'bot'\n",
    "bot/bot/node.py": "spin()\n# Größe\nspin()\n".encode(),
    "bot/resource/bot": b"",
}


def variant(**changes: object) -> Variant:
    return Variant.model_validate({"id": "a", "title": "A", **changes})


def assignment(**requires: list[str]) -> Assignment:
    return Assignment.model_validate(
        {
            "rosgrade": 1,
            "id": "lesson",
            "title": "A lesson",
            "packages": [{"name": "bot"}],
            "checks": [
                {"id": check, "uses": "x", "points": 1, "requires": required}
                for check, required in requires.items()
            ],
        }
    )


def test_edits_replace_the_text_that_they_quote() -> None:
    edits = [
        {"file": "bot/setup.py", "replace": "'bot'", "with": "'tob'"},
        {"file": "bot/bot/node.py", "replace": "spin()", "with": "pass", "count": 2},
        {"file": "bot/bot/node.py", "replace": "Größe", "with": "Maß"},
    ]
    files, problems = mutate(variant(edits=edits), FILES)
    assert not problems
    assert files == {
        "bot/setup.py": b"name = 'tob'\n",
        "bot/bot/node.py": "pass\n# Maß\npass\n".encode(),
        "bot/resource/bot": b"",
    }
    assert FILES["bot/setup.py"] == b"name = 'bot'\n"


def test_files_are_replaced_added_and_deleted_and_folders_too() -> None:
    content = {"bot/setup.py": "new", "bot/launch/x.py": "more", "bot/resource": None}
    files, problems = mutate(variant(files=content), FILES)
    assert not problems
    assert files == {
        "bot/setup.py": b"new",
        "bot/bot/node.py": FILES["bot/bot/node.py"],
        "bot/launch/x.py": b"more",
    }


def test_files_and_folders_move_last() -> None:
    files, problems = mutate(
        variant(
            edits=[{"file": "bot/setup.py", "replace": "bot", "with": "tob"}],
            move={"bot/bot/node.py": "bot/bot/main.py", "bot": "ws/src/bot"},
        ),
        FILES,
    )
    assert not problems
    assert sorted(files) == [
        "ws/src/bot/bot/main.py",
        "ws/src/bot/resource/bot",
        "ws/src/bot/setup.py",
    ]
    assert files["ws/src/bot/setup.py"] == b"name = 'tob'\n"


SETUP, NODE = "bot/setup.py", "bot/bot/node.py"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"edits": [{"file": "setup.py", "replace": "a", "with": "b"}]}, "has no file 'setup.py'"),
        ({"edits": [{"file": SETUP, "replace": "zzz", "with": "b"}]}, "0 times in bot/setup.py,"),
        ({"edits": [{"file": NODE, "replace": "spin", "with": "b"}]}, "2 times in bot/bot/node.py"),
        ({"files": {"bot/setup.cfg": None}}, "nothing to delete: the reference has no 'bot/setup"),
        ({"move": {"bo": "x"}}, "nothing to move: the reference has no 'bo'"),
        ({}, "changes nothing"),
        ({"files": {"bot/resource/bot": ""}}, "changes nothing"),
    ],
)
def test_what_does_not_apply_is_reported(changes: dict[str, object], said: str) -> None:
    ((_, text),) = mutate(variant(**changes), FILES)[1]
    assert said in text


@pytest.mark.parametrize("path", ["/etc/passwd", "../bot", "bot/../../x", "", ".", "bot/", "./bot"])
def test_no_change_leaves_the_folder(path: str) -> None:
    for change in (
        {"files": {path: "x"}},
        {"move": {"bot": path}},
        {"edits": [{"file": path, "replace": "a", "with": "b"}]},
    ):
        with pytest.raises(ValueError, match="is not a path in the reference"):
            variant(**change)


def mutant(*loses: str) -> Mutant:
    return Mutant.model_validate({"id": "m", "title": "M", "loses": loses})


def test_a_variant_keeps_every_check() -> None:
    assert set(expected_statuses(assignment(a=[], b=["a"]), variant()).values()) == {Status.PASSED}


@given(st.data())
def test_every_check_is_lost_or_below_a_lost_one_or_passes(data: st.DataObject) -> None:
    names = [f"c{index}" for index in range(6)]
    requires = {
        name: data.draw(
            st.lists(st.sampled_from(names[:index]), unique=True) if index else st.just([])
        )
        for index, name in enumerate(names)
    }
    lost = data.draw(st.sampled_from(names))
    statuses = expected_statuses(assignment(**requires), mutant(lost))
    for name, status in statuses.items():
        # By definition of skipping: some requirement did not pass.
        waits = any(statuses[other] is not Status.PASSED for other in requires[name])
        assert status is (
            Status.SKIPPED if waits else Status.FAILED if name == lost else Status.PASSED
        )


def test_each_check_that_ended_otherwise_is_named() -> None:
    expected = {"a": Status.PASSED, "b": Status.FAILED, "c": Status.SKIPPED, "d": Status.PASSED}
    assert deviations(expected, expected) == {}
    actual = {"a": Status.FAILED, "b": Status.FAILED, "c": Status.PASSED}
    assert deviations(expected, actual) == {
        "a": "failed instead of passed",
        "c": "passed instead of skipped",
        "d": "no result instead of passed",
    }
