"""rosdep keys become names that apt knows."""

from __future__ import annotations

from typing import Any

import pytest

from grader.submission.underlay.system_libraries import (
    System,
    is_of_python,
    not_importable,
    this_system,
)

NOBLE = System("ubuntu", "noble", frozenset({"libeigen3-dev"}))


@pytest.mark.parametrize(
    ("rule", "packages"),
    [
        (["libeigen3-dev"], ("libeigen3-dev",)),
        ({"*": ["a"], "noble": ["b", "c"]}, ("b", "c")),
        ({"*": ["a"], "bionic": ["b"]}, ("a",)),
        ({"*": ["a"], "noble": None}, ()),
        ({"apt": {"packages": ["a"]}}, ("a",)),
        ({"*": {"apt": {"packages": ["a"]}}}, ("a",)),
        ({"pip": {"packages": ["a"]}}, ()),
        ("a b", ("a", "b")),
        (None, ()),
    ],
)
def test_every_form_of_a_rule_is_read(rule: Any, packages: tuple[str, ...]) -> None:
    assert NOBLE.packages({"ubuntu": rule, "debian": ["other"]}) == packages


def test_only_what_is_not_installed_is_lacking() -> None:
    rules = [{"ubuntu": ["libeigen3-dev"]}, {"ubuntu": ["graphviz"]}, {"fedora": ["x"]}]
    assert NOBLE.lacking(rules) == ["graphviz"]


def test_where_apt_is_not_nothing_is_claimed() -> None:
    assert System("fedora", "", None).lacking([{"ubuntu": ["graphviz"]}]) == []


def test_the_names_of_what_is_derived_from_ubuntu_are_those_of_ubuntu(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    release = {"ID": "linuxmint", "ID_LIKE": "ubuntu debian", "VERSION_CODENAME": "wilma"}
    monkeypatch.setattr(
        "platform.freedesktop_os_release", lambda: release | {"UBUNTU_CODENAME": "noble"}
    )
    system = this_system()
    assert (system.id, system.codename) == ("ubuntu", "noble")


def test_libraries_of_python_are_found_by_their_keys() -> None:
    keys = ["python3", "python3-yaml", "python3-numpy", "python3-importlib-metadata"]
    assert all(map(is_of_python, keys))
    assert not is_of_python("graphviz")
    assert not_importable([*keys, "python3-catkin-pkg-modules", "python3-unobtainium"]) == [
        "python3-unobtainium"
    ]
