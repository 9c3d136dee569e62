"""Why the goal pose was not reached: the place, the way, or the heading."""

from __future__ import annotations

import math
from itertools import pairwise

from grader.checks.finding import Evidence, Moment
from grader.checks.first_seen import until_the_end
from grader.checks.motion.approach import NO_SPEED_M_S, Approach
from grader.checks.motion.contact import why_touched
from grader.checks.motion.detour import WRAP_HINT, away
from grader.checks.motion.lateness import stolen_s
from grader.checks.motion.measure import degrees, metres, point, speed, turn
from grader.checks.motion.track import is_at_rest, turned_rad, turns_one_way
from grader.diagnosis.cause import Cause
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.diagnosis.motion.no_motion import why_cut_short
from grader.diagnosis.motion.off_course import why_off_course, why_unsteered
from grader.diagnosis.process.blocked_executor import stuck_callback
from grader.recording.model import NS, Ending, Truth
from grader.spec.unit import format_duration
from sim.motion import wrap_angle

_WEAVES = 4
# Share of the way: who ends so near the goal knows where it is.
_A_LITTLE = 0.25
# As far from the heading of the goal, in rad, as a tolerance may reasonably leave it.
_A_LITTLE_RAD = 0.15
_STRAIGHT_RAD_S = 0.02
_ASTRAY_RAD = math.radians(30.0)
# So long after it was there a node may see it at the latest: odometry, a timer of 10 Hz, and some
# of the machine's doing.
_SEEN_LATE_NS = 300 * NS // 1000
# How far from the heading that it was sent to a robot rests: the default of angle_tolerance.
_AS_SENT_RAD = 0.06
# An error of angle that a proportional controller has done away with.
_EXACTLY_RAD = 3e-3
_YAW_HINT = (
    "Print yaw while it turns: it has to go with the robot, from -pi to pi. A quaternion in ROS is "
    "x, y, z, w; yaw = atan2(2 (w z + x y), 1 - 2 (y y + z z)), and z alone is no angle."
)


def why_not_there(run: Approach, position_m: float) -> Cause | None:
    """Why the robot is not at the goal's position in the end; None if it is."""
    truth = run.truth
    last = truth[-1]
    left_m = run.distance_m(last)
    if left_m <= position_m:
        return None
    deeper = why_cut_short(run.recording) or why_touched(run.recording)
    if deeper is not None:
        return deeper
    nearest = min(range(len(truth)), key=lambda i: run.distance_m(truth[i]))
    nearest_m = run.distance_m(truth[nearest])
    evidence = Evidence(
        moments=(
            Moment("nearest to the goal", run.recording.since_launch_s(truth[nearest].time_ns)),
        ),
        plots=(run.distance_plot,),
    )
    if is_at_rest(last):
        seen = f"came to rest at {point(last.x_m, last.y_m)}, {metres(left_m)} from the goal"
        words, hint = _wrong_place(run, position_m) or (
            (
                f"it had been there, {metres(nearest_m)} near, and drove on",
                "Compare the distance in every callback, and stop where it is small.",
            )
            if nearest_m <= position_m
            else (
                "it ended a little before it",
                "Compare the distance, math.hypot(dx, dy) in metres, with the tolerance as it is "
                "now asked for, and drive on until it is smaller.",
            )
            if left_m <= _A_LITTLE * run.distance_m(truth[0])
            else (
                "",
                "Is goal_x, goal_y what your node reads? The distance is "
                "math.hypot(goal_x - x, goal_y - y).",
            )
        )
        return Cause(f"{seen}: {words}" if words else seen, hint, evidence)
    return _still_moving(run, position_m, nearest_m, evidence)


def _still_moving(run: Approach, position_m: float, nearest_m: float, evidence: Evidence) -> Cause:
    truth, recording = run.truth, run.recording
    last = truth[-1]
    left_m = run.distance_m(last)
    lost_s = stolen_s(recording, truth[0].time_ns, truth[-1].time_ns)
    watched_s = (truth[-1].time_ns - truth[0].time_ns) / NS
    seen = f"is still {metres(left_m)} from the goal when the observation ends"
    if lost_s > 0.25 * watched_s and recording.ending is Ending.TIMEOUT:
        return Cause.to_repeat(
            f"{seen}; the machine took up to {format_duration(lost_s)} of "
            f"{format_duration(watched_s)} from the run"
        )
    unsteered = why_unsteered(recording)
    if unsteered is not None:
        return unsteered.after(seen)
    moving = f"at {speed(last.linear_m_s)} and {turn(last.angular_rad_s)}"
    stuck = stuck_callback(recording)
    if stuck is not None:
        return Cause(
            f"{seen}, {moving}: a callback was at {stuck.file}:{stuck.line} when it was "
            "interrupted",
            "A loop in a callback never sees newer odometry, because the next message waits for "
            "its end: compute one command for each, publish it and return.",
            Evidence(evidence.moments, (stuck,), plots=evidence.plots),
        )
    misread = misread_yaw(run, position_m)
    if misread is not None:
        return Cause(f"{seen}: {misread}", misread.hint, evidence)
    far = [step for step in truth if run.distance_m(step) > position_m]
    detours = list(away(far, run.bearing_error_rad, _ASTRAY_RAD, "the goal"))
    turns = abs(turned_rad(truth)) / math.tau
    if detours or turns >= 1.5:
        times = "once" if len(detours) == 1 else f"{len(detours)} times"
        turned = (
            f"on its way it turned away from the goal through half a turn, {times}"
            if detours
            else f"it turned {turns:.1f} times around"
        )
        return Cause(
            f"{seen}: {turned}",
            "Print yaw, the error and the command while it turns. Yaw goes with the robot, from "
            f"-pi to pi; the error is atan2(dy, dx) - yaw. {WRAP_HINT}",
            evidence,
        )
    if nearest_m <= position_m:
        return Cause(
            f"{seen}: it had been there, {metres(nearest_m)} near, and drove on {moving}",
            "Stop where the distance is below your tolerance: publish linear.x = 0.0.",
            evidence,
        )
    began_m = run.distance_m(truth[0])
    if left_m > began_m and last.linear_m_s < 0.0:
        return Cause(
            f"{seen}, farther than at its start ({metres(began_m)}): it drives backwards, {moving}",
            "linear.x is negative: it is a gain times the distance math.hypot(dx, dy), which never "
            "is, and not times dx. Turn towards the goal, also where dx is negative.",
            evidence,
        )
    if left_m > began_m and _keeps_the_heading(run):
        return Cause(
            f"{seen}, farther than at its start ({metres(began_m)}): it has turned to the heading "
            f"that it is to have at the goal, and drives that way, {moving}",
            "On the way the error is the direction to the goal, math.atan2(dy, dx) - yaw; only at "
            "the goal it is goal_theta - yaw.",
            evidence,
        )
    if left_m > began_m:
        return Cause(
            f"{seen}, farther than at its start ({metres(began_m)}), {moving}",
            "Print the direction of the goal, yaw and the command while it drives. The direction "
            "changes with the position: it is atan2(dy, dx), dy first, with dx = goal_x - x, and "
            "not atan(dy / dx). A positive error turns left.",
            evidence,
        )
    if _weaves(run):
        return Cause(
            f"{seen}: it weaves from side to side, {moving}",
            "The angular gain is too large for the delay of odometry: make it smaller.",
            evidence,
        )
    return Cause(
        f"{seen}, {moving}, after {format_duration(watched_s)}",
        "If it is on its way, it is too slow: a larger gain, within the limits of the robot.",
        evidence,
    )


def _circling(turns: float) -> str:
    side = "left" if turns > 0.0 else "right"
    return f"it turned {abs(turns):.1f} times around, always to the {side}"


def _keeps_the_heading(run: Approach) -> bool:
    """Whether it has turned to the heading of the goal, and drives on with it."""
    last, first = run.truth[-1], run.truth[0]
    return (
        _drives_straight(last)
        and abs(run.heading_error_rad(last)) < _EXACTLY_RAD
        and abs(run.heading_error_rad(first)) > _A_LITTLE_RAD
    )


def _drives_straight(step: Truth) -> bool:
    return step.linear_m_s > NO_SPEED_M_S and abs(step.angular_rad_s) < _STRAIGHT_RAD_S


def _weaves(run: Approach) -> bool:
    """Whether the turn changes its sense again and again, with some force."""
    left = [step.angular_rad_s > 0.0 for step in run.truth if abs(step.angular_rad_s) > 0.3]
    return sum(a != b for a, b in pairwise(left)) >= _WEAVES


def _wrong_place(run: Approach, position_m: float) -> tuple[str, str] | None:
    """A classic place to go to instead of the goal."""
    goal, last, first = run.goal, run.truth[-1], run.truth[0]
    cos, sin = math.cos(first.yaw_rad), math.sin(first.yaw_rad)
    frame = (
        "that is the goal counted from where the robot started",
        "The goal is in the frame of odometry: subtract the position that odometry reports.",
    )
    swapped = "x and y are swapped", "goal_x belongs to position.x; atan2 takes y first."
    sign = "Look at the signs: dx = goal_x - x, dy = goal_y - y."
    places: tuple[tuple[float, float, tuple[str, str]], ...] = (
        (first.x_m + goal.x_m, first.y_m + goal.y_m, frame),
        (
            first.x_m + cos * goal.x_m - sin * goal.y_m,
            first.y_m + sin * goal.x_m + cos * goal.y_m,
            frame,
        ),
        (goal.y_m, goal.x_m, swapped),
        (goal.x_m, -goal.y_m, ("that is the goal with the sign of y changed", sign)),
        (-goal.x_m, goal.y_m, ("that is the goal with the sign of x changed", sign)),
        (-goal.x_m, -goal.y_m, ("that is the goal with both signs changed", sign)),
    )
    for x_m, y_m, words in places:
        if math.hypot(goal.x_m - x_m, goal.y_m - y_m) > 2.0 * position_m and (
            math.hypot(last.x_m - x_m, last.y_m - y_m) <= position_m
        ):
            return words
    pushed = next((item for item in run.recording.incidents if item.kind == "pushed"), None)
    if pushed is None:
        return None
    when_s = run.recording.since_launch_s(pushed.time_ns)
    return (
        f"it was pushed {when_s:.2f} s after launch, and what it commanded since leads elsewhere",
        "Compute every command from the newest odometry: what was commanded before does not tell "
        "where the robot is.",
    )


def why_not_aligned(run: Approach, position_m: float, heading_rad: float) -> Cause | None:
    """Why the robot does not look as the goal does in the end; None if it does."""
    last = run.truth[-1]
    off_rad = run.heading_error_rad(last)
    if abs(off_rad) <= heading_rad:
        return None
    deeper = why_off_course(run.recording)
    if deeper is not None:
        return deeper
    evidence = Evidence(
        moments=(until_the_end(run.recording),),
        plots=(run.heading_plot,),
    )
    seen = (
        f"is at the goal's position, but looks to {degrees(last.yaw_rad)} instead of "
        f"{degrees(run.goal.yaw_rad)}"
    )
    misread = misread_yaw(run, position_m)
    if misread is not None:
        return Cause(f"{seen}: {misread}", misread.hint, evidence)
    if not is_at_rest(last):
        circles = turns_one_way(run.truth)
        return Cause(
            f"{seen} and still turns at {turn(last.angular_rad_s)} when the observation ends"
            + (f": {_circling(circles)}" if circles else ""),
            f"{_YAW_HINT} {WRAP_HINT}"
            if circles
            else "angular.z is a gain times goal_theta - yaw, both in radians and wrapped, and 0 "
            "where that is within angle_tolerance: print all three while it turns.",
            evidence,
        )
    words, hint = _wrong_heading(run, heading_rad)
    return Cause(f"{seen}{words}", hint, evidence)


def _wrong_heading(run: Approach, heading_rad: float) -> tuple[str, str]:
    theta, last = run.goal.yaw_rad, run.truth[-1]
    radians = "Angles in ROS are radians (REP-103), and so is goal_theta already."
    headings = (
        (math.radians(theta), ": as if goal_theta were taken for degrees", radians),
        (math.degrees(theta), ": as if goal_theta were converted to degrees", radians),
        (
            -theta,
            ": that is the goal's heading with its sign changed",
            "Counter-clockwise is positive (REP-103): error = goal_theta - yaw.",
        ),
        (
            theta + math.pi,
            ": that is the opposite of the goal's heading",
            "Look at how you normalise the angle, and at the arguments of atan2(y, x).",
        ),
    )
    if (
        abs(last.yaw_rad) <= min(heading_rad, _AS_SENT_RAD)
        and abs(wrap_angle(headings[0][0])) <= heading_rad
    ):
        # Of a few radians so few degrees are left that nobody can tell them from 0.
        headings = (
            (
                0.0,
                ": as if goal_theta were 0, or were taken for degrees",
                f"{radians} Log the value that your node has read: that of a float parameter is "
                "parameter.value, or get_parameter_value().double_value.",
            ),
            *headings[1:],
        )
    for heading, words, hint in headings:
        if abs(wrap_angle(heading - theta)) > 2.0 * heading_rad and (
            abs(wrap_angle(heading - last.yaw_rad)) <= min(heading_rad, _AS_SENT_RAD)
        ):
            return words, hint
    driven = run.driven(math.inf)
    if driven is not None and abs(turned_rad(run.truth[driven:])) < heading_rad:
        return (
            ": it has not turned since it arrived",
            "Once the position is reached, angular.z is a gain times goal_theta - yaw: is this "
            "part of the code reached, and which command does it publish?",
        )
    passing_rad_s = _turning_past_rad_s(run)
    if passing_rad_s is not None:
        return (
            f": it still turned at {turn(passing_rad_s)} when it was there, and beyond it before "
            "it stood",
            "Your node sees it late, and the robot cannot stop at once. Make the angular gain "
            "smaller, or turn back where the error has become too large again.",
        )
    return (
        "",
        "Turn on until abs(goal_theta - yaw) is within angle_tolerance, in radians and as they "
        "were given, and print yaw: it comes from the quaternion, and nothing is added to it.",
    )


def _turning_past_rad_s(run: Approach) -> float | None:
    """How fast it turned where it came by the goal's heading, just before it was told to stand.

    None for one that did not come by, or that was not told to stand because of that.
    """
    turning = [index for index, step in enumerate(run.truth) if step.command_rad_s]
    if not turning or turning[-1] == len(run.truth) - 1:
        return None
    told_ns = run.truth[turning[-1] + 1].time_ns
    late = [step for step in run.truth if step.time_ns >= told_ns - _SEEN_LATE_NS]
    for before, after in pairwise(late):
        error_rad = run.heading_error_rad(before)
        if abs(error_rad) < _A_LITTLE_RAD and error_rad * run.heading_error_rad(after) < 0.0:
            return after.angular_rad_s
    return None
