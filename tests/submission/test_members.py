from __future__ import annotations

import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.errors import SubmissionError
from grader.submission.intake.members import ArchiveLimits, Kind, Member, admit

LIMITS = ArchiveLimits(
    total_bytes=1000, members=10, ratio=10, ratio_from_bytes=200, depth=5, path_bytes=100
)
NAMES = st.lists(
    st.sampled_from(["a", "b", "..", ".", "", "C:", "\\", "~", "\0", "é", "\udcff", "x" * 99]),
    max_size=7,
).map("/".join)


def files(*names: str, size: int = 1) -> list[Member]:
    return [Member(place, name, Kind.FILE, size) for place, name in enumerate(names)]


def admitted(members: list[Member], archive_bytes: int = 1000) -> list[Member]:
    return admit(members, archive="bot.zip", archive_bytes=archive_bytes, limits=LIMITS)


def refusal(members: list[Member], archive_bytes: int = 1000) -> str:
    with pytest.raises(SubmissionError) as caught:
        admitted(members, archive_bytes)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("/etc/passwd", "absolute"),
        ("C:/boot.ini", "absolute"),
        ("\\\\host\\share", "absolute"),
        ("../x", "'..'"),
        ("a/../../x", "'..'"),
        ("a\0b", "NUL"),
        ("a/b/c/d/e/f", "5 folders deep"),
        ("x" * 256, "too long"),
        ("/".join("x" * 30 for _ in range(4)), "too long"),
        ("\ud800", "not valid Unicode"),
    ],
)
def test_a_name_that_leads_out_or_astray_is_refused(name: str, reason: str) -> None:
    message = refusal(files("good.py", name))
    assert message.startswith("bot.zip: ")
    assert reason in message


def test_the_sum_of_declared_sizes_is_bounded() -> None:
    assert "more than 0 MiB" in refusal(files("a", "b", size=600))


def test_the_ratio_is_bounded_from_a_size_on() -> None:
    admitted(files("a", size=190), archive_bytes=1)
    assert "10 times its size" in refusal(files("a", size=300), archive_bytes=20)


def test_what_tools_left_is_not_unpacked_and_may_be_ten_times_as_much() -> None:
    assert "more than 10 members" in refusal(files(*"abcdefghijk"))
    left = files(*(f".git/objects/{number}" for number in range(90)))
    assert [one.name for one in admitted([*left, *files("./a//b")])] == ["a/b"]
    assert "members" in refusal([*left, *files(*(f"__MACOSX/{n}" for n in range(20)))])


@pytest.mark.parametrize("names", [("a", "a"), ("a", "./a"), ("a/b", "a/b")])
def test_a_path_that_is_there_twice_is_refused(names: tuple[str, str]) -> None:
    assert "twice" in refusal(files(*names))


def test_a_file_cannot_be_a_folder_as_well() -> None:
    assert "a is not a folder" in refusal(files("a", "a/b"))
    assert "twice" in refusal(files("a/b", "a"))


@pytest.mark.parametrize("target", ["", "x" * 1001])
def test_a_link_without_a_path_that_a_file_system_takes_is_refused(target: str) -> None:
    assert "the link's target" in refusal([Member(0, "a", Kind.LINK, target=target)])


@settings(deadline=None)
@given(st.lists(NAMES, max_size=8))
def test_with_any_names_nothing_leaves_the_folder(names: list[str]) -> None:
    try:
        entries = admitted(files(*names))
    except SubmissionError:
        return
    paths = [os.path.normpath(f"/root/{one.name}") for one in entries]
    assert all(path.startswith("/root/") for path in paths)
    assert len(set(paths)) == len(paths)
