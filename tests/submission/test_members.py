from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.errors import SubmissionError
from grader.submission.intake.members import (
    ArchiveLimits,
    Kind,
    LeadsOut,
    Member,
    admit,
    resolve_link,
)

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


@pytest.mark.parametrize("target", ["/etc", "..", "../x", "b/../../x"])
def test_a_link_that_leads_out_is_refused(target: str) -> None:
    assert "leads out" in refusal([Member(0, "a", Kind.LINK, target=target), *files("b/c")])


@pytest.mark.parametrize(
    "path",
    [
        "ws/build/bot/package.xml",
        "ws/install/bot/lib/bot",
        "ws/log/latest",
        "install/x",
        "ws/src/bot/log/x",
        "mine/bin/python",
    ],
)
def test_links_out_of_what_colcon_and_venv_left_behind_are_left_out(path: str) -> None:
    present = files("ws/src/bot/package.xml", "ws/src/bot/log/COLCON_IGNORE", "mine/pyvenv.cfg")
    link = Member(9, path, Kind.LINK, target="/home/student/ros2_ws/src/bot/package.xml")
    assert link.name not in [one.name for one in admitted([*present, link])]


def test_in_a_package_a_folder_called_log_is_not_colcon_s() -> None:
    link = Member(9, "src/bot/log/x", Kind.LINK, target="/etc/passwd")
    assert "leads out" in refusal([*files("src/bot/package.xml"), link])


def test_a_link_to_something_inside_is_kept_and_one_to_nothing_is_not() -> None:
    links = [
        Member(0, "d/good", Kind.LINK, target="../x"),
        Member(1, "dangling", Kind.LINK, target="y"),
        Member(2, "loop", Kind.LINK, target="loop"),
    ]
    assert [one.name for one in admitted([*links, *files("x")])] == ["d/good", "x"]


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


PARTS = st.sampled_from(["a", "b", "c", "..", "."])
LINKS = st.dictionaries(
    st.sampled_from(["a", "b", "d/a", "d/b", "d/e/a"]),
    st.lists(PARTS, min_size=1, max_size=4).map("/".join),
    max_size=5,
)


@settings(deadline=None)
@given(LINKS)
def test_links_are_followed_as_the_file_system_does(links: dict[str, str]) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        # Far enough down that no link of these leads out of the scratch folder.
        root = Path(scratch, *"12345678901234567890", "root").resolve()
        (root / "d/e").mkdir(parents=True)
        for path, target in links.items():
            (root / path).symlink_to(target)
        for path in links:
            real = os.path.realpath(root / path)
            inside = f"{real}/".startswith(f"{root}/")
            try:
                found = resolve_link(path, links)
            except LeadsOut:
                continue
            # None is a loop, or the root itself; neither is unpacked.
            assert found is None or inside
            if found is not None and (root / path).exists():
                assert str(root / found) == real
