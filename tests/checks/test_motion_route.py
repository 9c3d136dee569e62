"""motion.visits and motion.keeps_distance, on runs of the real simulator core."""

import math

import pytest

from grader.findings.finding import Status
from tests.checks.builder import drive, failing, judge, on_timer

PLACES = [[0.4, 0], [0.8, 0]]


def route(*stops):
    """Drives straight ahead, and rests for a second at each of some abscissas."""
    left = list(stops)
    rested = [0]

    def law(pose):
        if left and pose.x_m >= left[0] - 0.01:
            rested[0] += 1
            if rested[0] > 12:
                left.pop(0)
                rested[0] = 0
            return 0.0, 0.0
        return (0.2 if left else 0.0), 0.0

    return drive(on_timer(0.1, law), seconds=12.0, rest_s=2.0)


def test_places_in_order_with_a_pause_at_each():
    finding = judge("motion.visits", route(0.4, 0.8), places=PLACES, pause="1 s")
    assert finding.status is Status.PASSED
    assert [moment.label for moment in finding.evidence.moments] == [
        "at (0.40, 0.00) m",
        "at (0.80, 0.00) m",
    ]


def test_a_place_that_it_only_drives_through_is_told_where_a_pause_is_asked_for():
    found = failing("motion.visits", route(0.8), places=PLACES, pause="1 s")
    assert "0 of 2 places; it was at (0.40, 0.00) m, at rest for less than 1 s" in found


def test_each_visited_place_gives_its_share():
    finding = judge("motion.visits", route(0.4), places=[*PLACES, [2, 2]])
    assert (finding.status, finding.credit) == (Status.FAILED, pytest.approx(1 / 3))
    assert "1 of 3 places; it stopped 0.38 m from (0.80, 0.00) m" in finding.observed


def legs(*turns_and_ways):
    """Turns on the spot by an angle, then drives some way, again and again; then rests."""
    left = [float(number) for number in turns_and_ways]
    at = [None]

    def law(pose):
        while left:
            at[0] = at[0] or pose
            is_turn = len(left) % 2 == 0
            done = math.hypot(pose.x_m - at[0].x_m, pose.y_m - at[0].y_m)
            if is_turn:
                done = math.copysign(wrapped(pose.yaw_rad - at[0].yaw_rad), left[0])
                done = math.copysign(done, wrapped(pose.yaw_rad - at[0].yaw_rad) * left[0])
            rest = abs(left[0]) - done
            if rest > 0.02:
                return (0.0, math.copysign(0.8, left[0])) if is_turn else (0.2, 0.0)
            left.pop(0)
            at[0] = None
        return 0.0, 0.0

    return drive(on_timer(0.02, law), seconds=20.0, rest_s=1.0)


def wrapped(angle):
    return math.remainder(angle, math.tau)


RIGHT_ANGLE = math.radians(90.0)
SQUARE = [[0.5, 0], [0.5, 0.5]]


@pytest.mark.parametrize(
    ("way", "said", "when"),
    [
        ((0.1, 0.5, -RIGHT_ANGLE, 0.5), "it turned to the wrong side", 1),
        ((0.1, 0.5, math.radians(140.0), 0.5), "it turned too far", 1),
        ((0.1, 0.5, math.radians(40.0), 0.5), "it turned too little", 1),
        ((0.1, 0.5, RIGHT_ANGLE, 0.2), "it stopped 0.2", 1),
        ((RIGHT_ANGLE, 0.5), "it turned too far", 0),
        ((RIGHT_ANGLE / 2.0, 0.7), "without (0.50, 0.00) m before", 0),
    ],
)
def test_a_place_is_missed_for_a_cause_of_its_own(way, said, when):
    finding = judge("motion.visits", legs(*way), places=SQUARE)
    assert said in finding.observed
    assert f"{when} of 2 places" in finding.observed
    assert finding.hint


def test_a_robot_that_turns_before_it_is_there_did_not_turn_too_far():
    """It drives a square with sides that are too short, and rests where it began."""
    run = legs(0.1, 0.4, RIGHT_ANGLE, 0.4, RIGHT_ANGLE, 0.4, RIGHT_ANGLE, 0.4)
    finding = judge("motion.visits", run, places=[[0.8, 0], [0.8, 0.8]])
    assert "0 of 2 places; it came within 0.4" in finding.observed


def test_a_route_that_ends_where_it_began_was_not_there_too_early():
    """It is at its last place at the start, and at the place before while it leaves that."""
    run = legs(0.1, 0.5, RIGHT_ANGLE, 0.2)
    finding = judge("motion.visits", run, places=[[0, 0], *SQUARE, [0.5, 0], [0, 0]])
    assert "2 of 5 places; it stopped 0.2" in finding.observed


def test_the_cause_is_shown_at_the_turn_and_not_at_the_end():
    finding = judge("motion.visits", legs(0.1, 0.5, -RIGHT_ANGLE, 0.5), places=SQUARE)
    at_corner, wrong = finding.evidence.moments
    assert 0.0 < wrong.time_s - at_corner.time_s < 3.5


def test_the_order_counts_unless_the_author_says_otherwise():
    backwards = PLACES[::-1]
    finding = judge("motion.visits", route(0.8), places=backwards)
    assert "it was at (0.40, 0.00) m, only before the places before it" in finding.observed
    finding = judge("motion.visits", route(0.8), places=backwards, ordered=False)
    assert finding.status is Status.PASSED


def test_zones_are_visited_by_the_middle_of_the_robot():
    zones = [[-0.1, -0.1, 0.1, 0.1], [0.5, -0.2, 1, 0.2]]
    assert judge("motion.visits", route(0.8), places=zones).status is Status.PASSED
    failing("motion.visits", route(0.8), places=[[0.5, 0.1, 1, 0.2]])


WALL = "segments: [[-1, 0.5, 6, 0.5]]"


def beside_the_wall(turn):
    return drive(
        on_timer(0.1, lambda pose: (0.2, turn(pose))), world=WALL, seconds=8.0, rest_s=None
    )


def test_a_robot_that_follows_the_wall_on_its_left():
    run = beside_the_wall(lambda pose: -pose.yaw_rad)
    parameters = {"distance": "0.5 m", "tolerance": "5 cm"}
    finding = judge("motion.keeps_distance", run, side="left", **parameters)
    assert finding.status is Status.PASSED
    assert "at this distance for 1.55 m of the 1.55 m since it first was" in finding.observed
    found = failing("motion.keeps_distance", run, side="right", **parameters)
    assert "it never was at this distance, but from 0.5 m to 0.5 m away" in found


def test_a_robot_that_drives_away_from_the_wall_fails():
    run = beside_the_wall(lambda pose: -1.0 if pose.yaw_rad > -math.pi / 4 else 0.0)
    found = failing("motion.keeps_distance", run, distance="0.5 m", tolerance="10 cm")
    assert "at this distance" in found
