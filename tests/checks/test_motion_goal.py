"""Reaching a goal with a proportional controller, on runs of the real simulator core."""

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from assignments.p_controller.checks.control_law import examine
from grader.assignment.load import load_assignment
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.findings.finding import Status
from grader.measure.motion.approach import Approach
from grader.measure.motion.steering import Sample
from sim.motion import Pose
from tests.checks.builder import (
    INSTALLED,
    died,
    drive,
    failing,
    judge,
    on_odometry,
    on_timer,
    output,
    senses,
    simulated,
    taken,
    text,
    traceback,
)

GOAL = (0.8, 0.5, 2.0)
ODOMETRY = "nav_msgs/msg/Odometry"
BEHIND = (-0.6, 0.15, -math.pi / 2)
REACHES = {"position": "0.1 m", "heading": "0.1 rad"}


def wrap(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def clamp(value, limit):
    return max(-limit, min(limit, value))


class Student:
    """The lecture's controller, with every classic mistake to switch on."""

    def __init__(self, goal, **style):
        self.goal = goal
        self.linear, self.angular = style.pop("linear", 0.6), style.pop("angular", 1.5)
        self.top, self.spin = style.pop("top", 0.22), style.pop("spin", 2.84)
        self.near, self.straight = style.pop("near", 0.05), style.pop("straight", 0.05)
        self.turn_first = style.pop("turn_first", None)
        self.constant = style.pop("constant", None)
        self.speed = style.pop("speed", lambda distance, _: self.linear * distance)
        self.wrap = style.pop("wrap", wrap)
        self.wrap_theta = style.pop("wrap_theta", self.wrap)
        self.law = style.pop("law", lambda error: self.angular * error)
        self.align_law = style.pop("align_law", self.law)
        self.creep = style.pop("creep", 0.0)
        self.forgets = style.pop("forgets", False)
        self.once = style.pop("once", False)
        self.yaw = style.pop("yaw", lambda yaw_rad: yaw_rad)
        self.arrived = self.done = False
        assert not style

    def __call__(self, pose):
        x, y, theta = self.goal
        dx, dy = x - pose.x_m, y - pose.y_m
        distance = math.hypot(dx, dy)
        if not self.arrived and distance > self.near:
            error = self.wrap(math.atan2(dy, dx) - self.yaw(pose.yaw_rad))
            speed = self.constant or clamp(self.speed(distance, error), self.top)
            if self.turn_first is not None and abs(error) > self.turn_first:
                speed = 0.0
            return speed, clamp(self.law(error), self.spin)
        self.arrived = not self.forgets
        error = self.wrap_theta(theta - self.yaw(pose.yaw_rad))
        if abs(error) < self.straight or self.done:
            self.done = self.once
            return 0.0, 0.0
        return self.creep, clamp(self.align_law(error), self.spin)


def run_to(goal, start=(0.0, 0.0, 0.0), seconds=40.0, period_s=None, **style):
    student = Student(goal, **style)
    controller = on_odometry(student) if period_s is None else on_timer(period_s, student)
    pose = [start[0], start[1], f"{start[2]} rad"]
    return drive(controller, seconds=seconds, options={"robot": {"pose": pose}})


def yaml(goal):
    return [goal[0], goal[1], f"{goal[2]!r} rad"]


def checks(goal):
    """Every check of the assignment with its parameters."""
    pose = yaml(goal)
    return {
        "motion.reaches": {"goal": pose, **REACHES},
        "motion.two_phases": {"goal": pose, "position": "0.1 m"},
        "motion.short_way": {"goal": pose},
        "proportional on the way": {"goal": pose, "phase": "position"},
        "proportional at the goal": {"goal": pose, "phase": "align"},
        "motion.overshoot": {"goal": pose, "most": "5 cm"},
        "motion.within_limits": {},
        "motion.no_contact": {},
    }


def lost(run, goal):
    """The checks that a run does not pass, with what they say."""
    found = {}
    for name, parameters in checks(goal).items():
        check = "motion.proportional" if name.startswith("prop") else name
        finding = judge(check, run, **parameters)
        if finding.status is not Status.PASSED:
            assert finding.status is Status.FAILED, finding
            found[name] = finding.observed
    return found


ANGLES = st.floats(-math.pi, math.pi)
GOALS = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), ANGLES)


@settings(max_examples=25, deadline=None)
@given(
    goal=GOALS,
    heading=ANGLES,
    linear=st.floats(0.3, 1.0),
    angular=st.floats(0.8, 4.0),
    spin=st.sampled_from([1.0, 1.5, 2.84]),
    turn_first=st.sampled_from([None, 0.3]),
    constant=st.sampled_from([None, 0.1, 0.2]),
    period_s=st.sampled_from([None, 0.02, 0.05, 0.1]),
)
# Before it has arrived it stops once more to turn to the goal's direction.
@example((0.4375, 0.375, 1.0), 0.0, 1.0, 0.8125, 1.0, None, 0.2, None)
def test_a_good_controller_passes_every_check(
    goal, heading, linear, angular, spin, turn_first, constant, period_s
):
    if math.hypot(goal[0], goal[1]) < 0.3:
        goal = (goal[0] + 1.0, goal[1], goal[2])
    if constant is not None:
        # At a constant speed it could circle around the goal.
        turn_first = 0.3
    if period_s == 0.1:
        angular = min(angular, 2.0)
    run = run_to(
        goal,
        (0.0, 0.0, heading),
        linear=linear,
        angular=angular,
        spin=spin,
        turn_first=turn_first,
        constant=constant,
        period_s=period_s,
    )
    assert lost(run, goal) == {}
    assert misread_yaw(Approach(run, Pose(*goal)), 0.1) is None
    assert judge("motion.settles", run, within="40 s").status is Status.PASSED
    if turn_first is not None:
        finding = judge("motion.path_length", run, goal=yaml(goal), most="10 %")
        assert finding.status is Status.PASSED, finding


@settings(max_examples=15, deadline=None)
@given(goal=GOALS, heading=ANGLES, size=st.sampled_from([0.3, 0.5, 1.0]))
def test_bang_bang_is_never_proportional(goal, heading, size):
    if math.hypot(goal[0], goal[1]) < 0.3:
        goal = (goal[0] + 1.0, goal[1], goal[2])
    run = run_to(
        goal,
        (0.0, 0.0, heading),
        law=lambda error: math.copysign(size, error) if abs(error) > 0.05 else 0.0,
        turn_first=0.3,
    )
    pose = yaml(goal)
    for phase in ("position", "align"):
        finding = judge("motion.proportional", run, goal=pose, phase=phase)
        assert finding.status is Status.FAILED or "hardly an error" in finding.observed, finding


FAR = (-0.2, 0.2, 2.24)
PUSHED = {"pushes": [{"after": "20 cm", "ahead": "-12 cm", "turn": "-30 deg"}]}


def with_speed(speed, **style):
    """A run as in the assignment: 0.6 m away, with a push."""
    student = Student(FAR, speed=speed, near=0.03, straight=0.02, **style)
    robot = {"pose": [-0.1, -0.45, "150 deg"], **PUSHED}
    return drive(on_odometry(student), seconds=40.0, options={"robot": robot})


def of_speed(run):
    return judge("motion.proportional_speed", run, goal=yaml(FAR))


@pytest.mark.parametrize(
    ("speed", "style"),
    [
        (lambda d, e: 0.6 * d, {}),
        (lambda d, e: 0.2 * d, {"angular": 0.5}),
        (lambda d, e: 1.2 * d, {"angular": 4.0}),
        (lambda d, e: 1.0 * d, {"top": 0.05}),
        (lambda d, e: 0.5 * d, {"top": 0.1}),
        (lambda d, e: max(0.04, 0.6 * d), {}),
        (lambda d, e: round(0.3 * d, 2), {}),
        (lambda d, e: round(0.544 * d, 2), {"top": 0.05, "angular": 3.6, "spin": 1.0}),
        (lambda d, e: 0.6 * d * max(0.0, math.cos(e)), {}),
        (lambda d, e: 0.6 * d * (1.0 - abs(e) / math.pi), {}),
        (lambda d, e: 0.0 if abs(e) > 0.05 else 0.6 * d, {}),
        (lambda d, e: 0.6 * d / (1.0 + abs(e)), {}),
        (lambda d, e: 0.22 * math.tanh(4.0 * d), {}),
    ],
)
def test_a_speed_in_proportion_passes_with_any_gain_and_limit(speed, style):
    finding = of_speed(with_speed(speed, **style))
    assert finding.status is Status.PASSED, finding


@pytest.mark.parametrize(
    "speed",
    [
        lambda d, e: 0.25 * math.sqrt(d),
        lambda d, e: 0.5 * math.sqrt(d),
        lambda d, e: 0.03 + 0.4 * d * d,
        lambda d, e: 0.08 + 0.2 * d,
        lambda d, e: 0.2 if d > 0.3 else 0.05,
    ],
)
def test_a_speed_that_is_no_gain_times_the_distance_fails(speed):
    finding = of_speed(with_speed(speed))
    assert finding.status is Status.FAILED, finding
    assert "times the distance" in finding.observed


@pytest.mark.parametrize("gain", [1.0, 1.5, 2.5])
@pytest.mark.parametrize("phase", ["position", "align"])
def test_the_sine_of_a_large_error_is_not_the_error(gain, phase):
    goal = (-0.6, 0.15, 1.05)
    kinds = {"sine": lambda error: gain * math.sin(error), "angle": lambda error: gain * error}
    found = {
        name: judge(
            "motion.proportional", run_to(goal, law=law, near=0.03), goal=yaml(goal), phase=phase
        ).status
        for name, law in kinds.items()
    }
    assert found == {"sine": Status.FAILED, "angle": Status.PASSED}


def test_a_robot_that_drives_on_may_be_at_the_goal_where_a_window_ends():
    run = drive(on_timer(0.1, lambda pose: (0.2, 0.0)), seconds=2.5, rest_s=None)
    at = [round(run.truth[-1].x_m, 2), 0.0, "0 deg"]
    assert "not at rest" in failing("motion.reaches", run, goal=at, position="5 cm")
    finding = judge("motion.reaches", run, goal=at, position="5 cm", at_rest=False)
    assert finding.status is Status.PASSED
    assert not finding.expected.startswith("at rest")


@pytest.mark.parametrize("huge", [1e160, 1e300])
def test_huge_commands_break_nothing(huge):
    samples = [Sample(0.1 + 0.01 * i, huge * (i % 7 - 3)) for i in range(60)]
    verdict = examine(samples, 2.84, 0.9)
    assert math.isfinite(verdict.r2) and verdict.r2 < 0.9


def test_the_gain_is_reported():
    run = run_to(GOAL, angular=1.7)
    finding = judge("motion.proportional", run, goal=yaml(GOAL), phase="align")
    assert finding.status is Status.PASSED
    assert "gain 1.7 1/s" in finding.observed
    assert finding.evidence.plots[0].y_label == "angular.z (rad/s)"


def test_a_callback_that_sleeps_works_with_old_odometry():
    """It takes one odometry of its queue of ten every 0.8 s."""
    student, queue, next_s = Student(GOAL), [], [0.8]

    def sleeps(senses):
        if senses.new_odometry and senses.odometry is not None:
            queue.append(senses.odometry.pose)
            del queue[:-10]
        if not queue or senses.time_s < next_s[0]:
            return None
        next_s[0] += 0.8
        return student(queue.pop(0))

    said = failing(
        "motion.proportional", drive(sleeps, seconds=40), goal=yaml(GOAL), phase="position"
    )
    assert "time.sleep()" in said


def test_a_gain_out_of_range():
    run = run_to(GOAL, angular=0.5)
    said = failing("motion.proportional", run, goal=yaml(GOAL), phase="align", gain_min="0.8 Hz")
    assert "gain 0.5 1/s" in said and "too small" in said


def test_a_goal_by_names_of_random_values():
    run = run_to(GOAL)
    named = {"goal": ["goal_x", "goal_y", "goal_theta"], **REACHES}
    values = dict(zip(("goal_x", "goal_y", "goal_theta"), GOAL, strict=True))
    known = simulated(run.truth, run.scene, values=values)
    assert judge("motion.reaches", known, **named).status is Status.PASSED
    finding = judge(
        "motion.reaches", simulated(run.truth, run.scene, values={"goal_a": 1}), **named
    )
    assert finding.status is Status.ERROR
    assert "no value 'goal_x'. Did you mean 'goal_a'?" in finding.observed


def test_to_turn_on_the_spot_towards_the_goal_is_the_first_phase():
    """At a constant speed the direction is off by 17 degrees once more when it is 8 cm away."""
    goal = (0.0, 0.375, 0.0)
    run = run_to(goal, angular=0.875, spin=1.0, turn_first=0.3, constant=0.2, period_s=0.1)
    assert judge("motion.two_phases", run, goal=yaml(goal), position="0.1 m").status is (
        Status.PASSED
    )


@pytest.mark.parametrize(("linear", "angular", "top"), [(0.2, 0.5, 0.22), (1.0, 2.0, 0.05)])
def test_who_publishes_changes_only_does_so_often_enough_for_the_assignment(linear, angular, top):
    goal = 0.6, 0.4, math.pi / 2
    student = Student(goal, linear=linear, angular=angular, top=top)
    control = on_timer(0.1, lambda pose: tuple(round(item, 2) for item in student(pose)))
    said = []

    def changes(senses):
        command = control(senses)
        if command is None or command in said[-1:]:
            return None
        said.append(command)
        return command

    (often,) = [
        spec for spec in load_assignment("p_controller").assignment.checks if spec.id == "often"
    ]
    finding = judge(often.uses, drive(changes, seconds=30), **often.with_)
    assert finding.status is Status.PASSED, finding


class TestMistakes:
    """Each mistake loses the checks that it should, with its own words, and no others."""

    def test_angles_that_are_not_wrapped_are_named(self):
        run = run_to(BEHIND, (0, 0, -3.0), wrap=lambda error: error)
        found = lost(run, BEHIND)
        assert "through half a turn" in found["motion.short_way"]
        assert "full turn off" in found["proportional on the way"]

    def test_a_goal_heading_that_is_not_wrapped_is_named(self):
        goal = (-0.2, -0.16, math.radians(170))
        start = (0.4, 0.0, math.radians(-165))
        run = run_to(goal, start, wrap_theta=lambda error: error)
        found = lost(run, goal)
        assert set(found) == {"motion.short_way", "proportional at the goal"}
        assert "335° counter-clockwise where 25° clockwise would do" in found["motion.short_way"]
        assert "full turn off" in found["proportional at the goal"]

    def test_turn_drive_turn_is_named(self):
        def law(error):
            size = 1.2 if abs(error) > 1.0 else 0.6 if abs(error) > 0.3 else 0.2
            return math.copysign(size, error)

        run = run_to(GOAL, law=law, turn_first=0.3)
        found = lost(run, GOAL)
        assert set(found) == {"proportional on the way", "proportional at the goal"}
        assert "bang-bang" in found["proportional at the goal"]

    def test_creeps_while_it_aligns(self):
        run = run_to(GOAL, creep=0.05)
        found = lost(run, GOAL)
        assert "motion.two_phases" in found
        assert "commanded with up to 0.05 m/s" in found["motion.two_phases"]
        assert "proportional on the way" not in found

    def test_a_curve_into_the_goal_is_still_the_first_phase(self):
        goal = (0.0, -0.5, 0.0)
        assert lost(run_to(goal, linear=1.0, angular=1.0, spin=1.0), goal) == {}

    def test_a_wrong_sign_is_named(self):
        run = run_to(GOAL, law=lambda error: -1.5 * error, seconds=20)
        found = lost(run, GOAL)
        assert "motion.reaches" in found
        assert "turns away from the error" in found["proportional on the way"]

    def test_heading_left_as_it_is(self):
        run = run_to(GOAL, align_law=lambda _: 0.0, seconds=20)
        found = lost(run, GOAL)
        assert "it has not turned since it arrived" in found["motion.reaches"]
        assert "angular.z = 0" in found["proportional at the goal"]

    def test_the_same_speed_all_the_way(self):
        said = failing("motion.slows_down", run_to(GOAL, constant=0.1))
        assert "0.1 m/s at the end; the largest is 0.1 m/s" in said
        assert "linear.x = gain * distance" in said

    @pytest.mark.parametrize(
        "style", [{}, {"linear": 0.3}, {"linear": 1.0, "top": 0.1}, {"turn_first": 0.3}]
    )
    def test_a_speed_in_proportion_to_the_distance(self, style):
        finding = judge("motion.slows_down", run_to(GOAL, near=0.02, **style))
        assert finding.status is Status.PASSED, finding

    def test_a_speed_that_is_switched_near_the_goal(self):
        student = Student(GOAL)

        def switched(pose):
            speed, turn = student(pose)
            far = math.hypot(GOAL[0] - pose.x_m, GOAL[1] - pose.y_m) > 0.2
            return (0.2 if far else 0.05) if speed else 0.0, turn

        said = failing("motion.slows_down", drive(on_odometry(switched), seconds=20))
        assert "linear.x is switched between 0.2 m/s and 0.05 m/s" in said

    def test_the_last_two_steps_of_a_speed_with_two_decimals(self):
        student = Student(GOAL, linear=1.2, top=0.05, near=0.03)

        def rounded(pose):
            speed, turn = student(pose)
            return round(speed, 2), round(turn, 2)

        finding = judge("motion.slows_down", drive(on_odometry(rounded), seconds=40))
        assert finding.status is Status.PASSED, finding

    @pytest.mark.parametrize(("linear", "top", "held"), [(0.8, 0.05, 15), (1.5, 0.1, 8)])
    def test_a_command_that_comes_more_often_than_it_is_computed(self, linear, top, held):
        student = Student(GOAL, linear=linear, angular=2 * linear, top=top, near=0.03)
        now = itertools.count()
        last = [(0.0, 0.0)]

        def repeated(pose):
            if next(now) % held == 0:
                last.append(student(pose))
            return last[-1]

        found = judge("motion.slows_down", drive(on_odometry(repeated), seconds=40))
        assert "switched" not in text(found)

    def test_turning_without_a_way_does_not_slow_down(self):
        run = drive(on_odometry(lambda _: (0.0, 0.5)), seconds=3)
        assert "no command on `/cmd_vel` has a linear.x other than 0" in failing(
            "motion.slows_down", run
        )

    def test_driving_backwards_is_named(self):
        student = Student(BEHIND)

        def by_dx(pose):
            speed, turn = student(pose)
            return math.copysign(speed, BEHIND[0] - pose.x_m), turn

        run = drive(on_odometry(by_dx), seconds=20)
        said = failing("motion.path_length", run, goal=yaml(BEHIND), most="180 %")
        assert "at -0.22 m/s" in said and "math.hypot(dx, dy), which is never negative" in said

    def test_a_loop_in_the_callback(self):
        interrupted = (
            "Traceback (most recent call last):\n"
            '  File "/opt/ros/jazzy/lib/site-packages/rclpy/executors.py", line 9, in f\n'
            "    await call_coroutine()\n"
            f'  File "{INSTALLED}", line 14, in odom_callback\n'
            "    time.sleep(0.1)\n"
            "KeyboardInterrupt"
        )
        run = drive(lambda _: (0.2, 1.0), seconds=30)
        run = replace(run, log=output(interrupted, time_s=30.0))
        said = failing("motion.path_length", run, goal=yaml(GOAL), most="40 %")
        assert "`odom_callback` does not return: it is in line 14, `time.sleep(0.1)`" in said
        assert "Do one short step and return" in said

    def test_turns_a_little_too_little(self):
        run = run_to(GOAL, straight=0.08)
        said = failing("motion.reaches", run, goal=yaml(GOAL), position="0.1 m", heading="0.03 rad")
        assert "below the tolerance" in said and "Print yaw" in said

    def test_ends_a_little_before_the_goal(self):
        run = run_to(GOAL)
        said = failing("motion.reaches", run, goal=yaml(GOAL), position="0.03 m", heading="0.1 rad")
        assert "cm from the goal" in said and "below the tolerance" in said

    @pytest.mark.parametrize(
        ("goal", "words"),
        [
            ((GOAL[1], GOAL[0], GOAL[2]), "x and y swapped"),
            ((GOAL[0], -GOAL[1], GOAL[2]), "the sign of y changed"),
            ((GOAL[0], GOAL[1], -GOAL[2]), "counter-clockwise is positive"),
            ((0.4, 0.2, 0.0), "came to rest at (0.3"),
        ],
    )
    def test_another_goal_is_reported(self, goal, words):
        run = run_to((*goal[:2], wrap(goal[2])))
        assert words in failing("motion.reaches", run, goal=yaml(GOAL), **REACHES)

    def test_counted_from_the_start(self):
        start = (0.4, -0.3, 1.0)
        run = run_to((start[0] + GOAL[0], start[1] + GOAL[1], GOAL[2]), start)
        said = failing("motion.reaches", run, goal=yaml(GOAL), **REACHES)
        assert "measured from where the robot started" in said

    def test_a_robot_that_is_too_slow_is_reported(self):
        run = run_to(GOAL, linear=0.02, seconds=20)
        assert (
            "if it drives to the goal, it is too slow"
            in failing("motion.reaches", run, goal=yaml(GOAL), **REACHES).lower()
        )

    def test_a_robot_that_never_stops_turning_is_reported(self):
        run = run_to(GOAL, align_law=lambda _: 0.5, straight=0.0, seconds=30)
        said = failing("motion.reaches", run, goal=yaml(GOAL), **REACHES)
        assert "still turns at 0.5 rad/s" in said or "not at rest" in said
        said = failing("motion.settles", run, within="20 s")
        assert "after 29.99 s it is not at rest when the observation ends" in said

    def test_straight_past_the_goal_is_no_second_phase(self):
        """It drives 5 cm past the goal at (0.6, 0) and aligns there."""

        def law(pose):
            if pose.x_m < 0.65:
                return 0.1, 0.0
            error = wrap(1.5 - pose.yaw_rad)
            return 0.0, 0.0 if abs(error) < 0.05 else 1.5 * error

        goal = (0.6, 0.0, 1.5)
        found = lost(drive(on_odometry(law), seconds=20), goal)
        assert list(found) == ["motion.overshoot"]

    def test_the_overshoot_in_the_text_is_that_of_the_plot_at_the_moment(self):
        run = drive(on_odometry(lambda pose: (0.2 if pose.x_m < 0.7 else 0.0, 0.0)), seconds=20)
        found = judge("motion.overshoot", run, goal=yaml((0.6, 0.0, 0.0)), most="2 cm")
        (plot,), (moment,) = found.evidence.plots, found.evidence.moments
        most = max(plot.y)
        assert plot.y_label == "past the goal (m)"
        assert found.observed == moment.label == f"{most:.3g} m past the goal"
        assert moment.time_s == plot.x[plot.y.index(most)]
        assert plot.band == (-math.inf, 0.02)

    def test_a_detour_is_measured(self):
        run = run_to((-0.8, 0.1, 0.0), angular=0.5, linear=0.3, seconds=60)
        said = failing("motion.path_length", run, goal=yaml((-0.8, 0.1, 0.0)), most="20 %")
        assert "longer" in said and "turn to the goal at once" in said

    def test_a_callback_that_sleeps_while_the_robot_turns(self):
        student, until_s = Student(GOAL), [0.0]

        def law(senses):
            if senses.odometry is None or senses.time_s < until_s[0]:
                return None
            said = student(senses.odometry.pose)
            if student.arrived and said[1]:
                until_s[0] = senses.time_s + 10.0
            return said

        run = drive(law, seconds=30)
        for check, parameters in (
            ("motion.reaches", {"goal": yaml(GOAL), **REACHES}),
            ("motion.settles", {"within": "20 s"}),
            ("motion.short_way", {"goal": yaml(GOAL)}),
        ):
            said = failing(check, run, **parameters)
            assert "no command came for 10" in said and "time.sleep()" in said
            assert "quaternion" not in said and "atan2" not in said

    def test_died_on_the_way(self):
        run = run_to(GOAL, seconds=3)
        run = simulated(
            run.truth,
            run.scene,
            messages=run.messages,
            processes=(died(1, 3.0),),
            log=output(traceback("ZeroDivisionError: float division by zero")),
        )
        for check, parameters in (
            ("motion.reaches", REACHES),
            ("motion.two_phases", {"position": "0.1 m"}),
        ):
            assert "ZeroDivisionError" in failing(check, run, goal=yaml(GOAL), **parameters)

    def test_leaving_at_the_goal_is_no_mistake_of_motion(self):
        run = run_to(GOAL)
        end_s = (run.truth[-1].time_ns - run.launched_ns) / 1e9
        run = simulated(
            run.truth, run.scene, messages=run.messages, processes=(died(0, end_s - 0.5),)
        )
        assert lost(run, GOAL) == {}

    def test_too_slow_by_what_the_machine_took(self):
        run = run_to(GOAL)
        took_s = len(run.truth) / 100 - 1.0
        run = simulated(
            run.truth, run.scene, messages=run.messages, disturbance=taken(0, 3.0, waited_s=0.8)
        )
        finding = judge("motion.settles", run, within=f"{took_s - 0.5} s")
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        failing("motion.settles", run, within=f"{took_s - 2.0} s")

    @pytest.mark.parametrize(("lost_s", "status"), [(0.8, Status.ERROR), (0.1, Status.FAILED)])
    def test_a_detour_is_excused_by_as_much_as_the_machine_took(self, lost_s, status):
        goal = (-0.8, 0.1, 0.0)
        run = run_to(goal, angular=0.5, linear=0.3, seconds=60)
        steps = list(zip(run.truth, run.truth[1:], strict=False))
        gone_m = sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in steps)
        # At 0.22 m/s it goes 0.18 m in 0.8 s, and has to come back: more than these 0.2 m.
        most = (gone_m - 0.2) / math.hypot(0.8, 0.1) - 1.0
        run = simulated(
            run.truth, run.scene, messages=run.messages, disturbance=taken(0, 3.0, waited_s=lost_s)
        )
        finding = judge("motion.path_length", run, goal=yaml(goal), most=f"{100 * most} %")
        assert (finding.status, finding.disturbed) == (status, status is Status.ERROR)

    @pytest.mark.parametrize(("lost_s", "status"), [(0.4, Status.ERROR), (0.1, Status.FAILED)])
    def test_a_way_past_the_goal_is_excused_by_as_much_as_the_machine_took(self, lost_s, status):
        # At 0.2 m/s it goes 0.1 m past the goal: 0.06 m more than it may, which are 0.3 s.
        run = drive(on_odometry(lambda pose: (0.2 if pose.x_m < 0.69 else 0.0, 0.0)), seconds=20)
        arrives_s = next(run.since_launch_s(step.time_ns) for step in run.truth if step.x_m > 0.55)
        stall = taken(arrives_s, arrives_s + 0.5, waited_s=lost_s)
        late = simulated(run.truth, run.scene, messages=run.messages, disturbance=stall)
        finding = judge("motion.overshoot", late, goal=yaml((0.6, 0.0, 0.0)), most="4 cm")
        assert (finding.status, finding.disturbed) == (status, status is Status.ERROR)
        early = taken(0, 1.0, waited_s=lost_s)
        early = simulated(run.truth, run.scene, messages=run.messages, disturbance=early)
        finding = judge("motion.overshoot", early, goal=yaml((0.6, 0.0, 0.0)), most="4 cm")
        assert finding.status is Status.FAILED

    def test_only_the_speed_at_which_it_passes_the_goal_explains_how_far(self):
        def command(pose):
            return (0.2 if pose.x_m < 0.3 else 0.05 if pose.x_m < 0.69 else 0.0, 0.0)

        # Kept back for 0.4 s at 0.05 m/s, it goes 0.02 m: of the way before, nothing is left.
        run = drive(on_odometry(command), seconds=20)
        arrives_s = next(run.since_launch_s(step.time_ns) for step in run.truth if step.x_m > 0.55)
        stall = taken(arrives_s, arrives_s + 0.5, waited_s=0.4)
        late = simulated(run.truth, run.scene, messages=run.messages, disturbance=stall)
        finding = judge("motion.overshoot", late, goal=yaml((0.6, 0.0, 0.0)), most="4 cm")
        assert finding.status is Status.FAILED


def test_a_goal_at_the_start_was_not_reached_before_it_was_left():
    run = drive(on_odometry(lambda pose: (0.2 if pose.x_m < 0.5 else 0.0, 0.0)))
    said = failing("motion.reaches", run, goal=[0, 0, 0], position="0.1 m")
    assert "m from the goal" in said
    assert "drove on" not in said
    moving = drive(on_odometry(lambda pose: (0.2, 0.0)), seconds=3.0)
    said = failing("motion.reaches", moving, goal=[0, 0, 0], position="0.1 m")
    assert "farther than at the start" not in said


def test_a_robot_that_stands_because_it_refused_a_command_was_not_stopped():
    speeds = {"goal": [0.5, 0, 0], "position": "0.1 m"}
    stops, refuses = (
        drive(on_odometry(lambda pose, end=end: (0.2 if pose.x_m < 0.48 else end, 0.0)))
        for end in (0.0, math.nan)
    )
    assert judge("motion.reaches", stops, **speeds).status is Status.PASSED
    assert "were not finite" in failing("motion.reaches", refuses, **speeds)


def test_what_it_does_after_it_was_at_the_goal_is_no_turn_on_its_way():
    run = drive(
        on_odometry(lambda pose: (0.2, 0.0) if pose.x_m < 1.0 else (0.0, 1.0)), seconds=25.0
    )
    said = failing("motion.reaches", run, goal=[0.5, 0, 0], position="0.1 m")
    assert "and drove on" in said
    assert "full turns" not in said


def test_a_robot_that_only_sees_gets_no_advice_about_odometry():
    run = drive(on_timer(0.1, lambda _: (0.0, 1.0)), seconds=25.0)
    camera = senses("/camera/image_raw", "sensor_msgs/msg/Image")
    seeing, told = replace(run, endpoints=camera), (*camera, *senses("/odom", ODOMETRY))
    reaches = {"goal": [0.5, 0, 0], "position": "0.1 m"}
    assert "yaw" not in failing("motion.reaches", seeing, **reaches)
    assert "yaw" in failing("motion.reaches", replace(run, endpoints=told), **reaches)


def test_drive_plain_silence_says_why():
    run = drive(lambda _: None, seconds=2)
    for name, parameters in checks(GOAL).items():
        if name.startswith("motion") and name != "motion.within_limits":
            assert "the robot never moved" in failing(name, run, **parameters)


def test_a_robot_that_turns_the_long_way_and_never_rests_gets_the_advice_to_normalise_the_error():
    run = run_to(BEHIND, seconds=30.0, wrap=lambda error: error)
    finding = judge("motion.path_length", run, goal=yaml(BEHIND), position="8 cm", most="180 %")
    assert finding.status is Status.FAILED
    assert "turned away from the goal, the long way round, 10 times" in finding.observed
    assert "atan2(sin(e), cos(e))" in finding.hint


@pytest.mark.parametrize(
    ("yaw", "words", "hint"),
    [
        # (w, x, y, z) taken for (x, y, z, w): of a robot on the ground that is always 0.
        (lambda _: 0.0, "as if yaw were always 0", "x, y, z, w"),
        (math.degrees, "as if yaw were in degrees", "radians"),
        (lambda yaw: yaw / 2, "as if yaw were half of the true yaw", "2 * atan2(z, w)"),
        (lambda yaw: math.sin(yaw / 2), "as if yaw were z of the quaternion", "half the angle"),
        (lambda yaw: -yaw, "with the wrong sign", "Counter-clockwise"),
    ],
)
@pytest.mark.parametrize("style", [{}, {"wrap": lambda error: error}, {"spin": 1.0}])
def test_a_yaw_that_was_read_wrongly_is_named(yaw, words, hint, style):
    goal = (0.5, -0.5, math.pi / 2)
    finding = judge("motion.reaches", run_to(goal, yaw=yaw, **style), goal=yaml(goal), **REACHES)
    assert finding.status is Status.FAILED
    assert words in finding.observed
    assert hint in finding.hint


def test_a_robot_that_turns_on_and_on_gets_the_advice_to_look_at_its_yaw():
    """Its commands follow nothing, and say nothing of what it took for its yaw."""
    run = run_to((0.6, 0.4, 1.0), law=lambda error: 0.5 + 0.1 * math.sin(20.0 * error))
    finding = judge("motion.reaches", run, goal=yaml((0.6, 0.4, 1.0)), **REACHES)
    assert "Print yaw, the error and the command while it turns" in finding.hint


def test_a_yaw_that_knows_half_of_the_circle_is_named():
    goal = (-0.6, 0.15, 0.0)
    run = run_to(goal, yaw=lambda yaw: math.asin(math.sin(yaw)))
    finding = judge("motion.reaches", run, goal=yaml(goal), **REACHES)
    assert "as if yaw were always between -90° and 90°" in finding.observed
