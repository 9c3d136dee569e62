"""Check of the tree that all frames make."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Recorded
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.wrong_transform import edge, moment
from grader.findings.finding import Finding
from grader.findings.wording import code, codes, counted
from grader.measure.transforms import roots, sent
from grader.recording.model import Recording
from grader.spec.name import FrameName, TopicName


class Tree(Parameters):
    """Parameters of tf.tree."""

    needs = (Recorded(), Recorded("static_topic"))

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


@check("tf.tree", Subject.RECORDING, Tree)
def tree(recording: Recording, parameters: Tree) -> Finding:
    """The frames make one tree: one root, connected, and no frame with two parents.

    Judged by all transforms of the run, also those of the simulated robot.
    """
    there = list(sent(recording, (parameters.topic, parameters.static_topic)))
    if not there:
        stop_if(why_silent(recording, parameters.topic))
    parents = {one.child: one for one in reversed(there)}
    for one in there:
        first = parents[one.child]
        static = one.message.topic == parameters.static_topic
        wrong, hint = "", ""
        if one.parent != first.parent:
            wrong = f"has two parents, {code(first.parent)} and {code(one.parent)}"
            hint = "A frame has one parent. Turn one of the transforms round, or leave it out."
        elif one.parent.startswith("/") or one.child.startswith("/"):
            wrong = "has a slash in front of a name"
            hint = "Frames are no topics: write their names without the slash."
        elif parameters.static is not None and static != (one.child in parameters.static):
            wrong = f"is on {code(one.message.topic)}"
            hint = "What never changes is static, and sent once; what moves is not (REP-105)."
        if wrong:
            seen = f"{edge(one.parent, one.child)}: the frame {code(one.child)} {wrong}"
            stop_if(Cause(seen, hint, moment(recording, one, "sent")))
    evidence = moment(recording, there[0], "sent")
    found = roots(there)
    wanted = parameters.root
    missing = [name for name in parameters.frames if name not in {*parents, *found}]
    circle = next((f"{code(one)} is above itself: a circle" for one in found if one in parents), "")
    if circle or len(found) != 1 or missing or wanted not in (None, *found):
        lack = f"no frame {codes(missing, last='or')}" if missing else f"the root {codes(found)}"
        several = f"{len(found)} trees, with the roots {codes(found)}"
        return Finding.failed(
            parameters.asked_for,
            circle or (lack if len(found) == 1 else several),
            "Publish a transform for each frame, from its parent. Each frame but the root is the "
            "child of one transform. `ros2 run tf2_tools view_frames` draws them.",
            evidence,
        )
    seen = f"{counted(len(parents) + 1, 'frame')} below {codes(found)}"
    return Finding.passed(parameters.asked_for, seen, evidence)
