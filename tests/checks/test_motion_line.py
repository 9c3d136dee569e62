"""motion.follows_line, on runs of the real simulator core."""

import math
from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.measure.motion.floor_line import followed_m, length_m
from grader.recording.simulated import Truth
from tests.checks.builder import deaf, drive, failing, judge, on_timer

BEND = "lines: [{points: [[0, 0], [0.6, 0], [0.6, 0.6]]}]"


def along(turn_at_m=0.55, until_m=0.5, world=BEND):
    """Straight ahead, a quarter turn on the spot, and straight ahead again; then rests."""

    def law(pose):
        if pose.x_m < turn_at_m and pose.yaw_rad < 0.1:
            return 0.2, 0.0
        if pose.yaw_rad < math.pi / 2 - 0.05:
            return 0.0, 0.5
        return (0.2 if pose.y_m < until_m else 0.0), 0.0

    return drive(on_timer(0.05, law), seconds=20.0, rest_s=1.0, world=world)


def test_a_robot_that_stays_near_the_line_to_its_end_passes():
    finding = judge("motion.follows_line", along(until_m=0.57), distance="8 cm")
    assert finding.status is Status.PASSED
    assert finding.expected == "stays within 8 cm of the line on the floor, along 95 % of it"
    assert "of 1.2 m" in finding.observed
    [plot] = finding.evidence.plots
    assert plot.band == (0.0, 0.08)


def test_a_robot_that_goes_straight_on_in_the_bend_left_the_line():
    found = failing("motion.follows_line", along(turn_at_m=0.9), distance="8 cm")
    assert "it left the line after 0.6 m of 1.2 m" in found
    assert "angular.z is positive" in found


def test_a_robot_that_stops_in_the_middle_did_not_follow_it_to_the_end():
    found = failing("motion.follows_line", along(until_m=0.1), distance="8 cm")
    assert "of 1.2 m" in found
    assert "does the node still find the line" in found
    half = judge("motion.follows_line", along(until_m=0.1), distance="8 cm", share="50 %")
    assert half.status is Status.PASSED


def test_a_robot_that_drives_backwards_does_not_come_along_the_line():
    run = drive(on_timer(0.05, lambda _: (-0.2, 0.0)), seconds=3.0, world=BEND)
    failing("motion.follows_line", run)


def test_a_command_that_ros_misreads_is_why_the_robot_does_not_turn():
    run = drive(on_timer(0.05, lambda _: (0.2, 1.584e-314)), seconds=5.0, world=BEND)
    found = failing("motion.follows_line", run)
    assert "`angular.z` is a float field" in found
    assert "numpy.float32" in found


def test_a_subscription_that_gets_nothing_is_why_the_robot_does_not_turn():
    run = drive(on_timer(0.05, lambda _: (0.2, 0.0)), seconds=5.0, world=BEND)
    camera = deaf("/camera/image_raw", "sensor_msgs/msg/Image")
    found = failing("motion.follows_line", replace(run, endpoints=camera))
    assert "QoS does not match the publisher on `/camera/image_raw`" in found


def test_a_line_that_the_world_does_not_have_is_no_fault_of_the_student():
    finding = judge("motion.follows_line", along(), line=1)
    assert finding.status is Status.ERROR
    assert "has no line 1: it has 1" in finding.observed


def places(*points):
    return [Truth(number, x, y, *[0.0] * 5) for number, (x, y) in enumerate(points)]


def test_what_it_does_after_the_end_of_the_line_does_not_count():
    finding = judge("motion.follows_line", along(until_m=1.2), distance="8 cm")
    assert finding.status is Status.PASSED


def furthest(line, truth):
    return max(followed_m(line, truth, 0.05))


def test_where_a_line_crosses_itself_nothing_of_it_is_skipped():
    eight = [(0, 0), (1, 0), (1, 1), (0.5, 1), (0.5, -1)]
    assert length_m(eight) == pytest.approx(4.5)
    # From the crossing at (0.5, 0) straight down, without the loop.
    short = [(0.1 * i, 0) for i in range(6)] + [(0.5, -0.1 * i) for i in range(10)]
    assert furthest(eight, places(*short)) == pytest.approx(0.5, abs=0.06)


def test_a_circuit_begins_at_its_first_point():
    ring = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]
    assert furthest(ring, places((0, 0))) == 0.0
    way = [(0.1 * i, 0) for i in range(10)]
    assert furthest(ring, places(*way)) == pytest.approx(0.9)
