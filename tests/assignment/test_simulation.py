"""Scenarios with a simulated robot: what can be caught without running is caught."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from grader.assignment.load import load_assignment
from grader.assignment.model import Scenario
from grader.assignment.random_values import draw_values, fill_in, world_values
from grader.errors import AssignmentError, UsageError
from grader.report.drawing.path import targets
from sim.world import parse_world

YAML = """\
rosgrade: 1
id: lesson
title: Test
packages: [{name: bot, executables: [bot]}]
scenarios:
  - id: run
    world: world.yaml
    random: {x: [1 m, 2 m]}
    launch: [{executable: bot, parameters: {goal: $x}}]
    timeout: 5 s
checks:
  - {id: alive, uses: node.alive, points: 1}
  - {id: sent, uses: messages.count, with: {topic: /cmd_vel, at_least: 1}, points: 1}
"""
WORLD = "values: {x: 1}\nsegments:\n  - [$x, -1, $x, 1]\n"


def lesson(folder: Path, yaml: str = YAML, world: str | None = WORLD) -> Path:
    place = folder / "lesson"
    place.mkdir()
    (place / "assignment.yaml").write_text(yaml, encoding="utf-8")
    if world is not None:
        (place / "world.yaml").write_text(world, encoding="utf-8")
    return place


def refused(folder: Path, yaml: str = YAML, world: str | None = WORLD) -> str:
    with pytest.raises(AssignmentError) as caught:
        load_assignment(lesson(folder, yaml, world))
    return str(caught.value)


def test_the_topics_of_the_robot_are_recorded_without_being_named(tmp_path: Path) -> None:
    loaded = load_assignment(lesson(tmp_path))
    assert loaded.assignment.scenarios[0].recorded_types == {
        "/cmd_vel": "geometry_msgs/msg/Twist",
        "/odom": "nav_msgs/msg/Odometry",
        "/scan": "sensor_msgs/msg/LaserScan",
    }


def with_transforms(options: str, *checks: str, record: str = "[]") -> str:
    """The assignment with ``topics: {tf: ...}`` and more checks."""
    found = YAML.replace(
        "    timeout", f"    topics: {{tf: {options}}}\n    record: {record}\n    timeout"
    )
    return found + "".join(
        f"  - {{id: more_{number}, uses: {text}, points: 1}}\n"
        for number, text in enumerate(checks)
    )


def test_transforms_of_the_robot_are_recorded_where_a_scenario_names_them(tmp_path: Path) -> None:
    tree = "tf.tree, with: {root: odom, frames: [base_scan]}"
    yaml = with_transforms("{enabled: true}", tree)
    [scenario] = load_assignment(lesson(tmp_path, yaml)).assignment.scenarios
    assert scenario.transform_topics == {"/tf": "volatile", "/tf_static": "transient_local"}
    assert scenario.recorded_types["/tf_static"] == "tf2_msgs/msg/TFMessage"


def test_checks_of_transforms_need_their_topics_a_pose_and_names_without_a_slash(
    tmp_path: Path,
) -> None:
    edge = "parent: odom, child: base_footprint"
    yaml = with_transforms(
        "{enabled: false}",
        f"tf.broadcast, with: {{{edge}, rate: 30 Hz}}",
        f"tf.follows, with: {{{edge}, source: /pose}}",
        "tf.static, with: {parent: /base_link, child: laser, rpy: [0, 0, 90]}",
    )
    told = refused(tmp_path, yaml)
    assert "does not record '/tf'" in told
    assert "does not record '/pose'" in told
    assert "'/base_link' is not the name of a frame" in told
    assert "90 has no unit" in told


def test_what_the_robot_publishes_itself_is_not_asked_of_a_student(tmp_path: Path) -> None:
    topics = "[{topic: /tf, type: tf2_msgs/msg/TFMessage}]"
    edge = "parent: odom, child: base_footprint"
    yaml = with_transforms("{}", f"tf.broadcast, with: {{{edge}, rate: 30 Hz}}", record=topics)
    assert "publishes this transform itself: write 'topics: {tf:" in refused(tmp_path, yaml)


def test_the_author_s_transforms_stand_beside_those_of_the_robot_and_are_no_student_s(
    tmp_path: Path,
) -> None:
    sent = """    stimuli:
      - publish: /tf_static
        type: tf2_msgs/msg/TFMessage
        durability: transient_local
        message: {transforms: [{header: {frame_id: map}, child_frame_id: odom}]}
    timeout"""
    tree = "tf.tree, with: {root: map, frames: [odom, base_scan]}"
    yaml = with_transforms("{enabled: true}", tree).replace("    timeout", sent)
    [scenario] = load_assignment(lesson(tmp_path, yaml)).assignment.scenarios
    assert set(scenario.stimuli[0].frames) == {("map", "odom")}
    (tmp_path / "asked").mkdir()
    asked = "tf.static, with: {parent: map, child: odom, position: [0, 0, 0]}"
    yaml = with_transforms("{enabled: true}", asked).replace("    timeout", sent)
    assert "a stimulus of the scenario 'run' publishes this transform itself" in refused(
        tmp_path / "asked", yaml
    )


def test_without_a_world_a_transform_needs_a_topic_to_follow(tmp_path: Path) -> None:
    topics = "[{topic: /tf, type: tf2_msgs/msg/TFMessage}]"
    edge = "parent: odom, child: base_footprint"
    yaml = with_transforms("{}", f"tf.follows, with: {{{edge}}}", record=topics)
    yaml = yaml.replace("    world: world.yaml\n", "").replace("    topics: {tf: {}}\n", "")
    assert "has no 'world', and so no simulated robot" in refused(tmp_path, yaml)


def test_a_world_that_is_not_there_is_named_with_the_line_of_the_scenario(tmp_path: Path) -> None:
    told = refused(tmp_path, world=None)
    assert "assignment.yaml:7: scenarios[0].world: " in told
    assert "world.yaml: No such file" in told


def test_a_mistake_in_the_world_is_named_with_its_own_line(tmp_path: Path) -> None:
    told = refused(tmp_path, world="values: {x: 1}\ncircles:\n  - {centre: [1, 1], radius: -1 m}\n")
    assert "world.yaml:3: circles[0].radius" in told


def test_a_robot_that_may_start_inside_a_wall_is_refused(tmp_path: Path) -> None:
    yaml = YAML.replace("[1 m, 2 m]", "[-1 m, 1 m]").replace("x: [", "x: [", 1)
    world = "values: {x: 1}\nboxes:\n  - {centre: [$x, 0], size: [1, 1]}\n"
    told = refused(tmp_path, yaml, world)
    assert "a robot with radius 0.1 m cannot be at (0, 0)" in told
    assert "with x = " in told


def test_a_parameter_with_an_unknown_value_names_the_nearest(tmp_path: Path) -> None:
    told = refused(tmp_path, YAML.replace("goal: $x", "goal: $xx").replace("{x: [", "{xxx: ["))
    assert "assignment.yaml:9: " in told
    assert "there is no value 'xx'. Did you mean 'xxx'?" in told


def a_scenario(**changes: object) -> Scenario:
    return Scenario.model_validate(
        {"id": "run", "launch": [{"executable": "bot"}], "timeout": "5 s", **changes}
    )


def test_values_are_drawn_from_the_seed_and_within_bounds() -> None:
    scenario = a_scenario(random={"x": ["-2 m", "2 m"], "turn": ["10 deg", "20 deg"]})
    drawn = [draw_values(scenario, seed) for seed in range(200)]
    assert drawn == [draw_values(scenario, seed) for seed in range(200)]
    assert all(-2.0 <= values["x"] <= 2.0 for values in drawn)
    assert all(0.174 <= values["turn"] <= 0.35 for values in drawn)
    assert len({values["x"] for values in drawn}) > 150


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("$x", 1.5),
        ("180 deg", pytest.approx(3.14159, abs=1e-4)),
        ("20 cm", pytest.approx(0.2)),
        ("burger", "burger"),
        ("3 apples", "3 apples"),
        ("1.5", "1.5"),
        (True, True),
        ([1, "$x"], [1, 1.5]),
    ],
)
def test_parameters_are_filled_in(written: object, value: object) -> None:
    assert fill_in(written, {"x": 1.5}) == value


def test_a_value_that_was_not_drawn_is_refused() -> None:
    with pytest.raises(UsageError, match="there is no value 'y'"):
        fill_in("$y", {"x": 1.0})


@pytest.mark.parametrize(
    ("bounds", "said"),
    [
        (["1 m", "2 deg"], "have different units"),
        (["2 m", "1 m"], "is above the highest"),
        (["1 m"], "written as"),
        (["1 furlong", "2 furlong"], "unknown unit 'furlong'"),
    ],
)
def test_bounds_that_make_no_sense_are_refused(bounds: list[str], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        a_scenario(random={"x": bounds})


def test_fixed_values_are_the_same_numbers_in_every_run() -> None:
    values = {"turn": "90 deg", "wall": "60 cm", "legs": 3}
    scenario = a_scenario(values=values, random={"x": ["1 m", "2 m"]})
    first, second = (draw_values(scenario, seed) for seed in (1, 2))
    assert first.pop("x") != second.pop("x")
    assert first == second == {"turn": math.pi / 2, "wall": 0.6, "legs": 3}
    assert world_values(scenario, first)["wall"] == "0.6 m"
    assert repr(fill_in("$legs", first)) == "3"


def test_a_share_in_percent_reaches_the_world_as_it_is() -> None:
    scenario = a_scenario(values={"dim": "40 %"}, random={"light": ["120 %", "130 %"]})
    values = draw_values(scenario, 1)
    assert world_values(scenario, values)["dim"] == "40.0 %"
    drawn = world_values(scenario, values)["light"]
    assert 120.0 <= float(drawn.removesuffix(" %")) <= 130.0
    world = "values: {light: 100 %}\nlight: $light"
    assert parse_world(world, values={"light": drawn}).light == pytest.approx(values["light"])


def test_a_camera_needs_a_world_and_is_recorded_only_where_a_scenario_names_it(
    tmp_path: Path,
) -> None:
    yaml = YAML.replace("    timeout", "    camera: {topic: /eye}\n    timeout")
    [scenario] = load_assignment(lesson(tmp_path, yaml)).assignment.scenarios
    assert scenario.camera_topics == {"/eye", "/eye/compressed", "/camera/camera_info"}
    assert not scenario.camera_topics & scenario.recorded_types.keys()
    (tmp_path / "other").mkdir()
    told = refused(tmp_path / "other", yaml.replace("    world: world.yaml\n", ""))
    assert "scenarios[0].camera: a simulated robot needs a 'world', which is missing" in told


FIXED = YAML.replace("random: {x: [1 m, 2 m]}", "values: {x: 1.5 m}")
REACHES = "  - {id: there, uses: motion.reaches, with: {goal: %s, position: 5 cm}, points: 1}\n"


def test_a_fixed_value_stands_in_world_launch_and_checks(tmp_path: Path) -> None:
    loaded = load_assignment(lesson(tmp_path, FIXED + REACHES % "[x, 0, 0 deg]"))
    [scenario] = loaded.assignment.scenarios
    assert fill_in(scenario.launch[0].parameters["goal"], draw_values(scenario, 1)) == 1.5
    [there] = targets(loaded.assignment, "run", {})
    assert there.pose.x_m == 1.5


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "values: {x: 1.5 m}",
            "values: {x: 1.5 furlong}",
            "8: scenarios[0].values.x: unknown unit 'furlong' in '1.5 furlong'",
        ),
        (
            "values: {x: 1.5 m}",
            "random: {x: 1.5 m}",
            "8: scenarios[0].random.x: a random value is written as [lowest, highest]; one that is "
            "the same in every run stands under 'values'",
        ),
        (
            "values: {x: 1.5 m}",
            "values: {x: 1.5 m}\n    random: {x: [1 m, 2 m]}",
            "8: scenarios[0].values.x: 'x' is a random value too: leave one of them out",
        ),
        (
            "goal: [x, 0",
            "goal: [y, 0",
            "14: checks[2].with.goal: the scenario 'run' has no value 'y'. It has: x.",
        ),
    ],
)
def test_values_that_make_no_sense_are_refused(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    yaml = FIXED + REACHES % "[x, 0, 0 deg]"
    assert yaml.count(old) == 1
    assert f"assignment.yaml:{said}" in refused(tmp_path, yaml.replace(old, new))


PAIR = YAML.replace("topic: /cmd", "topic: /tb1/cmd").replace(
    "    timeout", "    robots: {tb1: {}, tb2: {pose: [-1, 0, 0 deg]}}\n    timeout"
)
STOPS = "  - {id: stops, uses: motion.no_contact, points: 1ROBOT}\n"


def test_the_topics_of_several_robots_begin_with_their_names(tmp_path: Path) -> None:
    yaml = PAIR + STOPS.replace("ROBOT", ", robot: tb2")
    loaded = load_assignment(lesson(tmp_path, yaml))
    assert [*loaded.assignment.scenarios[0].recorded_types] == [
        *("/tb1/cmd_vel", "/tb1/odom", "/tb1/scan"),
        *("/tb2/cmd_vel", "/tb2/odom", "/tb2/scan"),
    ]
    assert loaded.checks[-1].title.endswith("(tb2)")


@pytest.mark.parametrize(
    ("robot", "reason"),
    [
        ("", "has several robots: say which 'robot' it judges (tb1, tb2)"),
        (", robot: tb3", "'run' has no robot 'tb3'. Did you mean 'tb2'?"),
    ],
)
def test_a_check_of_motion_says_which_of_several_robots(
    tmp_path: Path, robot: str, reason: str
) -> None:
    assert reason in refused(tmp_path, PAIR + STOPS.replace("ROBOT", robot))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("robots: {", "robot: {}\n    robots: {", "give either one 'robot' or several 'robots'"),
        ("pose: [-1, 0, 0 deg]", "pose: [0.1, 0, 0 deg]", "robots[tb2]"),
        ("    world: world.yaml\n", "", "a simulated robot needs a 'world'"),
        ("tb2", "2nd", "'2nd' is not a node name"),
    ],
)
def test_robots_that_cannot_be_are_refused(tmp_path: Path, old: str, new: str, reason: str) -> None:
    assert reason in refused(tmp_path, PAIR.replace(old, new))


POND = "turtles: [{name: turtle1}, {name: bob, pose: [1, 2, 0 deg]}]\n"


def test_a_world_with_turtles_has_their_topics_and_no_robot(tmp_path: Path) -> None:
    yaml = YAML.replace("/cmd_vel", "/bob/cmd_vel")
    (scenario,) = load_assignment(lesson(tmp_path, yaml, POND)).assignment.scenarios
    assert scenario.turtles == ("turtle1", "bob")
    assert scenario.recorded_types == {
        "/turtle1/cmd_vel": "geometry_msgs/msg/Twist",
        "/bob/cmd_vel": "geometry_msgs/msg/Twist",
    }
    assert scenario.simulated_robots == {}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("    timeout", "    lidar: {beams: 90}\n    timeout"), "is not in a world with turtles"),
        (
            ("node.alive", "motion.no_contact"),
            "the scenario 'run' has turtles in its world, and so no simulated robot",
        ),
    ],
)
def test_what_needs_a_robot_is_refused_in_a_world_with_turtles(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    yaml = YAML.replace("/cmd_vel", "/bob/cmd_vel").replace(*change)
    assert message in refused(tmp_path, yaml, POND)


def test_what_needs_turtles_is_refused_in_a_world_of_a_robot(tmp_path: Path) -> None:
    yaml = YAML.replace("uses: node.alive", "uses: turtle.closes")
    assert "assignment.yaml:12: checks[0].uses: the scenario 'run' has no 'world' with turtles" in (
        refused(tmp_path, yaml)
    )


def test_turtles_serve_what_a_contract_lets_a_node_call(tmp_path: Path) -> None:
    more = "  - {id: asks, uses: client.asks, with: {server: /bob/set_pen}, points: 1}\n"
    yaml = YAML.replace("/cmd_vel", "/bob/cmd_vel") + more
    assert load_assignment(lesson(tmp_path, yaml, POND))
    (tmp_path / "lesson" / "assignment.yaml").write_text(yaml.replace("/bob/set_pen", "/amy/x"))
    with pytest.raises(AssignmentError, match="serves '/amy/x'"):
        load_assignment(tmp_path / "lesson")
