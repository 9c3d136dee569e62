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
    here = code(recording.bag)
    ends = [one for one in recording.endpoints if one.topic == topic]
    wanted = {one.type for one in ends if one.owner is Owner.PROBE}
    found = {one.type for one in recording.student_endpoints(Kind.PUBLISHER, topic)}
    wanted -= found
    if recording.misdefined(topic):
        types = codes(found)
        seen = f"{here} has {code(topic)} with another definition of {types} than Jazzy's"
        return mistaken("other_definition_in_bag", seen, type=types)
    if found and wanted:
        seen = f"{here} has {codes(found)} on {code(topic)}, not {codes(wanted)}"
        return mistaken("other_type_in_bag", seen, topic=code(topic))
    if found:
        return mistaken("not_in_bag", f"{here} has no message on {code(topic)}", topic=code(topic))
    there = [
        one.name
        for bag in recording.submission.bags or ()
        for one in bag.topics
        if bag.path == recording.bag and one.messages
    ]
    more = " and others" if len(there) > _MOST_SHOWN else ""
    others = f"; it has {codes(there[:_MOST_SHOWN])}{more}" if there else "; it is empty"
    return mistaken("not_in_bag", f"{here} has no {code(topic)}{others}", topic=code(topic))
