"""Names that students choose: found in what was handed in, in runs, or in the roster."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from grader.assignment.interfaces import write_interfaces
from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.selection import select
from grader.errors import UsageError
from grader.findings.finding import Status
from grader.grade import Grade, judge_all
from grader.grade.naming import with_chosen_names
from grader.recording.interaction import Service
from grader.recording.model import Recording
from grader.recording.submission import BuildRecord, Definition, PackageRecord, SubmissionRecord
from tests.checks.builder import recording

TOGGLE = "std_srvs/srv/SetBool"
YAML = """\
rosgrade: 1
id: names
title: The bot of group {n}
variables:
  n: {match: "group{n}_gp2", in: packages, example: 7}
  run: {match: any, in: executables, of: "group{n}_gp2", example: bot}
  toggle: {match: any, in: services, of: std_srvs/srv/SetBool, example: /toggle}
  team: {column: Team, match: "{team}_maps", in: packages, example: red}
packages:
  - name: group{n}_gp2
    executables: ["{run}"]
  - name: "{team}_maps"
scenarios:
  - id: main
    launch: [{package: "group{n}_gp2", executable: "{run}", parameters: {group: "{n}"}}]
    stimuli: [{call: "{toggle}", type: std_srvs/srv/SetBool}]
    timeout: 5 s
checks:
  - {id: maps, uses: package.found, with: {package: "{team}_maps"}, points: 1}
  - {id: bot, uses: package.found, with: {package: "group{n}_gp2"}, points: 1, hint: "{n} {other}"}
  - {id: service, uses: service.exists, with: {service: "{toggle}"}, points: 1, requires: [bot]}
"""


@pytest.fixture
def loaded(tmp_path: Path) -> LoadedAssignment:
    folder = tmp_path / "names"
    folder.mkdir()
    (folder / "assignment.yaml").write_text(YAML, encoding="utf-8")
    return load_assignment(folder)


def submission(
    *packages: str, scripts: tuple[str, ...] = ("bot",), **given: str
) -> SubmissionRecord:
    return SubmissionRecord(
        "ana",
        "ab" * 32,
        packages=tuple(
            PackageRecord(name, f"src/{name}", entry_points=tuple((s, "m:main") for s in scripts))
            for name in packages
        ),
        build=BuildRecord(succeeded=True, duration_s=1.0),
        given=tuple(given.items()),
    )


def runs(record: SubmissionRecord, *services: str) -> Mapping[str, Recording]:
    offered = tuple(Service(name, TOGGLE, "/bot", appeared_ns=0) for name in services)
    run = recording()
    made = dataclasses.replace(run, scenario="main", services=offered, submission=record)
    return {"main": made}


def test_the_example_stands_in_an_assignment_until_there_is_a_submission(
    loaded: LoadedAssignment,
) -> None:
    assert loaded.assignment.title == "The bot of group 7"
    assert [one.name for one in loaded.assignment.packages] == ["group7_gp2", "red_maps"]
    assert loaded.checks[1].spec.hint == "7 {other}"


def test_names_of_the_submission_stand_everywhere_and_a_number_alone_is_a_number(
    loaded: LoadedAssignment,
) -> None:
    record = submission("group12_gp2", "blue_maps", scripts=("driver",))
    named = with_chosen_names(loaded, record)
    found = named.loaded
    assert not named.unnamed
    launch = found.assignment.scenarios[0].launch[0]
    assert (launch.package, launch.executable) == ("group12_gp2", "driver")
    assert launch.parameters == {"group": 12}
    assert found.assignment.title == "The bot of group 12"
    assert found.values["team"] == "blue"


def test_a_part_of_an_assignment_stays_the_same_part(loaded: LoadedAssignment) -> None:
    part = select(loaded, ("maps",))
    found = with_chosen_names(part, submission("group12_gp2", "blue_maps")).loaded
    assert [check.spec.id for check in found.checks] == ["maps"]
    assert found.assignment.scenarios == ()


def test_where_no_name_fits_each_check_of_it_tells_the_form_and_what_was_found(
    loaded: LoadedAssignment,
) -> None:
    graded = judge_all(loaded, submission("team7", "red_maps"), {})
    result = graded.result("bot")
    assert result.status is Status.FAILED
    finding = result.decisive.finding
    assert finding.expected == (
        "one package with a name of the form `group{n}_gp2`, such as `group7_gp2`"
    )
    assert finding.observed == "found `team7` and `red_maps`"
    assert graded.result("service").status is Status.SKIPPED
    assert graded.graded


def test_two_names_that_fit_are_both_told(loaded: LoadedAssignment) -> None:
    graded = judge_all(loaded, submission("group7_gp2", "group12_gp2", "red_maps"), {})
    assert graded.result("bot").decisive.finding.observed == (
        "found `group7_gp2` and `group12_gp2`"
    )


def test_which_of_two_is_meant_is_a_question_and_costs_nothing(loaded: LoadedAssignment) -> None:
    record = submission("group7_gp2", "red_maps", scripts=("bot", "test"))
    (why,) = with_chosen_names(loaded, record).unnamed
    assert why.finding.expected == "one executable of `group7_gp2`"
    assert why.finding.observed.startswith("there are `bot` and `test`")
    assert not judge_all(loaded, record, {}).graded


def failed_build(record: SubmissionRecord, name: str) -> SubmissionRecord:
    """In C++, with an error of the compiler in a package."""
    log = f"Starting >>> {name}\nsrc/bot.cpp:3:1: error: expected ';'\nFailed   <<< {name} [1s]"
    cmake = "add_executable(driver src/bot.cpp)\ninstall(TARGETS driver DESTINATION lib)"
    packages = tuple(
        dataclasses.replace(one, build_type="ament_cmake", entry_points=(), cmake=cmake)
        for one in record.packages
    )
    build = BuildRecord(False, 1.0, failed_packages=(name,), log=log)
    return dataclasses.replace(record, packages=packages, build=build)


def test_a_name_of_what_was_not_built_is_not_asked_for_and_the_build_is_told(
    loaded: LoadedAssignment,
) -> None:
    record = failed_build(submission("group12_gp2", "red_maps"), "group12_gp2")
    named = with_chosen_names(loaded, record)
    found = named.loaded
    assert not named.unnamed
    assert (found.assignment.title, found.values["run"]) == ("The bot of group 12", "driver")
    silent = dataclasses.replace(
        record, packages=tuple(dataclasses.replace(one, cmake="") for one in record.packages)
    )
    named = with_chosen_names(loaded, silent)
    found = named.loaded
    assert not named.unnamed
    assert (found.assignment.title, found.values["run"]) == ("The bot of group 12", "bot")


def test_a_check_of_a_name_that_was_found_does_not_fail_by_another(
    loaded: LoadedAssignment,
) -> None:
    graded = judge_all(loaded, submission("group12_gp2", "red_maps", scripts=()), {})
    assert graded.result("bot").status is Status.PASSED
    assert "group12_gp2" in graded.result("bot").decisive.finding.observed
    service = graded.result("service").decisive.finding
    assert service.observed == "setup.py defines no console_scripts"
    assert [place.file for place in service.evidence.places] == ["src/group12_gp2/setup.py"]


def test_the_roster_comes_before_what_was_handed_in(loaded: LoadedAssignment) -> None:
    record = submission("group7_gp2", "blue_maps", team="green")
    found = with_chosen_names(loaded, record).loaded
    assert found.values["team"] == "green"
    result = judge_all(loaded, record, {}).result("maps")
    assert "green_maps" in result.decisive.finding.expected


def test_a_value_of_the_roster_that_is_no_name_is_no_fault_of_the_student(
    loaded: LoadedAssignment,
) -> None:
    with pytest.raises(UsageError, match="'Team' of the roster holds 'red team'"):
        with_chosen_names(loaded, submission("group7_gp2", team="red team"))


def test_a_service_of_any_name_is_found_in_the_run_by_its_type(loaded: LoadedAssignment) -> None:
    record = submission("group7_gp2", "red_maps")
    before = with_chosen_names(loaded, record)
    after = with_chosen_names(loaded, record, runs(record, "/light"))
    assert [one.loaded.values["toggle"] for one in (before, after)] == ["/toggle", "/light"]
    graded = judge_all(loaded, record, runs(record, "/light"))
    assert graded.result("service").status is Status.PASSED


def test_no_service_of_the_type_is_what_the_check_finds(loaded: LoadedAssignment) -> None:
    record = submission("group7_gp2", "red_maps")
    result = judge_all(loaded, record, runs(record)).result("service")
    assert result.status is Status.FAILED
    assert "`/toggle`" in result.decisive.finding.expected


def test_of_two_services_of_the_type_the_submission_says_which_is_meant(
    loaded: LoadedAssignment,
) -> None:
    record = submission("group7_gp2", "red_maps")
    result = judge_all(loaded, record, runs(record, "/light", "/lamp")).result("service")
    assert result.status is Status.ERROR
    assert "`/lamp` and `/light`" in result.decisive.finding.observed
    assert "`toggle: /lamp`" in result.decisive.finding.hint
    told = dataclasses.replace(record, answers=(("toggle", "/light"),))
    graded = judge_all(loaded, told, runs(told, "/light", "/lamp"))
    assert graded.result("service").status is Status.PASSED
    assert [(one.name, one.value) for one in graded.chosen] == [("toggle", "/light")]


def test_a_package_name_that_begins_with_a_digit_breaks_rep_144_and_is_graded(
    loaded: LoadedAssignment,
) -> None:
    record = submission("group7_gp2", "7up_maps")
    named = with_chosen_names(loaded, record)
    found = named.loaded
    assert not named.unnamed and found.values["team"] == "7up"
    finding = judge_all(loaded, record, {}).result("maps").decisive.finding
    assert finding.status is Status.FAILED
    assert "REP-144" in finding.observed


def test_a_name_that_ros_does_not_allow_is_told_and_not_run(tmp_path: Path) -> None:
    folder = tmp_path / "names"
    folder.mkdir()
    text = YAML.replace('{call: "{toggle}"', '{call: "/{team}/toggle"')
    (folder / "assignment.yaml").write_text(text, encoding="utf-8")
    loaded, record = load_assignment(folder), submission("group7_gp2", "7up_maps")
    (why,) = with_chosen_names(loaded, record).unnamed
    assert "'/7up/toggle' is not a ROS topic name" in why.finding.observed


STAND_IN = """\
rosgrade: 1
id: stand_in
title: Publish
packages: [{name: bot_publisher, executables: [bot_pub]}]
scenarios: [{id: main, launch: [{executable: bot_pub}], timeout: 5 s}]
checks:
  - {id: package, uses: package.found, with: {package: bot_publisher, remap: true}, points: 1}
  - id: builds
    uses: package.builds
    with: {package: bot_publisher}
    requires: [package]
    points: 1
  - id: executable
    uses: package.executable
    with: {package: bot_publisher, executable: bot_pub, remap: true}
    requires: [builds]
    points: 1
  - {id: starts, uses: node.starts, requires: [executable], points: 1}
"""


def stand_in(tmp_path: Path, **facts: Any) -> tuple[Grade, SubmissionRecord]:
    """The grade of a package with a wrong name that was built, before any run."""
    folder = tmp_path / "stand_in"
    folder.mkdir()
    (folder / "assignment.yaml").write_text(STAND_IN, encoding="utf-8")
    loaded = load_assignment(folder)
    package = PackageRecord(**{"name": "bot_publish", "path": "bot_publish", **facts})
    record = dataclasses.replace(submission(), packages=(package,))
    return judge_all(loaded, record, {}), with_chosen_names(loaded, record).submission


@pytest.mark.parametrize(
    "facts",
    [
        {"executables": ("bot_pub",)},
        {"name": "week3", "executables": ("bot_pub",)},
        # setup.cfg says the right name.
        {"misplaced_executables": ("lib/bot_publisher/bot_pub",)},
    ],
)
def test_a_package_with_a_wrong_name_costs_the_points_of_its_own_check(
    tmp_path: Path, facts: dict[str, Any]
) -> None:
    graded, record = stand_in(tmp_path, **facts)
    package = graded.result("package")
    assert (package.status, package.put_right) == (Status.FAILED, True)
    assert record.packages[0].name in package.decisive.finding.observed
    assert graded.result("builds").status is Status.PASSED
    assert graded.result("executable").status is Status.PASSED
    names = record.names
    assert graded.names == {"main": names} and names
    run = dataclasses.replace(recording(), scenario="main", submission=record, names=names)
    graded = judge_all(load_assignment(tmp_path / "stand_in"), record, {"main": run})
    assert graded.result("starts").status is not Status.SKIPPED


def test_another_package_does_not_stand_in_for_the_one_that_is_asked_for(tmp_path: Path) -> None:
    graded, record = stand_in(tmp_path, name="notes", executables=("talker",))
    assert not record.names
    assert graded.result("builds").status is Status.SKIPPED


def test_a_setup_cfg_that_names_another_package_costs_the_points_of_the_executable(
    tmp_path: Path,
) -> None:
    wrong = {"name": "bot_publisher", "misplaced_executables": ("lib/my_package/bot_pub",)}
    graded, _ = stand_in(tmp_path, **wrong)
    finding = graded.result("executable").decisive.finding
    assert "lib/my_package/, where `ros2 run` does not look" in finding.observed
    assert [str(one) for one in finding.names.wrong] == [
        "lib/my_package/bot_pub:=lib/bot_publisher/bot_pub"
    ]


OTHER_INTERFACE = """\
rosgrade: 1
id: other_interface
title: Publish
packages:
  - {name: bot, executables: [bot]}
  - {name: bot_msgs, build_type: ament_cmake}
scenarios:
  - id: main
    launch: [{package: bot, executable: bot}]
    record: [{topic: /status, type: bot_msgs/msg/Status}]
    timeout: 5 s
checks:
  - {id: package, uses: package.found, with: {package: bot_msgs, remap: true}, points: 1}
  - id: found
    uses: interface.found
    with: {interface: bot_msgs/msg/Status, remap: true}
    points: 1
  - id: fields
    uses: interface.fields
    with: {interface: bot_msgs/msg/Status, definition: uint8 on}
    points: 1
    requires: [found]
  - id: type
    uses: topic.type
    with: {topic: /status, type: bot_msgs/msg/Status}
    points: 1
"""


@pytest.mark.parametrize(
    ("package", "interface", "lost"),
    [
        ("bot_msgs", "State", {"found"}),
        ("bot_msg", "Status", {"package"}),
        ("bot_msg", "State", {"package", "found"}),
    ],
)
def test_an_interface_under_another_name_is_used_instead_and_costs_its_own_check(
    tmp_path: Path, package: str, interface: str, lost: set[str]
) -> None:
    folder = tmp_path / "other_interface"
    own = folder / "interfaces" / "bot_msgs"
    (own / "msg").mkdir(parents=True)
    (own / "msg" / "Status.msg").write_text("uint8 on\n", encoding="utf-8")
    (own / "package.xml").write_text("<name>bot_msgs</name>", encoding="utf-8")
    (own / "CMakeLists.txt").write_text("project(bot_msgs)\n# msg/Status.msg", encoding="utf-8")
    (folder / "assignment.yaml").write_text(OTHER_INTERFACE, encoding="utf-8")
    loaded = load_assignment(folder)
    definition = Definition(f"{package}/msg/{interface}.msg", "uint8 on\n")
    record = dataclasses.replace(
        submission("bot"),
        packages=(
            PackageRecord("bot", "bot"),
            PackageRecord(package, package, "ament_cmake", definitions=(definition,)),
        ),
    )
    named = with_chosen_names(loaded, record)
    found, record = named.loaded, named.submission
    type_ = f"{package}/msg/{interface}"
    assert found.assignment.scenarios[0].record[0].type == type_
    run = dataclasses.replace(recording(), scenario="main", submission=record, names=record.names)
    graded = judge_all(loaded, record, {"main": run})
    assert {one.id for one in graded.results if one.put_right} == lost
    assert graded.result("fields").status is Status.PASSED
    assert type_ in graded.result("type").decisive.finding.expected
    write_interfaces(folder, found.values, tmp_path / "made")
    made = tmp_path / "made" / package
    assert (made / "msg" / f"{interface}.msg").read_text() == "uint8 on\n"
    assert (made / "CMakeLists.txt").read_text() == f"project({package})\n# msg/{interface}.msg"
