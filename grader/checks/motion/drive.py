"""Checks of driving ahead: the speed, the way, and no curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby, takewhile
from statistics import median

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.robot_check import RobotParameters, at_the_end, moved_in
from grader.checks.need import OfSimulator, SimulatedRobot
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.no_motion import why_not_moved
from grader.diagnosis.motion.off_course import why_interrupted
from grader.diagnosis.wrong_value import factor_words
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.findings.words import counted, degrees, metres, percent, speed, turn
from grader.measure.motion.command import stolen_s
from grader.measure.motion.ground import ahead_m
from grader.measure.motion.scan import misreading
from grader.measure.motion.track import (
    MOVED_M,
    REST_M_S,
    departure,
    final_rest,
    gone_ahead_m,
    over_time,
    speed_plot,
    way_m,
)
from grader.recording.model import NS, Recording
from grader.recording.simulated import Scene, Truth
from grader.spec.quantity import Angle, AngularSpeed, PositiveLength, Ratio, Speed
from grader.spec.unit import format_duration
from sim.motion import wrap_angle

_LEAST_SHARE = 0.9
_LEAST_STEPS = 30
_SAME_SPEED = 0.05
# Besides what the robot needs to speed up, a node may bring its commands up in steps.
_IN_STEPS_S = 0.5
_WAY_TOLERANCE_M = 2e-3


class Drives(RobotParameters):
    """Parameters of motion.drives."""

    needs = (SimulatedRobot(commanded=True), OfSimulator("map", "until_distance"))

    speed: Speed = Field(description="Expected speed ahead.")
    tolerance: Ratio = Field(0.10, description="Largest error of the speed, as a share of it.")
    until_distance: PositiveLength | None = Field(
        None,
        description="The speed does not count while something straight ahead is nearer than this. "
        "By default it always counts.",
    )

    def _asked(self) -> str:
        how = f"{speed(self.speed)} (within {percent(self.tolerance)})"
        return f"drives at {how} while nothing is near ahead"


@check("motion.drives", Subject.RECORDING, Drives)
def drives(recording: Recording, parameters: Drives) -> Finding:
    """The robot drives ahead at the right speed.

    Judged by the true speed while nothing is near ahead. The robot has time to speed up: half a
    second more than its acceleration needs. The speed counts until it comes to rest for good. The
    median must be within `tolerance` of the expected speed, and so must the speed 90 % of the time.
    """
    wanted, share = parameters.speed, parameters.tolerance
    scene = moved_in(recording)
    low, high = sorted((wanted * (1.0 - share), wanted * (1.0 + share)))
    steps = _judged_steps(recording.truth, scene, parameters)
    if not steps:
        way = metres(way_m(recording.truth))
        seen = f"the robot drove only {way}, too little to judge its speed"
        cause = why_interrupted(recording)
        return cause or mistaken("little_way", seen, _since_departure(recording))
    begin_s, end_s = (recording.since_launch_s(step.time_ns) for step in (steps[0], steps[-1]))
    plot = replace(speed_plot(recording, (low, high)), judged=(begin_s, end_s))
    median_m_s = median(step.linear_m_s for step in steps)
    wrong = [step for step in steps if not low <= step.linear_m_s <= high]
    right = (len(steps) - len(wrong)) / len(steps)
    seen = f"median {speed(median_m_s)}; the speed is right for {percent(round(right, 3))} of "
    seen += "the time"
    if low <= median_m_s <= high:
        if right >= _LEAST_SHARE:
            return Finding.as_asked(seen, Evidence(plots=(plot,)))
        stop_if(why_interrupted(recording))
    words, mistake = _wrong_speed(steps, scene, wanted, median_m_s)
    first = wrong[0] if wrong else steps[0]
    evidence = evidence_at(recording, "first at a wrong speed", first.time_ns, plot)
    return mistaken(mistake, f"{seen}: {words}", evidence)


def _judged_steps(truth: Sequence[Truth], scene: Scene, parameters: Drives) -> list[Truth]:
    """The steps in which the speed counts; none if they are too few to judge."""
    begin = departure(truth)
    if begin is None:
        return []
    speeding_up_s = _IN_STEPS_S + abs(parameters.speed) / scene.acceleration_m_s2
    since_ns = truth[begin].time_ns + round(speeding_up_s * NS)
    driving = takewhile(lambda step: step.contact is None, truth[begin : _braking(truth, begin)])
    steps = [
        step
        for step in driving
        if step.time_ns >= since_ns and not _is_near(scene, step, parameters.until_distance)
    ]
    return steps if len(steps) >= _LEAST_STEPS else []


def _braking(truth: Sequence[Truth], begin: int) -> int:
    """Index of the step in which braking before the final rest begins: motion.stops judges that."""
    end = final_rest(truth)
    if end is None:
        return len(truth)
    while end > begin and not truth[end - 1].command_m_s:
        end -= 1
    return end


def _is_near(scene: Scene, step: Truth, until_m: float | None) -> bool:
    """Whether something straight ahead is so near that the speed does not count."""
    if until_m is None:
        return False
    distance_m = ahead_m(scene, step)
    return distance_m is not None and distance_m < until_m


def _wrong_speed(
    steps: Sequence[Truth], scene: Scene, wanted: float, median_m_s: float
) -> tuple[str, str]:
    """What is wrong with the speed, in words, and the name of the mistake."""
    if abs(median_m_s) < REST_M_S and any(abs(step.angular_rad_s) > 0.01 for step in steps):
        return "the robot turns on the spot instead of driving", "other_field"
    pauses = sum(is_pause for is_pause, _ in groupby(steps, _is_pause))
    if pauses:
        return f"the robot paused in between, {counted(pauses, 'time')}", "pauses"
    command, limit = median(step.command_m_s for step in steps), scene.max_linear_m_s
    if abs(command) > limit * 1.001 and abs(median_m_s) > limit * 0.98:
        words = f"{speed(command)} was commanded, and the robot can do no more than {speed(limit)}"
        times = factor_words(command, wanted)
        return f"{words}: the command {times}" if times else words, "other_field"
    slowest, fastest = min(s.linear_m_s for s in steps), max(s.linear_m_s for s in steps)
    varies = fastest - slowest > _SAME_SPEED * abs(median_m_s)
    if varies and speed(slowest) != speed(fastest):
        return f"it varies from {speed(slowest)} to {speed(fastest)}", "other_speed"
    if median_m_s * wanted < 0.0:
        return "it drives the wrong way", "other_speed"
    pace = "slowly" if abs(median_m_s) < abs(wanted) else "fast"
    return f"it drives too {pace}", "other_speed"


def _is_pause(step: Truth) -> bool:
    return abs(step.linear_m_s) < REST_M_S or not step.command_m_s


class KeepsDriving(RobotParameters):
    """Parameters of motion.keeps_driving."""

    needs = (SimulatedRobot(commanded=True),)

    distance: PositiveLength = Field(description="Least forward distance, along its path.")

    def _asked(self) -> str:
        why = "because nothing is near ahead"
        return f"drives {metres(self.distance)} ahead without stopping, {why}"


@check("motion.keeps_driving", Subject.RECORDING, KeepsDriving)
def keeps_driving(recording: Recording, parameters: KeepsDriving) -> Finding:
    """The robot drives on while nothing is ahead.

    Judged by the forward distance along its true path, minus what it drives backwards.
    """
    stop_if(why_not_moved(recording))
    gone_m = gone_ahead_m(recording.truth)
    if gone_m >= parameters.distance - _WAY_TOLERANCE_M:
        evidence = Evidence(plots=(speed_plot(recording),))
        return Finding.as_asked(f"went {metres(gone_m)} ahead", evidence)
    return why_interrupted(recording) or _why_not_ahead(recording, gone_m)


def _why_not_ahead(recording: Recording, gone_m: float) -> Finding:
    truth = recording.truth
    if way_m(truth) < MOVED_M:
        words = "the robot only turned on the spot"
        return mistaken("other_field", words, _since_departure(recording))
    if gone_m < -_WAY_TOLERANCE_M:
        words = f"the robot drove {metres(-gone_m)} backwards"
        return mistaken("other_field", words, _since_departure(recording))
    rest = final_rest(truth)
    if rest is None:
        return _too_slow(recording, gone_m)
    when_s = recording.since_launch_s(truth[rest].time_ns)
    misread = misreading(recording, truth[rest])
    evidence = evidence_at(
        recording, "the robot stopped", truth[rest].time_ns, speed_plot(recording)
    )
    seen = f"stopped after {metres(gone_m)} in all"
    if misread is not None:
        return mistaken("misread_scan", f"{seen}: {misread.words}", evidence, hint=misread.hint)
    return mistaken("stopped", f"{seen}, {when_s:.2f} s after launch", evidence)


def _too_slow(recording: Recording, gone_m: float) -> Finding:
    truth = recording.truth
    begin = departure(truth) or 0
    driven_s = (truth[-1].time_ns - truth[begin].time_ns) / NS
    waited_s = (truth[begin].time_ns - truth[0].time_ns) / NS
    average = way_m(truth) / driven_s if driven_s else 0.0
    lost_s = stolen_s(recording, truth[0].time_ns, truth[-1].time_ns)
    words = (
        f"was still on its way when the observation ended: {metres(gone_m)} in all, at "
        f"{speed(average)} on average; it had set off after {format_duration(waited_s)}"
    )
    if lost_s > 0.25 * (driven_s + waited_s):
        return Finding.held_up(words, lost_s)
    return mistaken("other_field", words, at_the_end(recording, "the observation ended"))


def _since_departure(recording: Recording) -> Evidence:
    """The speed, and when the robot set off."""
    truth = recording.truth
    begin = truth[departure(truth) or 0]
    return evidence_at(recording, "set off", begin.time_ns, speed_plot(recording))


class Straight(RobotParameters):
    """Parameters of motion.straight."""

    needs = (SimulatedRobot(commanded=True),)

    tolerance: AngularSpeed = Field(
        0.01, description="Largest angular.z that still counts as zero, in both directions."
    )
    heading: Angle = Field(
        0.035, description="Largest change of the heading since the start, in both directions."
    )

    def _asked(self) -> str:
        return f"drives straight: angular.z is zero (within {turn(self.tolerance)})"


@check("motion.straight", Subject.RECORDING, Straight)
def straight(recording: Recording, parameters: Straight) -> Finding:
    """The robot drives straight ahead.

    Judged by the active commands and by the true heading: `angular.z` is always zero, and the
    heading stays the same as at the start.
    """
    stop_if(why_not_moved(recording))
    truth = recording.truth
    plot = over_time(
        recording,
        "Commanded turn",
        "angular.z (rad/s)",
        lambda step: step.command_rad_s,
        (-parameters.tolerance, parameters.tolerance),
    )
    turning = [step for step in truth if abs(step.command_rad_s) > parameters.tolerance]
    if turning:
        worst = max((step.command_rad_s for step in turning), key=abs)
        when_s = recording.since_launch_s(turning[0].time_ns)
        return mistaken(
            "turn_commanded",
            f"angular.z = {turn(worst)} was commanded (from {when_s:.2f} s after launch, "
            f"{percent(len(turning) / len(truth))} of the time)",
            evidence_at(recording, "first turn commanded", turning[0].time_ns, plot),
        )
    turned = [wrap_angle(step.yaw_rad - truth[0].yaw_rad) for step in truth]
    off_rad = max(turned, key=abs)
    if abs(off_rad) > parameters.heading:
        first = next(i for i, angle in enumerate(turned) if abs(angle) > parameters.heading)
        return mistaken(
            "small_turns",
            f"the heading changed by {degrees(off_rad)}, through commands of less than "
            f"{turn(parameters.tolerance)} that add up",
            evidence_at(recording, "the heading is too far off", truth[first].time_ns, plot),
        )
    seen = f"heading within {degrees(off_rad)} of the start"
    return Finding.as_asked(seen, Evidence(plots=(plot,)))
