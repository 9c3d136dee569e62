"""Check of the tree that all frames make."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Recorded
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.process_exit import why_crashed
from grader.diagnosis.wrong_transform import edge, moment
from grader.findings.finding import Finding
from grader.findings.wording import code, codes, counted
from grader.measure.transforms import Sent, roots, sent
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
    cause = _why_wrong(recording, parameters, there) or _why_no_tree(recording, parameters, there)
    stop_if(cause and (why_crashed(recording) or cause))
    frames = {name for one in there for name in (one.parent, one.child)}
    seen = f"{counted(len(frames), 'frame')} below {codes(roots(there))}"
    return Finding.passed(parameters.asked_for, seen, moment(recording, there[0], "sent"))


def _why_wrong(recording: Recording, parameters: Tree, there: Sequence[Sent]) -> Cause | None:
    """What a single transform has that no tree may have."""
    parents = {one.child: one.parent for one in reversed(there)}
    for one in there:
        wrong = ""
        if one.parent != parents[one.child]:
            wrong = f"has two parents, {code(parents[one.child])} and {code(one.parent)}"
            hint = "A frame has one parent. Turn one of the transforms round, or leave it out."
        elif one.parent.startswith("/") or one.child.startswith("/"):
            wrong = "has a slash in front of a name"
            hint = "Frames are no topics: write their names without the slash."
        elif parameters.static is not None and (one.message.topic == parameters.static_topic) != (
            one.child in parameters.static
        ):
            wrong = f"is on {code(one.message.topic)}"
            hint = "What never changes is static, and sent once; what moves is not (REP-105)."
        if wrong:
            seen = f"{edge(one.parent, one.child)}: the frame {code(one.child)} {wrong}"
            return Cause(seen, hint, moment(recording, one, "sent"))
    return None


def _why_no_tree(recording: Recording, parameters: Tree, there: Sequence[Sent]) -> Cause | None:
    """Why all transforms together are not the tree."""
    children, found = {one.child for one in there}, roots(there)
    missing = [name for name in parameters.frames if name not in {*children, *found}]
    if children & set(found):
        seen = f"{codes(children & set(found))} is above itself: a circle of frames"
    elif len(found) > 1:
        seen = f"{len(found)} trees, with the roots {codes(found)}"
    elif missing:
        seen = f"no frame {codes(missing, last='or')}"
    elif parameters.root not in (None, *found):
        seen = f"the root is {codes(found)}"
    else:
        return None
    return Cause(
        seen,
        "Publish one transform for each frame but the root, from its parent.",
        moment(recording, there[0], "sent"),
    )
