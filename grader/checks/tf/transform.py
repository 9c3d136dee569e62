"""Checks of one transform: static, or broadcast again and again, and where it is.

The transforms between two frames are judged as the messages of a topic of their own would be.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.messages.following import Follows as FieldsFollow
from grader.checks.messages.following import follows as fields_follow
from grader.checks.messages.messages import Equal, equal
from grader.checks.need import Need, Recorded, SimulatedRobot
from grader.checks.timing.timing import Rate, rate
from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.explanation import cause_of, explain
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.wrong_transform import BadTransform, NoTransform, edge, volatile_static
from grader.findings.fields import words
from grader.findings.finding import Finding
from grader.findings.wording import code
from grader.measure import transforms
from grader.measure.motion.quantities import degrees, metres
from grader.measure.transforms import Pose, Sent
from grader.recording.model import Message, Recording
from grader.spec.name import FrameName, TopicName
from grader.spec.quantity import Angle, Duration, Frequency, PositiveLength
from sim.coordinates import Position, RollPitchYaw

_RATE_TOLERANCE = 0.2
_NUMBERS = ("x", "y", "z", "roll", "pitch", "yaw")


class EdgeParameters(Parameters):
    """Base of the parameters of a check of one transform."""

    needs: ClassVar[tuple[Need, ...]] = (Recorded(),)

    parent: FrameName = Field(description="The parent frame, `header.frame_id`.")
    child: FrameName = Field(description="The child frame, `child_frame_id`.")
    topic: TopicName = Field("/tf", description="Topic of the transforms.")

    def found(self, recording: Recording, *, is_static: bool = False) -> list[Sent]:
        """The transforms; the check ends here if there is none, or tf2 cannot use one."""
        symptom = NoTransform(recording, self.topic, self.parent, self.child, is_static)
        mine = symptom.wanted
        stop_if(volatile_static(symptom) if mine else cause_of(symptom))
        heard = (*recording.messages.values(), *recording.sent.values())
        known = {transforms.stamp_of(one.value) for messages in heard for one in messages}
        for one in mine:
            stop_if(explain(BadTransform(recording, one, is_static or one.stamp_ns in known)))
        return mine

    @property
    def words(self) -> str:
        """The transform in words."""
        return f"{edge(self.parent, self.child)} on {code(self.topic)}"


class PlacedParameters(EdgeParameters):
    """Base of the parameters of a check of where a frame is."""

    tolerance: PositiveLength = Field(0.01, description="Largest error of x, y and z.")
    angle: Angle = Field(0.02, description="Largest error of the rotation.")


class Static(PlacedParameters):
    """Parameters of tf.static."""

    topic: TopicName = Field("/tf_static", description="Topic of the static transforms.")
    position: Position = Field((0.0, 0.0, 0.0), description="Where the child is in its parent.")
    rpy: RollPitchYaw = Field(
        (0.0, 0.0, 0.0), description="How it is turned about the parent's axes x, y, z (REP-103)."
    )

    def _asked(self) -> str:
        numbers = zip(_NUMBERS, (*self.position, *self.rpy), strict=True)
        pose = words({name: round(number, 4) for name, number in numbers if number})
        return f"{self.words}: {pose}"


@check("tf.static", Subject.RECORDING, Static)
def static(recording: Recording, parameters: Static) -> Finding:
    """A static transform is published, so that late joiners get it, and has the right values.

    The publisher must be transient_local and stay until the end. A quaternion and its negative are
    the same rotation. The stamp does not count.
    """
    mine = parameters.found(recording, is_static=True)
    gone = f"{parameters.words} was sent, but its publisher is gone"
    stop_if(why_unpublished(recording, parameters.topic, gone) or why_ended(recording, gone))
    turn, values = transforms.quaternion(*parameters.rpy), []
    for one in mine:
        # The same rotation has other angles too, such as those with a full turn more.
        off = transforms.angle_between(one.pose[1], turn)
        angles = transforms.roll_pitch_yaw(one.pose[1])
        angles = parameters.rpy if off <= parameters.angle else angles
        values.append(dict(zip(_NUMBERS, (*one.pose[0], *angles), strict=True)))
    wanted = dict(zip(_NUMBERS, (*parameters.position, *parameters.rpy), strict=True))
    amounts = dict(zip(_NUMBERS, [parameters.tolerance] * 3 + [parameters.angle] * 3, strict=True))
    found = equal.judge(
        replace(recording, messages={parameters.topic: _alone(mine, values)}),
        Equal(topic=parameters.topic, value=wanted, tolerance=amounts),
    )
    return replace(found, expected=parameters.asked_for)


def _alone(mine: Sequence[Sent], values: Iterable[Mapping[str, Any]]) -> tuple[Message, ...]:
    """Transforms as messages that hold nothing else; others may have come between."""
    pairs = enumerate(zip(mine, values, strict=False), start=1)
    return tuple(replace(one.message, value=value, sequence=n) for n, (one, value) in pairs)


class Broadcast(EdgeParameters):
    """Parameters of tf.broadcast."""

    rate: Frequency = Field(description="Expected rate, within 20 %.")
    moving: bool = Field(False, description="Whether the transform must change in the run.")

    def _asked(self) -> str:
        return f"{self.words} at {self.rate:g} Hz{', moving' if self.moving else ''}"


@check("tf.broadcast", Subject.RECORDING, Broadcast)
def broadcast(recording: Recording, parameters: Broadcast) -> Finding:
    """A transform is broadcast at the right rate, with stamps of the node's clock.

    A stamp must be within 1 s of the moment of publishing, or be that of a message that the node
    may have made the transform of. The rate is judged as by timing.rate.
    """
    mine = parameters.found(recording)
    low, high = (parameters.rate * (1.0 + part) for part in (-_RATE_TOLERANCE, _RATE_TOLERANCE))
    found = rate.judge(
        replace(recording, messages={parameters.topic: tuple(_alone(mine, [{}] * len(mine)))}),
        Rate.model_construct(topic=parameters.topic, at_least=low, at_most=high),
    )
    if found.credit and parameters.moving and len({one.pose for one in mine}) == 1:
        seen = f"{found.observed}, but the transform is always the same"
        hint = "Compute translation and rotation again in each call of the callback."
        return Finding.failed(parameters.asked_for, seen, hint, found.evidence)
    return replace(found, expected=parameters.asked_for)


class Follows(PlacedParameters):
    """Parameters of tf.follows."""

    needs = (Recorded(), Recorded("source"), SimulatedRobot(unless="source"))

    source: TopicName | None = Field(
        None,
        description="Recorded topic with the pose, such as an Odometry or a PoseStamped, or x, y "
        "and theta; by default the true pose of the simulated robot.",
    )
    within: Duration = Field(0.2, description="Largest age of the pose.", validate_default=False)

    def _asked(self) -> str:
        source = f"the pose on {code(self.source)}" if self.source else "the robot's true pose"
        return f"{self.words} is {source} (within {metres(self.tolerance)}, {degrees(self.angle)})"


@check("tf.follows", Subject.RECORDING, Follows)
def follows(recording: Recording, parameters: Follows) -> Finding:
    """A transform follows a pose in the plane: that of a topic, or the robot's true one.

    x, y and yaw are judged as by messages.follows, so the pose must change in each of them.
    """
    mine = parameters.found(recording)
    topic, source = parameters.topic, parameters.source or "/pose"
    poses: list[tuple[int, Pose]] = [
        (one.time_ns, ((one.x_m, one.y_m), transforms.quaternion(0.0, 0.0, one.yaw_rad)))
        for one in (recording.truth if parameters.source is None else ())
    ]
    for message in recording.on(source):
        pose = transforms.pose_of(message.value)
        poses += [(message.stamp_ns, pose)] if pose is not None else []
    numbered = enumerate(poses, start=1)
    known = [Message(source, "", _value(pose), at_ns, at_ns, n) for n, (at_ns, pose) in numbered]
    own = _alone(mine, [_value(one.pose) for one in mine])
    alone = replace(recording, messages={topic: own, source: tuple(known)})
    fields = {"x": "x", "y": "y"}, {"yaw": "yaw(rotation)"}
    for part, tolerance in zip(fields, (parameters.tolerance, parameters.angle), strict=True):
        wanted = FieldsFollow.model_construct(
            topic=topic, source=source, fields=part, tolerance=tolerance, within=parameters.within
        )
        found = fields_follow.judge(alone, wanted)
        if not found.credit:
            break
    hint = found.hint and (
        "Copy the newest pose, position and orientation, into transform.translation and "
        "transform.rotation, in the callback that gets it."
    )
    return replace(found, expected=parameters.asked_for, hint=hint)


def _value(pose: Pose) -> dict[str, Any]:
    (x, y, *_), turn = pose
    rotation = dict(zip("xyzw", turn, strict=True))
    return {"x": x, "y": y, "yaw": transforms.roll_pitch_yaw(turn)[2], "rotation": rotation}
