"""Driving ahead and stopping in front of an obstacle, on runs of the real simulator core."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.findings.finding import Status
from grader.recording.model import Kind, Owner, Qos
from grader.recording.simulated import Incident
from tests.checks.builder import (
    INSTALLED,
    Senses,
    at,
    declarations,
    died,
    drive,
    endpoint,
    failing,
    judge,
    messages,
    on_scan,
    output,
    reader,
    recording,
    simulated,
    taken,
    traceback,
    twist,
)

WALL = "{segments: [[1.0, -1, 1.0, 1]]}"
BESIDE = "{boxes: [{centre: [0.6, 0.28], size: [20 cm, 20 cm]}]}"
STOPS = {"distance": "0.2 m", "early": "3 cm", "late": "5 cm"}
DRIVES = {"speed": "0.1 m/s", "until_distance": "0.3 m"}


def good(ranges, speed=0.1, stop=0.2):
    front = ranges[0]
    blocked = math.isfinite(front) and 0.0 < front <= stop
    return (0.0 if blocked else speed, 0.0)


def by_front(speed=0.1, stop=0.2):
    return on_scan(lambda ranges: good(ranges, speed, stop))


def nearest_of_all(ranges):
    return (0.0 if min(ranges) <= 0.2 else 0.1, 0.0)


def passes(check, run, **parameters):
    finding = judge(check, run, **parameters)
    assert finding.status is Status.PASSED, finding
    return finding


@settings(max_examples=20, deadline=None)
@given(
    wall=st.floats(0.5, 2.0),
    noise=st.sampled_from(["0 m", "5 mm"]),
    empty=st.sampled_from(["inf", "zero"]),
    layout=st.sampled_from(["0..2pi", "-pi..pi"]),
)
def test_a_good_controller_passes_every_check(wall, noise, empty, layout):
    def law(ranges):
        front = ranges[0 if layout == "0..2pi" else 180]
        return good([front])

    run = drive(
        on_scan(law),
        world=f"{{segments: [[{wall}, -1, {wall}, 1]]}}",
        seconds=30,
        options={"lidar": {"noise": noise, "no_return": empty, "layout": layout}},
    )
    passes("motion.drives", run, **DRIVES)
    passes("motion.stops", run, **STOPS)
    passes("motion.no_contact", run)
    passes("motion.straight", run)
    if noise == "0 m":
        # With noise a robot at the threshold rightly sets off again now and then.
        passes("motion.stays_at_rest", run, after="stop")
    passes("motion.within_limits", run)
    passes("motion.keeps_driving", run, distance=f"{wall - 0.3} m")


def test_the_picture_of_a_stop_judges_where_the_check_does():
    finding = passes("motion.stops", drive(by_front(), world=WALL, seconds=12), **STOPS)
    plot = finding.evidence.plots[0]
    begin_s, end_s = plot.judged
    low, high = plot.band
    shown = [y for x, y in zip(plot.x, plot.y, strict=True) if begin_s <= x <= end_s]
    assert shown and all(low <= y <= high for y in shown)
    assert any(not low <= y <= high for y in plot.y)


def test_a_stop_is_shown_as_scans_commands_and_true_distances():
    run = drive(by_front(stop=0.15), world=WALL, seconds=12)
    (table,) = judge("motion.stops", run, **{**STOPS, "late": "1 cm"}).evidence.tables
    _, beam, command, true = table.rows[-1]
    assert command == "0 m/s" and table.rows[0][2] == "0.1 m/s"
    assert abs(float(beam.split()[0]) - float(true.split()[0])) < 0.01
    assert float(true.split()[0]) <= 0.15


def test_an_obstacle_that_appears_later_counts_from_then_on():
    world = "{moving: [{circle: {radius: 0.1}, path: [{at: 0 s, pose: [0.7, 0]}], appears: 2 s}]}"
    run = drive(by_front(), world=world, seconds=20)
    finding = passes("motion.stops", run, **STOPS)
    assert "a moving obstacle" in finding.observed


def test_a_moving_box_is_as_near_as_its_side():
    """2 m long across the way and 10 cm thick: its near side is at 0.75 m."""
    world = "{moving: [{box: {size: [0.1, 2.0]}, path: [{at: 0 s, pose: [0.8, 0]}]}]}"
    run = drive(by_front(), world=world, seconds=20)
    finding = passes("motion.stops", run, **STOPS)
    assert "a moving obstacle at 0.1" in finding.observed


def test_the_distance_counts_from_the_lidar():
    run = drive(
        by_front(), world=WALL, seconds=20, options={"lidar": {"pose": [-0.03, 0, "0 deg"]}}
    )
    finding = passes("motion.stops", run, distance="0.2 m", early="0 m", late="3 cm")
    seen_m = float(finding.observed.split(" at ")[1].removesuffix(" m"))
    assert math.isclose(seen_m, 1.0 - run.truth[-1].x_m + 0.03, abs_tol=1e-3)


class TestKeepsDriving:
    def test_backwards_is_no_way_ahead(self):
        run = drive(by_front(-0.1), seconds=5)
        said = failing("motion.keeps_driving", run, distance="5 cm")
        assert "the robot drove 0.4" in said and "backwards" in said

    def test_a_curve_ahead_counts_along_its_path(self):
        run = drive(on_scan(lambda _: (0.1, 0.5)), seconds=13)
        passes("motion.keeps_driving", run, distance="1.2 m")


class TestDrives:
    def test_twice_the_speed_is_reported(self):
        run = drive(by_front(0.2), world=WALL, seconds=20)
        assert "it drives too fast" in failing("motion.drives", run, **DRIVES)

    @pytest.mark.parametrize("acceleration", ["1 m/s^2", "0.4 m/s^2"])
    def test_the_robot_speeds_up_as_fast_as_it_can(self, acceleration):
        """However long it needs to its speed: what is commanded is right from the start."""
        robot = {"max_speed": "1 m/s", "max_acceleration": acceleration}
        fast = drive(lambda _: (1.0, 0.0), seconds=6, options={"robot": robot})
        passes("motion.drives", fast, speed="1 m/s")
        slow = drive(lambda _: (0.8, 0.0), seconds=6, options={"robot": robot})
        assert "it drives too slowly" in failing("motion.drives", slow, speed="1 m/s")

    def test_limited_by_the_robot(self):
        run = drive(by_front(1.0), world=WALL, seconds=20)
        said = failing("motion.drives", run, **DRIVES)
        assert "1 m/s was commanded, and the robot can do no more than 0.22 m/s" in said

    def test_driving_backwards_is_reported(self):
        run = drive(by_front(-0.1), seconds=5)
        assert "it drives the wrong way" in failing("motion.drives", run, speed="0.1 m/s")

    def test_driving_on_and_off_is_reported(self):
        ticks = iter(range(10_000))
        run = drive(on_scan(lambda _: (0.1 * (next(ticks) % 4 < 2), 0.0)), seconds=8)
        assert "paused in between, 9 times" in failing("motion.drives", run, speed="0.1 m/s")

    def test_what_turns_after_it_had_stopped_has_not_set_off(self):
        def law(senses: Senses):
            return (0.1, 0.0) if senses.time_s < 2 else (0.0, 0.5 * (senses.time_s > 4))

        said = failing("motion.stays_at_rest", drive(law, seconds=6, rest_s=None))
        assert "turned on the spot" in said and "set off" not in said

    def test_turning_in_place_of_driving_is_reported(self):
        run = drive(on_scan(lambda _: (0.0, 0.1)), seconds=5)
        assert "turns on the spot" in failing("motion.drives", run, speed="0.1 m/s")

    def test_never_moved_for_nothing_was_published(self):
        run = drive(lambda _: None, seconds=2)
        assert "the robot never moved: " in failing("motion.drives", run, speed="0.1 m/s")

    def test_never_moved_for_every_command_is_zero(self):
        run = drive(on_scan(lambda _: (0.0, 0.0)), seconds=2)
        assert "10 commands on `/cmd_vel`, linear.x and angular.z are 0" in failing(
            "motion.drives", run, speed="0.1 m/s"
        )

    def test_a_speed_in_another_field_is_reported(self):
        run = drive(on_scan(lambda _: (0.0, 0.0)), seconds=2)
        found = [replace(m, value=twist((0, 0.1, 0), (0, 0, 0))) for m in run.on("/cmd_vel")]
        run = simulated(run.truth, run.scene, messages={**run.messages, "/cmd_vel": tuple(found)})
        said = failing("motion.drives", run, speed="0.1 m/s")
        assert "linear.x and angular.z are 0, but `linear.y` is not" in said

    def test_a_speed_that_is_not_a_number_is_reported(self):
        run = drive(on_scan(lambda _: (math.nan, 0.0)), seconds=2)
        assert "9 commands on `/cmd_vel` were not finite (first: linear nan" in failing(
            "motion.drives", run, speed="0.1 m/s"
        )

    @pytest.mark.parametrize(
        ("bits", "words"),
        [
            # What rclpy makes of the integer 1, in Python 3.11 and in 3.12, of numpy.float32(0.1)
            # and of numpy.float32(-0.1).
            (1, "`linear.x` is a float field, but an integer, a text or a numpy.float32"),
            (8, "`linear.x` is a float field, but an integer, a text or a numpy.float32"),
            (0x3DCCCCCD, "`linear.x` is a float field, but an integer, a text or a numpy.float32"),
            (0xBDCCCCCD, "`linear.x` is a float field, but an integer, a text or a numpy.float32"),
        ],
    )
    def test_a_speed_that_is_no_float(self, bits, words):
        run = drive(on_scan(lambda _: (bits * 5e-324, 0.0)), seconds=2)
        said = failing("motion.drives", run, speed="0.1 m/s")
        assert words in said and "or float(value)" in said

    def test_qos_that_the_robot_refuses(self):
        run = drive(lambda _: None, seconds=2)
        weak = endpoint(qos=Qos(reliability="best_effort"))
        run = simulated(
            run.truth, run.scene, messages=messages([0.6, 0.8]), endpoints=(weak, reader())
        )
        said = failing("motion.drives", run, speed="0.1 m/s")
        assert "reliability best_effort offered, reliable requested" in said

    def test_the_process_died_before(self):
        run = drive(lambda _: None, seconds=2)
        run = simulated(
            run.truth, run.scene, processes=(died(1),), log=output(traceback("ValueError: no"))
        )
        assert "ValueError: no" in failing("motion.drives", run, speed="0.1 m/s")

    def test_a_scenario_without_a_world_is_our_mistake(self):
        finding = judge("motion.drives", recording(), speed="0.1 m/s")
        assert finding.status is Status.ERROR
        assert "needs a `world`" in finding.observed


class TestStops:
    @pytest.mark.parametrize("threshold_m", [0.5, 1.0, 1.6])
    def test_the_nearest_of_all_beams_at_any_threshold(self, threshold_m):
        def law(ranges):
            return (0.1 if min(ranges) > threshold_m else 0.0, 0.0)

        off_m = threshold_m + 0.05
        world = f"{{boxes: [{{centre: [0.9, {off_m}], size: [0.2, 0.2]}}]}}"
        run = drive(on_scan(law), world=world, seconds=20)
        said = failing("motion.keeps_driving", run, distance="1.5 m")
        assert "the nearest thing, a box, was then" in said and "min(ranges)" in said

    def test_zero_taken_for_an_obstacle(self):
        def law(ranges):
            return (0.1 if ranges[0] > 0.2 else 0.0, 0.0)

        run = drive(on_scan(law), seconds=5, options={"lidar": {"no_return": "zero"}})
        assert "reported 0.0" in failing("motion.keeps_driving", run, distance="1 m")
        assert "reported 0.0" in failing("motion.drives", run, speed="0.1 m/s")

    def test_a_robot_that_drove_on_with_zero_ahead_did_not_stop_for_it(self):
        def law(ranges):
            return (0.0 if min(filter(None, ranges), default=1.0) <= 0.2 else 0.1, 0.0)

        world = "{boxes: [{centre: [0.6, 0.21], size: [0.2, 0.1]}]}"
        run = drive(on_scan(law), world=world, seconds=9, options={"lidar": {"no_return": "zero"}})
        said = failing("motion.keeps_driving", run, distance="1 m")
        assert "the nearest thing, a box, was then" in said and "reported 0.0" not in said

    def test_what_it_drove_along_is_not_what_stopped_it(self):
        def law(senses: Senses):
            return (0.1 if senses.time_s < 5.0 else 0.0, 0.0) if senses.new_scan else None

        world = "{segments: [[2, -1, 2, 1]], boxes: [{centre: [0.4, 0.21], size: [0.5, 0.1]}]}"
        run = drive(law, world=world, seconds=9)
        for check, parameters in (
            ("motion.stops", STOPS),
            ("motion.keeps_driving", {"distance": "1 m"}),
        ):
            said = failing(check, run, **parameters)
            assert "nearest of all" not in said and "made it stop? Log" in said

    def test_a_robot_that_never_stops_is_reported(self):
        run = drive(lambda s: (0.1, 0.0) if s.new_scan else None, world=WALL, seconds=3)
        said = failing("motion.stops", run, **STOPS)
        assert "never stopped: it still drives at 0.1 m/s" in said
        assert "a wall is still" in said

    def test_a_robot_that_hits_the_wall_is_reported(self):
        run = drive(lambda s: (0.1, 0.0) if s.new_scan else None, world=WALL, seconds=12)
        for check, parameters in (("motion.stops", STOPS), ("motion.no_contact", {})):
            said = failing(check, run, **parameters)
            assert "drove into a wall at 0.1 m/s" in said

    def test_decides_to_drive_until_it_touches(self):
        run = drive(on_scan(lambda ranges: good([ranges[270]])), world=WALL, seconds=12)
        said = failing("motion.no_contact", run)
        assert "Is it the beam straight ahead" in said and "sent" not in said

    @pytest.mark.parametrize(
        ("caller", "words"),
        [("rclpy/executors.py", "does not return: it is in line 14"), ("threading.py", "Log")],
    )
    def test_a_loop_in_a_callback_and_one_in_main(self, caller, words):
        interrupted = (
            "Traceback (most recent call last):\n"
            f'  File "/opt/ros/jazzy/lib/python3.12/site-packages/{caller}", line 9, in f\n'
            "    go()\n"
            f'  File "{INSTALLED}", line 14, in scan_callback\n'
            "    time.sleep(0.1)\n"
            "KeyboardInterrupt"
        )
        run = drive(on_scan(lambda _: (0.1, 0.0)), world=WALL, seconds=12)
        run = replace(run, log=output(interrupted, time_s=12.0))
        said = failing("motion.no_contact", run)
        assert words in said
        assert ("the node calls nothing else" in said) == ("rclpy" in caller)

    def test_a_command_that_is_held_until_it_touches(self):
        def slow(senses: Senses):
            due = senses.new_scan and senses.scan is not None and senses.time_s < 1.0
            return (0.1, 0.0) if due else None

        said = failing("motion.no_contact", drive(slow, world=WALL, seconds=12))
        assert "as the last command, sent 8." in said
        assert "The robot keeps the last command" in said
        assert "A time.sleep() or a loop in a callback" in said

    def test_drives_into_it_long_after_the_last_scan(self):
        run = drive(by_front(), world=WALL, seconds=12, options={"lidar": {"stops": "3 s"}})
        said = failing("motion.no_contact", run)
        assert "drove into a wall" in said and "; the last scan had come 6." in said
        assert "Without new scans the robot drives blindly" in said and "brake" not in said

    def test_stopping_too_late_is_reported(self):
        late = iter(range(1000))

        def law(senses: Senses):
            if not senses.new_scan or senses.scan is None:
                return None
            return good(senses.scan.ranges_m) if next(late) % 3 == 0 else None

        run = drive(law, world="{segments: [[0.8, -1, 0.8, 1]]}", seconds=20)
        assert "stopped late" in failing("motion.stops", run, distance="0.2 m", late="1 cm")

        assert "a sleep, a slow timer" in failing(
            "motion.stops", run, distance="0.2 m", late="1 cm"
        )

    def test_too_late_by_what_the_machine_took_is_no_fault_of_the_student(self):
        run = drive(by_front(0.15, 0.17), world=WALL, seconds=20)
        parameters = {"distance": "0.2 m", "late": "2 cm"}
        failing("motion.stops", run, **parameters)
        end_s = (run.truth[-1].time_ns - at(0)) / 1e9
        run = simulated(
            run.truth, run.scene, messages=run.messages, disturbance=taken(0, end_s, waited_s=0.9)
        )
        finding = judge("motion.stops", run, **parameters)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_late_steps_of_the_simulator_count_as_taken(self):
        run = drive(by_front(0.15, 0.17), world=WALL, seconds=20)
        stopped = next(s for s in run.truth[200:] if abs(s.linear_m_s) < 1e-3)
        late = Incident(stopped.time_ns, "late", "80 steps done 800 ms late", 0.8)
        run = simulated(run.truth, run.scene, messages=run.messages, incidents=(late,))
        finding = judge("motion.stops", run, distance="0.2 m", late="2 cm")
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_died_on_the_way(self):
        run = drive(lambda s: (0.1, 0.0) if s.new_scan else None, world=WALL, seconds=12)
        run = simulated(
            run.truth,
            run.scene,
            messages=run.messages,
            processes=(died(1, 5.0),),
            log=output(traceback("KeyError: 'front'")),
        )
        for check, parameters in (("motion.stops", STOPS), ("motion.no_contact", {})):
            assert "KeyError: 'front'" in failing(check, run, **parameters)


class TestRest:
    NEAR = "{segments: [[0.18, -1, 0.18, 1]]}"

    def test_does_not_start_in_front_of_an_obstacle(self):
        run = drive(by_front(), world=self.NEAR, seconds=2, rest_s=None)
        passes("motion.stays_at_rest", run, after="start")

    def test_starts_before_the_first_scan(self):
        def blind(senses: Senses):
            return good([senses.scan.ranges_m[0]] if senses.scan else [math.inf])

        run = drive(blind, world=self.NEAR, seconds=2, rest_s=None)
        assert "before the first scan had come" in failing(
            "motion.stays_at_rest", run, after="start"
        )

    def test_backwards_until_nothing_is_ahead_is_told(self):
        run = drive(
            on_scan(lambda ranges: (-0.2 if ranges[0] < 2.0 else 0.0, 0.0)), world=WALL, seconds=12
        )
        said = failing("motion.stops", run, **STOPS)
        assert "it drove backwards" in said and "sign of the difference" in said

    def test_setting_off_again_is_reported(self):
        def forgetful(senses: Senses):
            if not senses.new_scan or senses.scan is None:
                return None
            return (0.03, 0.0) if senses.time_s > 9.5 else good(senses.scan.ranges_m)

        run = drive(forgetful, world=WALL, seconds=11, rest_s=None)
        said = failing("motion.stays_at_rest", run, after="stop")
        assert "set off again 10.1" in said and "a wall" in said

    def test_backing_off_is_reported(self):
        run = drive(on_scan(lambda _: (-0.05, 0.0)), world=WALL, seconds=2, rest_s=None)
        said = failing("motion.stays_at_rest", run, after="start")
        assert "set off backwards" in said
        assert "stand still near an obstacle" in said

    def test_scans_that_are_not_answered(self):
        """An inf that the callback throws away."""
        run = drive(
            lambda senses: None,
            world="{}",
            seconds=2,
            endpoints=(
                endpoint(),
                reader(),
                endpoint("/scan", kind=Kind.SUBSCRIPTION, type="sensor_msgs/msg/LaserScan"),
                endpoint(
                    "/scan",
                    type="sensor_msgs/msg/LaserScan",
                    node="/probe",
                    owner=Owner.PROBE,
                ),
            ),
            declarations=declarations(timer_s=None),
        )
        said = failing("motion.keeps_driving", run, distance="0.2 m")
        assert "silent, although 10 messages on `/scan` reached the node" in said
        assert "an `if` or a `return` before it" in said and "create_timer" not in said

    def test_a_robot_that_always_stands_did_not_stop(self):
        run = drive(on_scan(lambda _: (0.0, 0.0)), world=WALL, seconds=2)
        for check in ("motion.stays_at_rest", "motion.no_contact"):
            assert "the robot never moved" in failing(check, run)

    def test_something_that_runs_into_the_resting_robot_does_not_count(self):
        world = (
            "{segments: [[1, -1, 1, 1]], moving: [{circle: {radius: 0.1}, path: "
            "[{at: 9 s, pose: [-1, 0]}, {at: 14 s, pose: [0.75, 0]}]}]}"
        )
        run = drive(by_front(), world=world, seconds=14, rest_s=None)
        assert run.truth[-1].contact == "moving[0]"
        passes("motion.no_contact", run)


class TestStraight:
    def test_a_curve_is_not_straight(self):
        run = drive(on_scan(lambda _: (0.1, 0.2)), seconds=4)
        said = failing("motion.straight", run)
        assert "angular.z = 0.2 rad/s was commanded" in said

    def test_a_slow_curve_is_not_straight(self):
        run = drive(on_scan(lambda _: (0.1, 0.009)), seconds=10)
        assert "the heading changed by" in failing("motion.straight", run)


def test_a_command_beyond_the_limits():
    run = drive(by_front(0.5), world=WALL, seconds=4)
    said = failing("motion.within_limits", run)
    assert "linear.x = 0.5 m/s" in said
    # Also where nothing was commanded.
    for one in (run, replace(run, messages={})):
        assert "commands of at most 0.22 m/s" in judge("motion.within_limits", one).expected
