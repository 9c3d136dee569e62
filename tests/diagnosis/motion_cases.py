"""Drives of the simulated robot, and the explanations that answer for them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from grader.recording.model import Ending, Qos, Recording
from tests.checks.builder import (
    INSTALLED,
    died,
    drive,
    endpoint,
    messages,
    on_odometry,
    on_scan,
    output,
    reader,
    senses,
    simulated,
    taken,
)
from tests.checks.test_motion_goal import BEHIND, GOAL, REACHES, Student, run_to, wrap, yaml
from tests.checks.test_motion_route import RIGHT_ANGLE, SQUARE, legs
from tests.checks.test_motion_stop import WALL, by_front

IN_A_CALLBACK = (
    "Traceback (most recent call last):\n"
    '  File "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/executors.py", line 9, in f\n'
    "    go()\n"
    f'  File "{INSTALLED}", line 14, in callback\n'
    "    time.sleep(0.1)\n"
    "KeyboardInterrupt"
)
Group = tuple[str, dict[str, Any], dict[str, Any]]
TO_GOAL = {"goal": yaml(GOAL), **REACHES}
RIGHT = (0.5, -0.5, 1.57)
SPEED = {"speed": "0.1 m/s"}


def still(**changes: Any) -> Recording:
    run = drive(lambda _: None, seconds=2)
    return simulated(run.truth, run.scene, **changes)


def ahead(command: float = 0.1, **more: Any) -> Recording:
    return drive(on_scan(lambda _: (command, 0.0)), world=WALL, seconds=12, **more)


def loop(run: Recording) -> Recording:
    return replace(run, log=output(IN_A_CALLBACK, time_s=30.0))


def asleep_at_the_goal() -> Recording:
    student, until_s = Student(GOAL), [0.0]

    def law(senses: Any) -> Any:
        if senses.odometry is None or senses.time_s < until_s[0]:
            return None
        command = student(senses.odometry.pose)
        if student.arrived and command[1]:
            until_s[0] = senses.time_s + 10.0
        return command

    return drive(law, seconds=30)


def slowed_by_the_machine() -> Recording:
    run = run_to(GOAL, seconds=4)
    return replace(run, ending=Ending.TIMEOUT, disturbance=taken(0, 4.0, waited_s=3.0))


def moves_at_the_end() -> Recording:
    return drive(lambda s: (0.1 if s.time_s > 1.975 else 0.0, 0.0), seconds=2)


def asks_weakly() -> Recording:
    weak = endpoint(qos=Qos(reliability="best_effort"))
    return still(messages=messages([0.6, 0.8]), endpoints=(weak, reader()))


def without_scans() -> Recording:
    return drive(by_front(), world=WALL, seconds=12, options={"lidar": {"stops": "3 s"}})


def holds_its_command() -> Recording:
    def law(senses: Any) -> Any:
        return (0.1, 0.0) if senses.new_scan and senses.time_s < 1.0 else None

    return drive(law, world=WALL, seconds=12)


def one_direction() -> Recording:
    law = on_odometry(lambda pose: (0.22, 1.5 * wrap(0.56 - pose.yaw_rad)))
    return drive(law, seconds=30)


CASES: list[Group] = [
    (
        "motion.drives",
        SPEED,
        {
            "NotMoved.process_ended": lambda: still(processes=(died(1),)),
            "NotMoved.nothing_published": still,
            "NotMoved.not_finite": lambda: ahead(math.nan),
            "NotMoved.robot_not_matched": asks_weakly,
            "NotMoved.only_zeros": lambda: ahead(0.0),
            "NotMoved.integer_in_command": lambda: ahead(5e-324),
            "NotMoved.moves_too_late": moves_at_the_end,
        },
    ),
    (
        "motion.no_contact",
        {},
        {
            "Contact.no_scan_for_long": without_scans,
            "Contact.old_command": holds_its_command,
            "Contact.callback_in_a_loop": lambda: loop(ahead()),
            "Contact.decided_to_drive": ahead,
        },
    ),
    (
        "motion.reaches",
        TO_GOAL,
        {
            "HeadingMissed.off_course": asleep_at_the_goal,
            "GoalMissed.off_course": lambda: replace(
                run_to(GOAL, seconds=3), processes=(died(1, 3.0),)
            ),
            "GoalMissed.no_cpu_time": slowed_by_the_machine,
            "GoalMissed.wrong_place": lambda: run_to((0.5, 0.8, 2.0)),
            "GoalMissed.stopped_elsewhere": lambda: run_to((0.4, 0.2, 0.0)),
            "GoalMissed.too_slow": lambda: run_to(GOAL, linear=0.02, seconds=20),
            "HeadingMissed.stopped_turning": lambda: run_to(GOAL, straight=0.3),
        },
    ),
    (
        "motion.visits",
        {"places": SQUARE},
        {
            "PlaceMissed.off_course": lambda: replace(
                legs(0.1, 0.3, RIGHT_ANGLE, 0.5), processes=(died(1, 3.0),)
            ),
            "PlaceMissed.skipped": lambda: legs(RIGHT_ANGLE / 2.0, 0.7),
            "PlaceMissed.turned_wrongly": lambda: legs(0.1, 0.5, -RIGHT_ANGLE, 0.5),
            "PlaceMissed.stopped_short": lambda: legs(0.1, 0.5, RIGHT_ANGLE, 0.2),
        },
    ),
    (
        "motion.visits",
        {"places": [[1.0, 0.0]]},
        {"PlaceMissed.not_near": lambda: legs(0.14, 1.2)},
    ),
    (
        "motion.path_length",
        {"goal": yaml(GOAL), "most": "40 %"},
        {
            "GoalMissed.loop_in_a_callback": lambda: loop(drive(lambda _: (0.2, 1.0), seconds=30)),
        },
    ),
    (
        "motion.reaches",
        {"goal": yaml(RIGHT), **REACHES},
        {
            "GoalMissed.yaw_misread": lambda: run_to(RIGHT, yaw=lambda _: 0.0),
            "HeadingMissed.heading_misread": lambda: run_to(RIGHT, yaw=lambda yaw: yaw / 2),
        },
    ),
    (
        "motion.path_length",
        {"goal": yaml(BEHIND), "position": "8 cm", "most": "180 %"},
        {
            "GoalMissed.angle_not_wrapped": lambda: run_to(
                BEHIND, seconds=30.0, wrap=lambda error: error
            ),
        },
    ),
    (
        "motion.reaches",
        {"goal": yaml((0.8, 0.0, 0.0)), **REACHES},
        {
            "GoalMissed.not_told_where": lambda: replace(
                drive(on_odometry(lambda pose: (0.2, 0.0)), seconds=10),
                endpoints=senses("/camera/image_raw", "sensor_msgs/msg/Image"),
            ),
            "GoalMissed.still_driving": lambda: drive(
                on_odometry(lambda pose: (0.2, 0.0)), seconds=3, environment={"bag": "square"}
            ),
            "GoalMissed.drove_on": lambda: drive(on_odometry(lambda pose: (0.2, 0.0)), seconds=10),
        },
    ),
    (
        "motion.path_length",
        {"goal": yaml(GOAL), "position": "2 cm", "most": "40 %"},
        {
            "GoalMissed.drives_away": one_direction,
        },
    ),
]
