"""Interfaces of the students' own: what is taken of their definitions, and what never is."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.errors import GraderFault
from grader.grade.naming import with_chosen_names
from grader.grading.own_interfaces import own_packages, write_packages
from grader.machine import resources
from grader.recording.submission import Definition, PackageRecord, SubmissionRecord

REPORT = "rescue_msgs/msg/VictimReport"


@pytest.fixture(scope="module")
def loaded() -> LoadedAssignment:
    return load_assignment(resources.root() / "docs/examples/victim_report")


def handed_in(name: str = "rescue_msgs", **texts: str) -> SubmissionRecord:
    made = tuple(Definition(f"msg/{stem}.msg", text) for stem, text in texts.items())
    package = PackageRecord(name, name, "ament_cmake", generated=made)
    return SubmissionRecord("ana", "0" * 64, packages=(package,))


def written(loaded: LoadedAssignment, record: SubmissionRecord, folder: Path) -> dict[str, str]:
    write_packages(own_packages(loaded, record), folder)
    return {
        str(file.relative_to(folder)): file.read_text()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def test_only_what_the_fields_are_is_taken(loaded: LoadedAssignment, tmp_path: Path) -> None:
    text = (
        "# $(touch /tmp/owned)\n"
        'string<=9[<=3] names ["a", "\\"; import os #"]\n'
        'string EVIL=\'"""; import os; """\'\n'
        "float64 severity 0.5  # ${evil}\n"
        "Spot[2] where\n"
    )
    record = handed_in(
        VictimReport=text, Spot="geometry_msgs/msg/Point at\nSpot within\n", Else="x"
    )
    files = written(loaded, record, tmp_path)
    assert set(files) == {
        f"rescue_msgs/{name}"
        for name in ("CMakeLists.txt", "package.xml", "msg/VictimReport.msg", "msg/Spot.msg")
    }
    assert files["rescue_msgs/msg/VictimReport.msg"] == (
        "string<=9[<=3] names\nfloat64 severity\nrescue_msgs/Spot[2] where\n"
    )
    assert "DEPENDENCIES geometry_msgs)" in files["rescue_msgs/CMakeLists.txt"].replace("\n", "")
    assert not {"evil", "EVIL", "import", "touch"} & {
        word for one in files.values() for word in one.replace("(", " ").split()
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("float64[99999999] x\n", "arrays of more than 100000 values"),
        ("float64 x = = 1\n???\n", "cannot be read: line 2: '???'"),
    ],
)
def test_what_cannot_be_read_here_is_a_fault_of_ours(
    loaded: LoadedAssignment, text: str, words: str
) -> None:
    with pytest.raises(GraderFault, match=f"{REPORT} of the submission .*{words[:20]}"):
        own_packages(loaded, handed_in(VictimReport=text))


def test_what_was_not_built_or_comes_from_ros_is_not_the_students(loaded: LoadedAssignment) -> None:
    assert own_packages(loaded, SubmissionRecord("ana", "0" * 64)) == {}
    (package,) = own_packages(loaded, handed_in(VictimReport="std_msgs/String text\n"))
    assert package == "rescue_msgs"


def test_of_several_messages_that_of_the_topic_is_the_one(loaded: LoadedAssignment) -> None:
    record = handed_in(Battery="float64 volts\n", VictimReport="float64 severity\n")
    # Before any run, one stands for all.
    chosen = with_chosen_names(loaded, record)
    assert not chosen.unnamed
    assert chosen.loaded.values == {"report": "rescue_msgs/msg/Battery"}


def test_a_definition_of_the_authors_is_the_only_one_that_counts(tmp_path: Path) -> None:
    example = resources.root() / "docs/examples/victim_report"
    folder = tmp_path / "victim_report"
    copy = folder / "interfaces/rescue_msgs"
    (copy / "msg").mkdir(parents=True)
    (folder / "assignment.yaml").write_text((example / "assignment.yaml").read_text())
    reference = example / "reference/rescue_msgs"
    for name in ("package.xml", "CMakeLists.txt", "msg/VictimReport.msg"):
        (copy / name).write_text((reference / name).read_text())
    record = handed_in(VictimReport="float64 severity\n")
    assert own_packages(load_assignment(folder), record) == {}
