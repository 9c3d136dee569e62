"""Check of the tree that all frames make."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Recorded
from grader.diagnosis.mistake import mistaken
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.process_exit import why_crashed
from grader.diagnosis.wrong_transform import edge, moment
from grader.findings.finding import Finding
from grader.findings.wording import code, codes, counted
from grader.measure.transforms import Sent, is_static, roots, sent
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


@check("tf.tree", Subject.RECORDING, Tree, concept="frames")
def tree(recording: Recording, parameters: Tree) -> Finding:
    """The frames make one tree: one root, connected, and no frame with two parents.

    Judged by all transforms of the run, also the transforms of the simulated robot.
    """
    there = list(sent(recording, (parameters.topic, parameters.static_topic)))
    if not there:
        stop_if(why_silent(recording, parameters.topic))
    for seen, mistake, one in _faults(parameters, there):
        stop_if(why_crashed(recording) or mistaken(mistake, seen, moment(recording, one, "sent")))
    frames = {name for one in there for name in (one.parent, one.child)}
    seen = f"{counted(len(frames), 'frame')} below {codes(roots(there))}"
    return Finding.as_asked(seen, moment(recording, there[0], "sent"))


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
