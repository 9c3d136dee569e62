"""Assignments, references and templates are found in a checkout and in a wheel."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from grader.errors import GraderFault
from grader.machine import resources


def test_in_this_checkout_they_stand_beside_the_package() -> None:
    assert resources.root() == resources.PACKAGE.parent
    assert (resources.assignments() / "timed_publisher" / "assignment.yaml").is_file()
    assert (resources.reference() / "timed_publisher").is_dir()
    assert resources.templates().name == "templates"


def test_in_a_wheel_they_are_inside_the_package(tmp_path: Path) -> None:
    package = tmp_path / "site-packages" / "grader"
    (package / "_data" / "assignments").mkdir(parents=True)
    # Another distribution's folder of that name is not rosgrade's.
    (tmp_path / "site-packages" / "assignments").mkdir()
    assert resources.root(package) == package / "_data"


def test_an_incomplete_installation_is_our_fault(tmp_path: Path) -> None:
    with pytest.raises(GraderFault, match=re.escape(f"no assignments beside {tmp_path / 'x'}")):
        resources.root(tmp_path / "x")
