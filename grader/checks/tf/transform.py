"""Checks of one transform: static, or broadcast again and again, and where it is; and of the tree.

The transforms between two frames are judged as the messages of a topic of their own would be.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, ClassVar, Literal, NamedTuple

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, Subject, check, stop_if
from grader.checks.messages import following, messages
from grader.checks.need import Need, OwnTransform, Recorded, SimulatedRobot
from grader.checks.timing import timing
from grader.diagnosis.explanation import cause_of, explain, mistaken, remedy
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.process_exit import why_crashed
from grader.diagnosis.wrong_transform import (
    BadTransform,
    NoTransform,
    edge,
    overwritten,
    refused_by_tf2,
    when_sent,
    why_gone,
)
from grader.findings.finding import Finding
from grader.findings.value import FieldPath
from grader.findings.words import code, codes, counted, degrees, listing, metres
from grader.measure.numbering import lost
from grader.measure.transforms import Sent, is_static, quaternion, roots, sent, stamp_of
from grader.recording.model import NS, Message, Recording
from grader.recording.simulated import Truth
from grader.spec.name import FrameName, TopicName
from grader.spec.quantity import Angle, Duration, Frequency, PositiveLength
from grader.spec.unit import format_duration
from sim.coordinates import Position, RollPitchYaw

_RATE_TOLERANCE = 0.2
# The true pose is judged as if it had come on a topic.
_TRUTH = "/truth"
_Number = Literal["x", "y", "z", "roll", "pitch", "yaw"]
_ANGLES = ("roll", "pitch", "yaw")
_POSE: dict[_Number, str] = {
    "x": "pose.pose.position.x",
    "y": "pose.pose.position.y",
    "yaw": "yaw(pose.pose.orientation)",
}


class EdgeParameters(Parameters):
    """Base of the parameters of a check of one transform."""

    needs: ClassVar[tuple[Need, ...]] = (Recorded(), OwnTransform())
    of_bags = True

    parent: FrameName = Field(description="The parent frame, `header.frame_id`.")
    child: FrameName = Field(description="The child frame, `child_frame_id`.")
    topic: TopicName = Field("/tf", description="Topic of the transforms.")

    def alone(self, recording: Recording) -> Recording:
        """The run with these transforms as the only messages on their topic.

        The check ends here if there is none, or tf2 cannot use one.
        """
        symptom = NoTransform(recording, self.topic, self.parent, self.child)
        transforms = symptom.wanted
        if not transforms:
            stop_if(cause_of(symptom))
        stop_if(refused_by_tf2(symptom) or overwritten(symptom))
        published_ns = _published_ns(recording)
        for transform in transforms:
            # What came later, such as what is made of this transform, is no source of its stamp.
            source_ns = published_ns.get(transform.stamp_ns, math.inf)
            is_known = source_ns <= transform.message.stamp_ns
            known = (transform.stamp_ns,) if is_known else ()
            stop_if(explain(BadTransform(recording, transform, known)))
        # Others may have come between: these are numbered anew.
        own = (
            replace(transform.message, value=transform.value, sequence=number)
            for number, transform in enumerate(transforms, start=1)
        )
        return replace(recording, messages={**recording.messages, self.topic: tuple(own)})

    @property
    def words(self) -> str:
        """The transform in words."""
        return f"{edge(self.parent, self.child)} on {code(self.topic)}"


def _published_ns(recording: Recording) -> dict[int | None, int]:
    """When the first message with each stamp in its header was published, by that stamp."""
    streams = (*recording.messages.values(), *recording.sent.values())
    found: dict[int | None, int] = {}
    for message in (message for stream in streams for message in stream):
        stamp_ns = stamp_of(message.value)
        found[stamp_ns] = min(found.get(stamp_ns, message.stamp_ns), message.stamp_ns)
    return found


class Static(EdgeParameters):
    """Parameters of tf.static."""

    topic: TopicName = Field("/tf_static", description="Topic of the static transforms.")
    position: Position = Field((0.0, 0.0, 0.0), description="Where the child is in its parent.")
    rpy: RollPitchYaw = Field(
        (0.0, 0.0, 0.0), description="How it is turned about the parent's axes x, y, z (REP-103)."
    )
    tolerance: PositiveLength = Field(0.01, description="Largest error of x, y and z.")
    angle: Angle = Field(0.02, description="Largest error of the rotation.")

    def _asked(self) -> str:
        place, turn = ", ".join(map(metres, self.position)), ", ".join(map(degrees, self.rpy))
        return f"{self.words}: x, y, z = {place}; roll, pitch, yaw = {turn}"


@check("tf.static", Subject.RECORDING, Static, concept="frames")
def static(recording: Recording, parameters: Static) -> Finding:
    """A static transform is published, so that late joiners get it, and has the right values.

    The publisher must be transient_local and stay until the end. A quaternion and its negative are
    the same rotation. The stamp does not count.
    """
    alone = parameters.alone(recording)
    gone = f"{parameters.words} was sent, but its publisher is gone"
    stop_if(why_gone(recording, parameters.topic, gone))
    place = dict(zip("xyz", parameters.position, strict=True))
    turn = {part: round(number, 6) for part, number in quaternion(*parameters.rpy).items()}
    amounts = {f"translation.{axis}": parameters.tolerance for axis in place}
    # A part of a quaternion changes by at most half of the angle.
    amounts |= {f"rotation.{part}": parameters.angle / 2.0 for part in turn}
    wanted = {"translation": place, "rotation": turn}
    found = messages.equal.judge(
        alone, messages.Equal(topic=parameters.topic, value=wanted, tolerance=amounts)
    )
    return replace(found, expected=parameters.asked_for)


class Broadcast(EdgeParameters):
    """Parameters of tf.broadcast."""

    rate: Frequency = Field(description="Expected rate, within 20 %.")
    moving: bool = Field(False, description="Whether the transform must change in the run.")

    def _asked(self) -> str:
        return f"{self.words} at {self.rate:g} Hz{', moving' if self.moving else ''}"


@check("tf.broadcast", Subject.RECORDING, Broadcast, concept="stamps")
def broadcast(recording: Recording, parameters: Broadcast) -> Finding:
    """A transform is broadcast at the right rate, with stamps of the node's clock.

    A stamp must be within 1 s of the moment of publishing. Or it is the stamp of a message from
    which the node may have made the transform. The rate is judged as by timing.rate.
    """
    alone = parameters.alone(recording)
    wanted = timing.Rate.model_construct(
        topic=parameters.topic,
        at_least=parameters.rate * (1.0 - _RATE_TOLERANCE),
        at_most=parameters.rate * (1.0 + _RATE_TOLERANCE),
    )
    found = timing.rate.judge(alone, wanted)
    first, *others = alone.on(parameters.topic)
    if found.credit and parameters.moving and all(one.value == first.value for one in others):
        seen = f"{found.observed}, but the transform is always the same"
        return mistaken("still", seen, found.evidence)
    return replace(found, expected=parameters.asked_for)


class Follows(EdgeParameters):
    """Parameters of tf.follows."""

    needs = (Recorded(), OwnTransform(), Recorded("source"), SimulatedRobot(unless="source"))

    source: TopicName | None = Field(
        None,
        description="Recorded topic with the pose; by default the true pose of the simulated "
        "robot, as an Odometry.",
    )
    fields: dict[_Number, FieldPath] = Field(
        _POSE, min_length=1, description="What is judged, and where in the source it comes from."
    )
    tolerance: PositiveLength = Field(0.01, description="Largest error of x, y and z.")
    angle: Angle = Field(0.02, description="Largest error of each angle.")
    within: Duration = Field(0.2, description="Largest age of the pose.", validate_default=False)
    same_stamp: bool = Field(
        False, description="Whether each stamp must be that of a message of the source."
    )

    def _asked(self) -> str:
        source = (
            f"of the pose on {code(self.source)}" if self.source else "of the robot's true pose"
        )
        limits = f"within {metres(self.tolerance)} and {degrees(self.angle)}"
        stamp = ", and its stamp" if self.same_stamp else ""
        return f"{self.words} has {listing(self.fields)} {source} ({limits}){stamp}"

    def named_fields(self) -> Iterator[NamedFields]:
        """Those of the source."""
        for field, text in self.fields.items():
            yield NamedFields(("fields", field), self.source or "", text)


@check("tf.follows", Subject.RECORDING, Follows, concept="frames")
def follows(recording: Recording, parameters: Follows) -> Finding:
    """A transform follows a pose: that of a topic, or the true one of the simulated robot.

    It is judged as by messages.follows, so the pose must change in each of the fields.
    """
    alone, source = parameters.alone(recording), parameters.source or _TRUTH
    if parameters.source is None:
        truth = tuple(
            Message(_TRUTH, "", _odometry(step), step.time_ns, step.time_ns, number)
            for number, step in enumerate(recording.truth, start=1)
        )
        alone = replace(alone, messages={**alone.messages, _TRUTH: truth})
    names = {
        name: f"{name}(rotation)" if name in _ANGLES else f"translation.{name}"
        for name in parameters.fields
    }
    wanted = following.Follows.model_construct(
        topic=parameters.topic,
        source=source,
        fields={names[name]: text for name, text in parameters.fields.items()},
        tolerance={
            field: parameters.angle if name in _ANGLES else parameters.tolerance
            for name, field in names.items()
        },
        within=parameters.within,
    )
    found = following.follows.judge(alone, wanted)
    if found.credit and parameters.same_stamp:
        stop_if(_why_other_stamp(recording, parameters))
    hint = found.hint and remedy("other_pose")
    return replace(found, expected=parameters.asked_for, hint=hint)


def _why_other_stamp(recording: Recording, parameters: Follows) -> Finding | None:
    """Why the stamps are not those of the source; None if they are."""
    transforms = NoTransform(
        recording, parameters.topic, parameters.parent, parameters.child
    ).wanted
    sources = recording.on(parameters.source or "")
    by_stamp = {stamp_of(message.value): message for message in sources}
    judged = [one for one in transforms if one.message.stamp_ns < sources[-1].stamp_ns]
    wrong = [
        one
        for one in judged
        if not _is_young(recording, one, by_stamp.get(one.stamp_ns), parameters.within)
    ]
    # Of a message that was lost no stamp is known.
    unknown = sum(lost(before, after) for before, after in pairwise(sources))
    if len(wrong) <= unknown:
        return None
    first = wrong[0]
    earlier = [message for message in sources if message.stamp_ns <= first.message.stamp_ns]
    source = earlier[-1] if earlier else sources[0]
    off_s = (first.stamp_ns - (stamp_of(source.value) or 0)) / NS
    return mistaken(
        "other_stamp",
        f"{len(wrong)} of {counted(len(judged), 'transform')} have another stamp than the message "
        f"on {code(source.topic)}; the first one is {format_duration(abs(off_s))} "
        f"{'later' if off_s > 0.0 else 'earlier'}",
        when_sent(recording, first, "has another stamp"),
    )


def _is_young(
    recording: Recording, transform: Sent, source: Message | None, within_s: float
) -> bool:
    """Whether a transform was sent soon after the message that has its stamp."""
    if source is None:
        return False
    sent_ns = transform.message.stamp_ns
    age_s = (sent_ns - source.stamp_ns) / NS
    return age_s - recording.stolen_s(source.stamp_ns, sent_ns) <= within_s


def _odometry(one: Truth) -> dict[str, Any]:
    pose = {"position": {"x": one.x_m, "y": one.y_m}, "orientation": quaternion(0, 0, one.yaw_rad)}
    return {"pose": {"pose": pose}}


class Tree(Parameters):
    """Parameters of tf.tree."""

    needs = (Recorded(), Recorded("static_topic"))
    of_bags = True

    topic: TopicName = Field("/tf", description="Topic of the transforms that change.")
    static_topic: TopicName = Field("/tf_static", description="Topic of the static ones.")
    root: FrameName | None = Field(None, description="The frame at the root; by default any.")
    frames: tuple[FrameName, ...] = Field((), description="Frames that must be in the tree.")
    static: tuple[FrameName, ...] | None = Field(
        None,
        description="Frames whose transforms must be static; those of all others must not be. By "
        "default any.",
    )

    def _asked(self) -> str:
        frames = f" with {codes(self.frames)}" if self.frames else ""
        return f"one tree of frames{frames} below {code(self.root) if self.root else 'one root'}"


@check("tf.tree", Subject.RECORDING, Tree, concept="frames")
def tree(recording: Recording, parameters: Tree) -> Finding:
    """The frames make one tree: one root, connected, and no frame with two parents.

    Judged by all transforms of the run, also the transforms of the simulated robot.
    """
    transforms = list(sent(recording, (parameters.topic, parameters.static_topic)))
    if not transforms:
        return why_silent(recording, parameters.topic)
    fault = next(_faults(parameters, transforms), None)
    if fault is not None:
        shown = when_sent(recording, fault.transform, "sent")
        return why_crashed(recording) or mistaken(fault.mistake, fault.words, shown)
    frames = {name for one in transforms for name in (one.parent, one.child)}
    seen = f"{counted(len(frames), 'frame')} below {codes(roots(transforms))}"
    return Finding.as_asked(seen, when_sent(recording, transforms[0], "sent"))


class _Fault(NamedTuple):
    """What is wrong with the tree, in words, and a transform that shows it."""

    words: str
    mistake: str
    transform: Sent


def _faults(parameters: Tree, transforms: Sequence[Sent]) -> Iterator[_Fault]:
    # Of each frame the first parent.
    parents = {one.child: one.parent for one in reversed(transforms)}
    for one in transforms:
        name, topic, static = code(one.child), one.message.topic, parameters.static
        if one.parent != parents[one.child]:
            both = codes((parents[one.child], one.parent))
            yield _Fault(f"the frame {name} has two parents, {both}", "two_parents", one)
        if one.parent.startswith("/") or one.child.startswith("/"):
            words = f"{edge(one.parent, one.child)} has a slash in front of a name"
            yield _Fault(words, "slash", one)
        if static is not None and is_static(topic) != (one.child in static):
            words = f"the transform of the frame {name} is on {code(topic)}"
            yield _Fault(words, "other_kind", one)
    for words in _why_no_tree(parameters, parents, roots(transforms)):
        yield _Fault(words, "no_tree", transforms[0])


def _why_no_tree(
    parameters: Tree, parents: Mapping[str, str], roots: Sequence[str]
) -> Iterator[str]:
    circle = [name for name in roots if name in parents]
    if circle:
        yield f"{codes(circle)} is above itself: a circle of frames"
    if len(roots) > 1:
        yield f"{len(roots)} trees, with the roots {codes(roots)}"
    missing = [name for name in parameters.frames if name not in {*parents, *roots}]
    if missing:
        yield f"no frame {codes(missing, last='or')}"
    if parameters.root not in (None, *roots):
        yield f"the root is {codes(roots)}"
