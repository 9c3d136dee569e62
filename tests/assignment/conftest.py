"""A small catalogue, and assignments written for one test."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

import pytest

from grader.assignment.load import load_assignment
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import Check, NoParameters, Parameters, Subject
from grader.checks.need import Recorded, Submitted
from grader.errors import AssignmentError, GraderFault
from grader.findings.finding import Finding
from grader.machine.ros import RosInstallation
from grader.spec.name import InterfaceName, TopicName
from grader.spec.quantity import Duration
from tests.assignment.lessons import GOOD


class _Package(Parameters):
    needs = (Submitted(),)

    package: str


class _Executable(Parameters):
    needs = (Submitted(executable="executable"),)

    package: str
    executable: str


class _Topic(Parameters):
    topic: TopicName


class _Messages(_Topic):
    needs = (Recorded(),)


class _Type(Parameters):
    needs = (Recorded(type="type", kind="kind"),)

    topic: TopicName
    type: InterfaceName
    kind: Literal["publisher", "subscription"] = "publisher"


class _Period(Parameters):
    needs = (Recorded(),)

    topic: TopicName
    period: Duration


def _never(subject: object, parameters: Parameters) -> Finding:
    """Something is right."""
    raise AssertionError("loading must not judge")


def _check(name: str, subject: Subject, parameters: type[Parameters] = NoParameters) -> Check:
    return Check(name, subject, parameters, _never)


_SMALL = (
    _check("package.builds", Subject.SUBMISSION, _Package),
    _check("package.executable", Subject.SUBMISSION, _Executable),
    _check("node.alive", Subject.RECORDING),
    _check("topic.published", Subject.RECORDING, _Topic),
    _check("topic.type", Subject.RECORDING, _Type),
    _check("messages.count", Subject.RECORDING, _Messages),
    _check("timing.period", Subject.RECORDING, _Period),
)


@pytest.fixture(scope="session")
def catalogue() -> dict[str, Check]:
    return {check.name: check for check in _SMALL}


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write ``lesson/assignment.yaml`` (and files beside it); returns its folder."""

    def _write(yaml: str = GOOD, **beside: str) -> Path:
        folder = tmp_path / "lesson"
        folder.mkdir(exist_ok=True)
        (folder / "assignment.yaml").write_text(yaml, encoding="utf-8")
        for name, content in beside.items():
            (folder / f"{name}.py").write_text(content, encoding="utf-8")
        return folder

    return _write


@pytest.fixture
def mistakes(write: Callable[..., Path]) -> Callable[..., list[str]]:
    """Load an assignment; each mistake as ``line: place: text``."""

    def _mistakes(yaml: str, catalogue: Mapping[str, Check] = CATALOGUE) -> list[str]:
        folder = write(yaml)
        try:
            load_assignment(folder, catalogue)
        except AssignmentError as error:
            place = f"{folder / 'assignment.yaml'}:"
            return [line.removeprefix(place) for line in str(error).splitlines()]
        return []

    return _mistakes


@pytest.fixture
def ros_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Let a ROS be installed that has just these interfaces; None for no ROS at all."""

    def install(definitions: Mapping[str, str] | None) -> None:
        prefix = tmp_path / "ros"
        index = prefix / "share/ament_index/resource_index/rosidl_interfaces"
        index.mkdir(parents=True)
        for name, text in (definitions or {}).items():
            file = prefix / "share" / f"{name}.{name.split('/')[1]}"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
            (index / name.split("/")[0]).touch()

        def find() -> RosInstallation:
            if definitions is None:
                raise GraderFault("no ROS 2 found")
            return RosInstallation("wheels", Path("python"), (prefix,))

        monkeypatch.setattr("grader.machine.ros.find", find)

    return install
