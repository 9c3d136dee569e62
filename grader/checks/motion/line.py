"""The check of following a line on the floor."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.motion.robot_check import RobotParameters, moved_in
from grader.checks.need import OfSimulator, SimulatedRobot
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Finding, evidence_at
from grader.findings.words import metres, percent
from grader.measure.motion.floor_line import distance_m, followed_m, length_m
from grader.measure.motion.track import STRIDE, over_time
from grader.recording.model import Recording
from grader.spec.quantity import PositiveLength, Ratio


class FollowsLine(RobotParameters):
    """Parameters of motion.follows_line."""

    needs = (SimulatedRobot(), OfSimulator("map"))

    line: int = Field(0, ge=0, description="Which of the `lines` of the world file, from 0 on.")
    distance: PositiveLength = Field(
        0.1, description="How far the middle of the robot may be from the middle of the line."
    )
    share: Ratio = Field(
        0.95, le=1.0, description="Share of the line that it follows, from its first point on."
    )

    def _asked(self) -> str:
        return (
            f"stays within {metres(self.distance)} of the line on the floor, along "
            f"{percent(self.share)} of it"
        )


@check("motion.follows_line", Subject.RECORDING, FollowsLine)
def follows_line(recording: Recording, parameters: FollowsLine) -> Finding:
    """The robot follows the line on the floor.

    Judged by the true position of its middle: it stays near the line while it comes along it, from
    the first point on. Where a line crosses itself, it has to go on straight ahead. What it does
    at the end is judged by motion.reaches.
    """
    lines, within_m = moved_in(recording).lines, parameters.distance
    if parameters.line >= len(lines):
        return Finding.ours(f"the world has no line {parameters.line}: it has {len(lines)}")
    line, truth = lines[parameters.line], recording.truth[::STRIDE]
    plot = over_time(
        recording,
        "Distance to the line",
        "distance (m)",
        lambda step: distance_m(line, step),
        (0.0, within_m),
    )
    off_m = [distance_m(line, step) for step in truth]
    # Index of the step at which it left the line; None if it never did.
    left = next((index for index, far_m in enumerate(off_m) if far_m > within_m), None)
    whole_m = length_m(line)
    done_m = max(followed_m(line, truth[:left], within_m), default=0.0)
    farthest_m = max(off_m[:left], default=0.0)
    seen = (
        f"it followed {metres(done_m)} of {metres(whole_m)}, at most {metres(farthest_m)} off "
        "the line"
    )
    if left is None:
        evidence = evidence_at(recording, "the run ended", truth[-1].time_ns, plot)
    else:
        evidence = evidence_at(recording, "it left the line", truth[left].time_ns, plot)
    if done_m >= parameters.share * whole_m:
        return Finding.as_asked(seen, evidence)
    deeper = why_off_course(recording)
    if deeper is not None:
        return deeper
    if left is None:
        return mistaken("line_not_followed", seen, evidence)
    return mistaken(
        "leaves_line",
        f"it left the line after {metres(done_m)} of {metres(whole_m)}, and was up to "
        f"{metres(max(off_m))} from it",
        evidence,
    )
