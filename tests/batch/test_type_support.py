"""The interfaces that an assignment brings along, for the probe alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader import resources, ros
from grader.assignment.interfaces import FOLDER
from grader.assignment.load import load_assignment
from grader.batch.type_support import TypeSupport
from grader.recording.interface import sections_of
from grader.ros import RosInstallation


def test_an_assignment_of_ros_messages_needs_nothing(tmp_path: Path) -> None:
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))
    support = TypeSupport(load_assignment("timed_publisher"), installation, tmp_path / "cache")
    assert support.prefixes() == ()
    assert not (tmp_path / "cache").exists()


def test_the_copy_is_that_of_the_reference() -> None:
    copies = load_assignment("custom_interface").folder / FOLDER
    for copy in (path for path in copies.rglob("*") if path.is_file()):
        reference = resources.reference() / "custom_interface" / copy.relative_to(copies)
        assert copy.read_bytes() == reference.read_bytes(), copy


def test_what_was_deleted_is_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[Path] = []

    def build(_support: TypeSupport, _on_build: object) -> tuple[Path, ...]:
        built.append(tmp_path / f"prefix{len(built)}")
        built[-1].mkdir()
        return (built[-1],)

    monkeypatch.setattr(TypeSupport, "_built", build)
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))
    support = TypeSupport(load_assignment("timed_publisher"), installation, tmp_path / "cache")
    assert support.prefixes() == support.prefixes() == (built[0],)
    built[0].rmdir()
    assert support.prefixes() == (built[1],)


@pytest.mark.compiles
@pytest.mark.ros
@pytest.mark.slow
def test_the_copy_of_the_assignment_is_built_and_has_the_definition_that_is_asked_for(
    tmp_path: Path,
) -> None:
    loaded = load_assignment("custom_interface")
    told: list[str] = []
    support = TypeSupport(loaded, ros.find(), tmp_path)
    (prefix,) = support.prefixes(told.append)
    assert any("building enpm702_msgs" in line for line in told)
    assert support.prefixes() == (prefix,)
    built = (prefix / "share/enpm702_msgs/msg/BotStatus.msg").read_text(encoding="utf-8")
    asked = next(b.spec.with_ for b in loaded.checks if b.spec.id == "fields")
    assert sections_of(asked["interface"], built)[0].fields == (
        sections_of(asked["interface"], asked["definition"])[0].fields
    )
