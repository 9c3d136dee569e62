"""Checks of one transform: static, or broadcast again and again, and where it is; and of the tree.

The transforms between two frames are judged as the messages of a topic of their own would be.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, ClassVar, Literal

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
        unheard = refused_by_tf2(symptom) or overwritten(symptom)
        stop_if(unheard if symptom.wanted else cause_of(symptom))
        first_ns = _first_with(recording)
        for one in symptom.wanted:
            # What came later, such as what is made of this transform, is no source of its stamp.
            is_known = first_ns.get(one.stamp_ns, math.inf) <= one.message.stamp_ns
            known = (one.stamp_ns,) if is_known else ()
            stop_if(explain(BadTransform(recording, one, known)))
        # Others may have come between: these are numbered anew.
        own = (
            replace(one.message, value=one.value, sequence=number)
            for number, one in enumerate(symptom.wanted, start=1)
        )
        return replace(recording, messages={**recording.messages, self.topic: tuple(own)})

    @property
    def words(self) -> str:
        """The transform in words."""
        return f"{edge(self.parent, self.child)} on {code(self.topic)}"


def _first_with(recording: Recording) -> dict[int | None, int]:
    """When the first message of each stamp was published, by the stamp."""
    heard = (*recording.messages.values(), *recording.sent.values())
    latest = sorted((one for items in heard for one in items), key=lambda one: -one.stamp_ns)
    return {stamp_of(one.value): one.stamp_ns for one in latest}


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
    low, high = (parameters.rate * (1.0 + part) for part in (-_RATE_TOLERANCE, _RATE_TOLERANCE))
    wanted = timing.Rate.model_construct(topic=parameters.topic, at_least=low, at_most=high)
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
    alone, source = parameters.alone(recording), parameters.source or "/truth"
    truth = tuple(
        Message(source, "", _odometry(one), one.time_ns, one.time_ns, number)
        for number, one in enumerate(recording.truth, start=1)
    )
    if parameters.source is None:
        alone = replace(alone, messages={**alone.messages, source: truth})
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
    symptom = NoTransform(recording, parameters.topic, parameters.parent, parameters.child)
    sources = recording.on(parameters.source or "")
    stamps = {stamp_of(one.value): one for one in sources}
    # Of a message that was lost, or came after the last one, no stamp is known.
    unknown = sum(lost(a, b) for a, b in pairwise(sources))
    judged = [one for one in symptom.wanted if one.message.stamp_ns < sources[-1].stamp_ns]
    wrong = []
    for one in judged:
        source, sent_ns = stamps.get(one.stamp_ns), one.message.stamp_ns
        made_ns = sent_ns if source is None else source.stamp_ns
        old_s = (sent_ns - made_ns) / NS - recording.stolen_s(made_ns, sent_ns)
        if source is None or old_s > parameters.within:
            wrong.append(one)
    if len(wrong) <= unknown:
        return None
    one, source = wrong[0], sources[0]
    for message in sources:
        if message.stamp_ns <= one.message.stamp_ns:
            source = message
    off_s = (one.stamp_ns - (stamp_of(source.value) or 0)) / NS
    return mistaken(
        "other_stamp",
        f"{len(wrong)} of {counted(len(judged), 'transform')} have another stamp than the message "
        f"on {code(source.topic)}; the first one is {format_duration(abs(off_s))} "
        f"{'later' if off_s > 0.0 else 'earlier'}",
        when_sent(recording, one, "has another stamp"),
    )


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
    there = list(sent(recording, (parameters.topic, parameters.static_topic)))
    if not there:
        stop_if(why_silent(recording, parameters.topic))
    for seen, mistake, one in _faults(parameters, there):
        stop_if(
            why_crashed(recording) or mistaken(mistake, seen, when_sent(recording, one, "sent"))
        )
    frames = {name for one in there for name in (one.parent, one.child)}
    seen = f"{counted(len(frames), 'frame')} below {codes(roots(there))}"
    return Finding.as_asked(seen, when_sent(recording, there[0], "sent"))


def _faults(parameters: Tree, there: Sequence[Sent]) -> Iterator[tuple[str, str, Sent]]:
    """What is wrong with the tree, in words, and a transform that shows it."""
    parents, found = {one.child: one.parent for one in reversed(there)}, roots(there)
    for one in there:
        name, topic = code(one.child), one.message.topic
        if one.parent != parents[one.child]:
            both = codes((parents[one.child], one.parent))
            yield f"the frame {name} has two parents, {both}", "two_parents", one
        if one.parent.startswith("/") or one.child.startswith("/"):
            slash = f"{edge(one.parent, one.child)} has a slash in front of a name"
            yield slash, "slash", one
        static = parameters.static
        if static is not None and is_static(topic) != (one.child in static):
            other = f"the transform of the frame {name} is on {code(topic)}"
            yield other, "other_kind", one
    mistake = "no_tree"
    circle = [name for name in found if name in parents]
    missing = [name for name in parameters.frames if name not in {*parents, *found}]
    if circle:
        yield f"{codes(circle)} is above itself: a circle of frames", mistake, there[0]
    if len(found) > 1:
        yield f"{len(found)} trees, with the roots {codes(found)}", mistake, there[0]
    if missing:
        yield f"no frame {codes(missing, last='or')}", mistake, there[0]
    if parameters.root not in (None, *found):
        yield f"the root is {codes(found)}", mistake, there[0]
