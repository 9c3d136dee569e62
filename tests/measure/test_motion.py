"""What the checks of motion are made of: parameters, geometry, laws, and topics left alone."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from grader.findings.finding import Status
from grader.findings.reference import (
    Goal,
    GoalPose,
    UnknownValue,
)
from grader.findings.words import degrees, metres, point, side, speed
from grader.measure.motion.ground import ahead, nearest
from grader.recording.model import NS, Kind
from grader.recording.simulated import Scene, Truth
from sim.motion import ORIGIN, Pose
from sim.shapes import MovingObstacle, Waypoint
from tests.checks.builder import (
    at,
    endpoint,
    failing,
    judge,
    node,
    nodeless,
    recording,
)


class Form(BaseModel):
    goal: GoalPose


def read(goal, **fields):
    return Form.model_validate({"goal": goal, **fields})


class TestReferences:
    def test_numbers_with_and_without_units(self):
        assert read([1.2, "30 cm", "90 deg"]).goal == Goal(1.2, 0.3, math.pi / 2)

    def test_names_stand_for_the_values_of_the_run(self):
        form = read(["goal_x", 0, "goal_theta"])
        pose = form.goal.pose({"goal_x": 0.5, "goal_theta": 4.0})
        assert (pose.x_m, pose.y_m) == (0.5, 0.0)
        assert math.isclose(pose.yaw_rad, 4.0 - math.tau)

    def test_an_unknown_name_is_refused(self):
        with pytest.raises(UnknownValue, match=r"no value 'goal_z'\. Did you mean 'goal_x'"):
            Goal("goal_z", 0.0, 0.0).pose({"goal_x": 1.0})
        with pytest.raises(UnknownValue, match="It has none"):
            Goal("goal_z", 0.0, 0.0).pose({})

    @pytest.mark.parametrize(
        ("goal", "message"),
        [
            ([1, 2], r"expected \[x, y, theta\]"),
            ("goal", r"expected \[x, y, theta\]"),
            ([1, 2, 1.5], "theta: .*has no unit"),
            ([1, "2 s", "1 rad"], "y: .*unit of time"),
            (["$goal_x", 0, 0], "x: .*write 'goal_x'"),
        ],
    )
    def test_what_is_neither_number_nor_name_is_refused(self, goal, message):
        with pytest.raises(ValidationError, match=message):
            read(goal)

    def test_written_as_it_is_read(self):
        form = read(["goal_x", 0.25, "1 rad"], far="2 m", turned="turned")
        assert Form.model_validate_json(form.model_dump_json()) == form


def scene(outlines, moving=(), lidar=ORIGIN):
    return Scene(0.1, 0.22, 2.84, outlines, moving, at(0), lidar)


def standing(x=0.0, y=0.0, yaw=0.0, time_s=0.0):
    return Truth(at(time_s), x, y, yaw, 0.0, 0.0, 0.0, 0.0)


class TestGround:
    @given(
        distance=st.floats(0.2, 3.0),
        yaw=st.floats(-math.pi, math.pi),
        slant=st.floats(-1.0, 1.0),
        x=st.floats(-5, 5),
        y=st.floats(-5, 5),
    )
    def test_a_wall_in_any_direction(self, distance, yaw, slant, x, y):
        fx, fy = x + distance * math.cos(yaw), y + distance * math.sin(yaw)
        wx, wy = -math.sin(yaw + slant), math.cos(yaw + slant)
        wall = (fx - wx, fy - wy, fx + wx, fy + wy, 0.0)
        sight = ahead(scene({"wall": (wall,)}), standing(x, y, yaw))
        assert sight is not None
        assert math.isclose(sight.distance_m, distance, abs_tol=1e-9)

    @given(distance=st.floats(0.5, 3.0), aside=st.floats(-0.4, 0.4))
    def test_a_pillar_is_as_near_as_its_side(self, distance, aside):
        sight = ahead(scene({"p": ((distance, aside, distance, aside, 0.2),)}), standing())
        if abs(aside) > 0.2:
            assert sight is None
        else:
            assert sight is not None
            half_m = math.sqrt(max(0.0, 0.04 - aside**2))
            assert math.isclose(sight.distance_m, distance - half_m, abs_tol=1e-8)

    def test_what_is_behind_is_not_ahead(self):
        world = scene({"wall": ((-1.0, -1.0, -1.0, 1.0, 0.0),)})
        assert ahead(world, standing()) is None
        near = nearest(world, standing())
        assert near is not None and near.distance_m == 1.0
        assert side(near.bearing_rad) == "behind it"

    def test_what_moves_is_where_it_was_then(self):
        path = (
            Waypoint(200_000_000, Pose(1.0, 0.0, 0.0)), Waypoint(300_000_000, Pose(1.2, 0.0, 0.0))
        )  # fmt: skip
        pillar = MovingObstacle("m", path, radius_m=0.1, appears_ns=200_000_000)
        world = scene({}, (pillar,))
        assert ahead(world, standing(time_s=0.19)) is None
        found = [ahead(world, standing(time_s=time)) for time in (0.2, 0.25, 0.3)]
        assert [sight and round(sight.distance_m, 6) for sight in found] == [0.9, 1.0, 1.1]

    def test_a_moving_box_is_a_box(self):
        """A circle around 0.2 m x 1 m would reach 0.51 m; its near side is 0.1 m from its middle.

        Turned by a quarter its ends lie ahead and behind, and it is 0.2 m wide.
        """
        path = (
            Waypoint(0, Pose(1.0, 0.0, 0.0)), Waypoint(NS, Pose(1.0, 0.0, math.pi / 2)),
            Waypoint(2 * NS, Pose(1.0, 0.3, math.pi / 2)),
        )  # fmt: skip
        world = scene({}, (MovingObstacle("m", path, size_m=(0.2, 1.0)),))
        before, turned, aside = (ahead(world, standing(time_s=time)) for time in (0, 1, 2))
        assert before is not None and math.isclose(before.distance_m, 0.9)
        assert turned is not None and math.isclose(turned.distance_m, 0.5)
        assert aside is None
        near = nearest(world, standing(time_s=2))
        assert near is not None and math.isclose(near.distance_m, math.hypot(0.5, 0.2))

    def test_from_the_lidar_along_the_robot_s_heading(self):
        """The LiDAR sits 5 cm ahead and is turned to the left, as the robot is in the world."""
        lidar = Pose(0.05, 0.0, math.pi / 2)
        world = scene({"wall": ((0.0, 1.0, 2.0, 1.0, 0.0),)}, lidar=lidar)
        sight = ahead(world, standing(1.0, 0.0, math.pi / 2))
        assert sight is not None and math.isclose(sight.distance_m, 0.95)


class TestUntouched:
    def test_a_publisher_on_a_topic_of_the_robot(self):
        forger = endpoint("/odom", type="nav_msgs/msg/Odometry")
        run = recording(endpoints=(*recording().endpoints, forger))
        said = failing("topic.untouched", run)
        assert "the node `/bot_publisher` publishes on `/odom`" in said
        assert judge("topic.untouched", run, topics=["/scan"]).status is Status.PASSED

    def test_the_name_of_the_probe(self):
        run = recording(nodes=(node(), node("/a/rosgrade_probe")))
        assert "`/a/rosgrade_probe`" in failing("topic.untouched", run)

    def test_a_run_without_a_node_fails(self):
        failing("topic.untouched", nodeless())


class TestNotSubscribed:
    def test_a_subscription_to_what_is_not_for_the_node_is_named(self):
        reader = endpoint("/scan", kind=Kind.SUBSCRIPTION, type="sensor_msgs/msg/LaserScan")
        run = recording(endpoints=(*recording().endpoints, reader))
        said = failing("topic.not_subscribed", run, topics=["/odom", "/scan"])
        assert "the node `/bot_publisher` subscribes to `/scan`" in said
        assert judge("topic.not_subscribed", run, topics=["/odom"]).status is Status.PASSED

    def test_another_node_may_subscribe_where_one_is_named(self):
        reader = endpoint("/scan", kind=Kind.SUBSCRIPTION, node="/driver")
        run = recording(nodes=(node(), node("/driver")), endpoints=(*recording().endpoints, reader))
        given = {"topics": ["/scan"], "node": "bot_publisher"}
        assert judge("topic.not_subscribed", run, **given).status is Status.PASSED
        failing("topic.not_subscribed", run, topics=["/scan"], node="driver")

    def test_a_run_without_the_node_fails(self):
        failing("topic.not_subscribed", nodeless(), topics=["/scan"])


def test_measures_have_their_units():
    assert [metres(x) for x in (1.234, 0.2, 0.032, 0.0004, 0.0)] == [
        "1.23 m",
        "0.2 m",
        "3.2 cm",
        "0.4 mm",
        "0 m",
    ]
    assert (degrees(math.pi), degrees(0.05), speed(0.1)) == ("180°", "2.9°", "0.1 m/s")
    assert point(-0.0, 1.5) == "(0.00, 1.50) m"
