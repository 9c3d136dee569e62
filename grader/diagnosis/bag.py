"""Why there is nothing to judge in a bag."""

from __future__ import annotations

from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Finding
from grader.findings.words import code, codes
from grader.recording.model import Kind, Owner, Recording

_MOST_SHOWN = 12


def why_not_in_bag(recording: Recording, topic: str) -> Finding | None:
    """Why a bag has no message on a topic to judge; None if it has."""
    if recording.on(topic) or recording.bag is None or recording.unreadable.get(topic):
        return None
    bag, name = code(recording.bag), code(recording.in_bag(topic))
    types = {one.type for one in recording.student_endpoints(Kind.PUBLISHER, topic)}
    if recording.misdefined(topic):
        seen = f"{bag} has {name} with another definition of {codes(types)} than Jazzy's"
        return mistaken("other_definition_in_bag", seen, type=codes(types))
    readers = [one for one in recording.endpoints if one.owner is Owner.PROBE]
    other_types = {one.type for one in readers if one.topic == topic} - types
    if types and other_types:
        seen = f"{bag} has {codes(types)} on {name}, not {codes(other_types)}"
        return mistaken("other_type_in_bag", seen, topic=name)
    seen = f"{bag} has no message on {name}; {_what_it_has(recording)}"
    return mistaken("not_in_bag", seen, topic=name)


def _what_it_has(recording: Recording) -> str:
    """The topics of the bag that is judged, in words."""
    topics = [
        topic.name
        for bag in recording.submission.bags or ()
        for topic in bag.topics
        if bag.path == recording.bag and topic.messages
    ]
    if not topics:
        return "it is empty"
    more = " and others" if len(topics) > _MOST_SHOWN else ""
    return f"it has {codes(topics[:_MOST_SHOWN])}{more}"
