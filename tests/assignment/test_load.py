"""Loading finds everything in an assignment that does not fit together, with its line."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

from grader.assignment.load import (
    find_assignment,
    folder_sha256,
    list_assignments,
    load_assignment,
)
from grader.checks.check import Check
from grader.errors import UsageError
from tests.assignment.lessons import GOOD, HEAD

Write = Callable[..., Path]
Catalogue = Mapping[str, Check]


Found = Callable[[str], list[str]]


@pytest.fixture
def found(mistakes: Callable[..., list[str]], catalogue: Catalogue) -> Found:
    """Load an assignment that uses the small catalogue."""
    return lambda yaml: mistakes(yaml, catalogue)


def test_a_loaded_assignment_has_its_checks_bound(write: Write, catalogue: Catalogue) -> None:
    folder = write(
        HEAD
        + "  - {id: period, uses: timing.period, points: 2, "
        + "with: {topic: /cmd_vel, period: 300 ms}}\n"
    )
    loaded = load_assignment(folder, catalogue)
    (bound,) = loaded.checks
    assert loaded.folder == folder
    assert bound.check is catalogue["timing.period"]
    assert bound.parameters.period == pytest.approx(0.3)
    assert bound.title == "Something is right"
    assert [scenario.id for scenario in loaded.scenarios_of(bound)] == ["run"]
    with pytest.raises(FrozenInstanceError):
        loaded.sha256 = ""  # type: ignore[misc]


@pytest.mark.parametrize(
    ("check", "said"),
    [
        (
            "{id: a, points: 1}",
            "checks[0]: give either 'uses', a check of the catalogue, or 'python', your own",
        ),
        (
            "{id: a, points: 1, uses: node.alive, python: 'checks.py:mine'}",
            "checks[0]: give either 'uses', a check of the catalogue, or 'python', your own",
        ),
        (
            "{id: a, points: 1, uses: node.alife}",
            "checks[0].uses: there is no check 'node.alife'. Did you mean 'node.alive'?",
        ),
        (
            "{id: a, points: 1, uses: timing.period, with: {topic: /cmd_vel}}",
            "checks[0].with: the key 'period' is missing",
        ),
        (
            "{id: a, points: 1, uses: node.alive, with: {name: bot}}",
            "checks[0].with.name: unknown key 'name'. Allowed here: none.",
        ),
        (
            "{id: a, points: 1, uses: node.alive, requires: [b]}",
            "checks[0].requires[0]: there is no check 'b'. The checks are: a.",
        ),
        (
            "{id: a, points: 1, uses: node.alive, requires: [a]}",
            "checks[0].requires: never judged, because it requires itself: a -> a",
        ),
        (
            "{id: a, points: 1, uses: node.alive, scenarios: [runs]}",
            "checks[0].scenarios[0]: there is no scenario 'runs'. Did you mean 'run'?",
        ),
        (
            "{id: a, points: 1, uses: package.builds, with: {package: bot}, scenarios: [run]}",
            "checks[0].scenarios: 'package.builds' judges what was handed in, not a run: leave "
            "'scenarios' out",
        ),
        (
            "{id: a, points: 1, uses: package.builds, with: {package: bott}}",
            "checks[0].with.package: 'bott' is not among 'packages'. Did you mean 'bot'?",
        ),
        (
            "{id: a, points: 1, uses: package.executable, with: {package: bot, executable: pub}}",
            "checks[0].with.executable: the package 'bot' has no executable 'pub' in 'packages'. "
            "Did you mean 'bot_pub'?",
        ),
        (
            "{id: a, points: 1, uses: messages.count, with: {topic: /cmdvel}}",
            "checks[0].with.topic: the scenario 'run' does not record '/cmdvel'. Did you mean "
            "'/cmd_vel'?",
        ),
        (
            "{id: a, points: 1, uses: topic.type, with: {topic: /cmd_vel, type: a/msg/B}}",
            "checks[0].with.type: the scenario 'run' records '/cmd_vel' as "
            "'geometry_msgs/msg/Twist'",
        ),
    ],
)
def test_a_check_that_does_not_fit_is_reported_with_its_line(
    found: Found, check: str, said: str
) -> None:
    assert found(f"{HEAD}  - {check}\n") == [f"13: {said}"]


def test_what_a_student_subscribes_to_need_not_be_recorded(found: Found) -> None:
    check = "{topic: /odom, type: nav_msgs/msg/Odometry, kind: KIND}"
    text = f"{HEAD}  - {{id: a, points: 1, uses: topic.type, with: {check}}}\n"
    assert not found(text.replace("KIND", "subscription"))
    assert found(text.replace("KIND", "publisher")) == [
        "13: checks[0].with.topic: the scenario 'run' does not record '/odom'. It records: "
        "/cmd_vel."
    ]


def test_names_that_stand_twice_name_the_first(found: Found) -> None:
    text = """\
rosgrade: 1
id: lesson
title: A lesson
packages:
  - {name: bot, executables: [x]}
  - {name: bot}
scenarios:
  - {id: run, launch: [{package: bot, executable: x}], timeout: 1 s}
  - id: run
    launch: [{package: bot, executable: x}]
    timeout: 1 s
    record:
      - {topic: /a, type: a/msg/B}
      - {topic: /a, type: a/msg/B}
checks:
  - {id: a, points: 1, uses: node.alive}
  - {id: b, points: 1, uses: node.alive}
  - {id: a, points: 1, uses: node.alive}
"""
    assert found(text) == [
        "6: packages[1].name: 'bot' stands twice (first in line 5)",
        "9: scenarios[1].id: 'run' stands twice (first in line 8)",
        "14: scenarios[1].record[1].topic: '/a' is recorded twice",
        "18: checks[2].id: 'a' stands twice (first in line 16)",
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "{executable: bot_pub}",
            "{executable: bot_pup}",
            "9: scenarios[0].launch[0].executable: the package 'bot' has no executable 'bot_pup' "
            "in 'packages'. Did you mean 'bot_pub'?",
        ),
        (
            "  - name: bot\n",
            "  - name: other\n  - name: bot\n",
            "10: scenarios[0].launch[0]: the key 'package' is missing: there is not exactly one "
            "package (other, bot)",
        ),
        (
            "{executable: bot_pub}",
            "{executable: bot_pub, after: 1 s}",
            "9: scenarios[0].launch: nothing is started at once: one launch is without 'after'",
        ),
        (
            "[{executable: bot_pub}]",
            "[{executable: bot_pub}, {executable: bot_pub, after: 5 s}]",
            "9: scenarios[0].launch[1].after: the scenario ends after 5 s at the latest",
        ),
    ],
)
def test_a_launch_names_what_is_handed_in(found: Found, old: str, new: str, said: str) -> None:
    assert found(GOOD.replace(old, new)) == [said]


def test_checks_of_all_scenarios_need_the_same_programs_in_each(found: Found) -> None:
    other = "  - {id: other, launch: [{executable: sub}], timeout: 5 s}\nchecks:\n"
    two = GOOD.replace("[bot_pub]", "[bot_pub, sub]").replace("checks:\n", other)
    assert found(two) == [
        "14: checks[0]: name the 'scenarios' that it judges: they launch different programs: "
        "'run' launches 'bot_pub', but 'other' 'sub'"
    ]
    assert found(two.replace("alive, points", "alive, scenarios: [run, other], points")) == []
    assert found(two.replace("[{executable: sub}]", "[{executable: bot_pub}]")) == []
    renamed = two.replace("[{executable: sub}]", "[{executable: bot_pub, namespace: /one}]")
    assert "but 'other' 'bot_pub' (__ns:=/one)" in found(renamed)[0]


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("robot: {pose: [0, 0, 0 deg]}", "robot: a simulated robot needs a 'world'"),
        ("until: {at_rest: 1 s}", "until: 'at_rest' is about the simulated robot: 'world' is"),
        ("until: {any: [{travelled: 1 m}]}", "until: 'travelled' is about the simulated robot:"),
    ],
)
def test_what_is_about_the_robot_needs_a_world(found: Found, key: str, said: str) -> None:
    (told,) = found(GOOD.replace("timeout: 5 s", f"timeout: 5 s\n    {key}"))
    assert told.startswith(f"12: scenarios[0].{said}")


def test_limits_of_the_build_and_libraries_are_reported_with_their_line(found: Found) -> None:
    begin = GOOD.index("scenarios:")
    line = GOOD[:begin].count("\n") + 1
    written = "build_limits: {memory: 3 s, wall_tme: 9 s}\nlibraries: [numpy, scipy==1.2]\n"
    key, unit, library = found(GOOD[:begin] + written + GOOD[begin:])
    assert unit.startswith(f"{line}: build_limits.memory: ")
    assert "a size is needed here" in unit
    assert key.startswith(f"{line}: build_limits.wall_tme: unknown key 'wall_tme'")
    assert "Did you mean 'wall_time'?" in key
    assert library.startswith(
        f"{line + 1}: libraries[1]: 'scipy==1.2' is not the name of a Python library"
    )


def test_manual_items_are_reported_with_their_line(found: Found) -> None:
    line = GOOD.count("\n") + 1
    item = "  - {id: readme, title: README, points: 2, levels: [{title: all, points: 2}]}\n"
    assert found(f"{GOOD}manual:\n{item}") == []
    assert found(f"{GOOD}manual:\n{item}{item}") == [
        f"{line + 2}: manual[1].id: 'readme' stands twice (first in line {line + 1})"
    ]
    (more,) = found(f"{GOOD}manual:\n{item.replace('points: 2}', 'points: 3}')}")
    assert more.startswith(f"{line + 1}: manual[0]: the level 'all' gives 3 points, more than ")
    (nothing,) = found(f"{GOOD}manual:\n{item.replace('points: 2,', 'points: 0,')}")
    assert nothing.startswith(f"{line + 1}: manual[0].points: ")


def test_checks_of_a_run_need_a_scenario(found: Found) -> None:
    start, end = GOOD.index("scenarios:"), GOOD.index("checks:")
    assert found(GOOD[:start] + GOOD[end:]) == [
        "8: checks[0]: 'node.alive' judges a run, but the assignment has no scenarios"
    ]


def test_checks_that_wait_for_each_other_are_reported_once_as_a_circle(found: Found) -> None:
    text = HEAD + "".join(
        f"  - {{id: {name}, points: 1, uses: node.alive, requires: [{required}]}}\n"
        for name, required in [
            ("a", ""),
            ("b", "a, d"),
            ("c", "b"),
            ("d", "c"),
            ("e", "d"),
            ("x", "e"),
        ]
    )
    assert found(text) == [
        "14: checks[1].requires: never judged, because it requires itself: b -> d -> c -> b",
    ]


def test_what_does_not_fit_is_reported_once_the_form_is_right(found: Found) -> None:
    text = HEAD.replace("timeout: 5 s", "timeout: 5") + (
        "  - {id: a, uses: node.alife, points: 1, requires: [q]}\n"
        "  - {id: b, uses: node.alive, point: 1, scenarios: [run]}\n"
    )
    assert found(text) == [
        "11: scenarios[0].timeout: 5 has no unit: write for example '5 s'",
        "14: checks[1].point: unknown key 'point'. Did you mean 'points'?",
    ]
    text = text.replace("timeout: 5", "timeout: 5 s").replace("point:", "points:")
    assert found(text) == [
        "13: checks[0].uses: there is no check 'node.alife'. Did you mean 'node.alive'?",
        "13: checks[0].requires[0]: there is no check 'q'. The checks are: a, b.",
    ]


def test_the_id_is_the_name_of_the_folder(found: Found) -> None:
    assert found(GOOD.replace("id: lesson", "id: other")) == [
        "2: id: 'other' is not the name of its folder, 'lesson'"
    ]


def test_a_file_of_another_name_may_have_any_id(write: Write, catalogue: Catalogue) -> None:
    folder = write()
    draft = folder / "draft.yaml"
    draft.write_text(GOOD.replace("id: lesson", "id: other"))
    loaded = load_assignment(draft, catalogue)
    assert loaded.assignment.id == "other"
    before = loaded.sha256
    (folder / "README.md").write_text("Unrelated to the draft.")
    assert load_assignment(draft, catalogue).sha256 == before


@pytest.fixture
def lesson(write: Write, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The YAML of the only assignment that rosgrade has."""
    file = write() / "assignment.yaml"
    monkeypatch.setattr("grader.machine.resources.assignments", lambda: file.parent.parent)
    return file


def test_an_assignment_is_found_by_id_folder_and_file(
    lesson: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert {find_assignment(name) for name in ("lesson", lesson, lesson.parent)} == {lesson}
    # A submission in a folder called like the assignment does not hide it.
    (tmp_path / "work" / "lesson").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "work")
    assert find_assignment("lesson") == lesson
    monkeypatch.chdir(lesson.parent)
    assert find_assignment(".").resolve() == lesson


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("lessen", "no assignment 'lessen'. Did you mean 'lesson'?"),
        ("no/such/folder", "no/such/folder: no such file or folder"),
        (Path(__file__).parent, "there is no assignment.yaml in it"),
    ],
)
@pytest.mark.usefixtures("lesson")
def test_an_unknown_assignment_names_the_nearest(name: str | Path, said: str) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        find_assignment(name)


def test_only_folders_with_an_assignment_are_listed(lesson: Path) -> None:
    (lesson.parent.parent / "notes").mkdir()
    assert list_assignments() == ("lesson",)


def test_the_hash_tells_every_change_of_the_folder_but_caches(
    write: Write, catalogue: Catalogue
) -> None:
    folder = write()
    first = load_assignment(folder, catalogue).sha256
    assert re.fullmatch(r"[0-9a-f]{64}", first)
    (folder / "__pycache__").mkdir()
    (folder / "__pycache__" / "checks.pyc").write_bytes(b"x")
    (folder / ".swp").write_bytes(b"x")
    assert load_assignment(folder, catalogue).sha256 == first
    (folder / "worlds").mkdir()
    (folder / "worlds" / "a.yaml").write_text("x")
    second = folder_sha256(folder)
    assert second != first
    (folder / "worlds" / "a.yaml").rename(folder / "worlds" / "b.yaml")
    assert folder_sha256(folder) not in (first, second)


def test_the_hash_does_not_look_into_a_report_that_is_being_written(
    write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write()
    first = folder_sha256(folder)
    (folder / "rosgrade-report" / "source" / "bot").mkdir(parents=True)
    scandir = os.scandir

    def scan(path: str | Path = ".") -> object:
        assert "source" not in Path(path).parts
        return scandir(path)

    monkeypatch.setattr(os, "scandir", scan)
    assert folder_sha256(folder) == first


def test_a_companion_is_an_executable_of_a_package_beside_the_yaml(
    mistakes: Callable[..., list[str]],
) -> None:
    told = "[0].companions[0].package: there is no package 'course_nodes' in packages/"
    one = "companions: [{package: course_nodes, executable: light}]"
    found = mistakes(GOOD.replace("    launch:", f"    {one}\n    launch:", 1))
    assert len(found) == 1 and told in found[0]


SIMULATOR = """simulator:
      package: course_sim
      file: world.launch.py
      truth: {topic: /model/pose, type: geometry_msgs/msg/PoseStamped}
      radius: 10 cm
      max_speed: 0.3 m/s
      max_angular_speed: 2 rad/s
"""
OF_ROS = SIMULATOR.replace("course_sim", "ros_gz_sim")
CONTACT = """  - {id: contact, uses: motion.no_contact, points: 1}
  - {id: stops, uses: motion.stops, with: {distance: 50 cm}, points: 1}
  - {id: speed, uses: motion.drives, with: {speed: 0.2 m/s, until_distance: 1 m}, points: 1}
  - {id: turns, uses: motion.stays_at_rest, with: {after: stop}, while: {robot: touches}, points: 1}
"""


def simulated(own: str = SIMULATOR) -> str:
    """The good assignment with a simulator of the author's."""
    return GOOD.replace("    launch:", f"    {own}    launch:", 1)


def test_a_simulator_of_the_author_s_gives_a_robot_to_checks(
    mistakes: Callable[..., list[str]],
) -> None:
    """Its package may also be one of ROS."""
    ended = simulated(OF_ROS).replace("    launch:", "    until: {at_rest: 1 s}\n    launch:", 1)
    assert mistakes(ended + CONTACT.splitlines(keepends=True)[-1].replace("touches", "rests")) == []


def test_checks_of_contact_and_of_distance_need_to_know_both(
    mistakes: Callable[..., list[str]],
) -> None:
    found = mistakes(simulated(OF_ROS) + CONTACT)
    asked = [re.search(r"(checks\S+): .* give it (.*)", one) for one in found]
    assert [one and one.groups() for one in asked] == [
        ("checks[1].uses", "the topic 'contact'"),
        ("checks[2].uses", "a 'map'"),
        ("checks[3].with.until_distance", "a 'map'"),
        ("checks[4].while.robot", "the topic 'contact'"),
    ]


@pytest.mark.parametrize(
    ("own", "told"),
    [
        (SIMULATOR, ".simulator.package: there is no package 'course_sim', not in packages/"),
        (SIMULATOR.replace("package: course_sim", "name: sim"), "'package' is missing"),
        (SIMULATOR + "      after: 1 s\n", ".simulator.after: what is yours is started before"),
        (SIMULATOR + "    world: w.yaml\n", ".simulator: a scenario is simulated once"),
        (SIMULATOR + "    robot: {radius: 1 cm}\n", "is not that of your 'simulator'"),
        (SIMULATOR.replace("PoseStamped", "Twist"), "tf2_msgs/msg/TFMessage"),
        (
            SIMULATOR.replace("geometry_msgs/msg/PoseStamped", "tf2_msgs/msg/TFMessage"),
            "'frame' goes with the type tf2_msgs/msg/TFMessage",
        ),
        (OF_ROS + "      map: none.yaml\n", ".simulator.map: "),
        (
            OF_ROS + "    bag: {}\n",
            ".simulator: ",
        ),
    ],
)
def test_a_simulator_that_does_not_fit_is_told(
    mistakes: Callable[..., list[str]], own: str, told: str
) -> None:
    assert told in "\n".join(mistakes(simulated(own)))
