"""The file in which a submission says what is meant by free names."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.submission.intake.listing import SubmissionFile
from grader.submission.read.answers import FILE, read_answers


def read(tmp_path: Path, text: str | bytes, *paths: str) -> object:
    data = text.encode() if isinstance(text, str) else text
    for path in paths or (FILE,):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_bytes(data)
    files = [SubmissionFile(path, len(data)) for path in paths or (FILE,)]
    return read_answers(tmp_path, files)


def test_names_and_numbers_are_read_as_they_are_written(tmp_path: Path) -> None:
    text = "# ours\nplanner: /brain\nn: 07\n"
    assert read(tmp_path, text) == ((("planner", "/brain"), ("n", "07")), None)


def test_it_lies_in_any_folder_of_what_was_handed_in(tmp_path: Path) -> None:
    assert read(tmp_path, "a: b", f"src/{FILE}") == ((("a", "b"),), None)


def test_without_the_file_nothing_is_said(tmp_path: Path) -> None:
    assert read_answers(tmp_path, []) == ((), None)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a: [b\n", "rosgrade.yaml:2: expected"),
        ("a: b\nc: [d]\n", "rosgrade.yaml:2: expected a line such as"),
        ("a: b\na: c\n", "rosgrade.yaml:2: 'a' stands twice"),
        ("just words", "rosgrade.yaml has no line such as"),
        ("", "rosgrade.yaml has no line such as"),
        (b"a: \xff", "rosgrade.yaml is not text in UTF-8"),
        ("a: " + 20_000 * "b", "rosgrade.yaml has more than 16384 bytes"),
        (f"a: {2000 * '['}", "rosgrade.yaml:1:"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, text: str | bytes, told: str) -> None:
    answers, problem = read(tmp_path, text)  # type: ignore[misc]
    assert answers == () and problem.startswith(told)


def test_two_files_are_one_too_many(tmp_path: Path) -> None:
    _, problem = read(tmp_path, "a: b", FILE, f"src/{FILE}")  # type: ignore[misc]
    assert problem == f"there is more than one rosgrade.yaml: {FILE} and src/{FILE}"


def test_aliases_are_not_followed(tmp_path: Path) -> None:
    text = "a: &a b\n" + "".join(f"x{n}: *a\n" for n in range(50))
    answers, problem = read(tmp_path, text)  # type: ignore[misc]
    assert problem is None and len(answers) == 51
