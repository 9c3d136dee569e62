"""Where the student's program creates what a finding is about: its publisher, its timer.

A process declares these places itself, so no verdict may depend on them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

from grader.checks.check import Parameters
from grader.diagnosis.process.raised import submission_path
from grader.findings.finding import Finding
from grader.recording.model import Recording
from grader.submission.record import SourceError

_MOST = 3
_LONGEST_NAME = 200
# What a declaration is called by, and what it says.
_NAMES = {"node": "node", "timer": "callback"}
_WORDS = {"published": "messages on {} are published here"}


def with_origins(finding: Finding, parameters: Parameters, recording: Recording) -> Finding:
    """A finding that names no place, with the places of what it is about, as far as known.

    That is what the check names among its parameters, or what the finding says was observed.
    """
    if finding.evidence.places:
        return finding
    places = dict.fromkeys(_places(finding.observed, parameters, recording))
    evidence = replace(finding.evidence, origins=tuple(islice(places, _MOST)))
    return replace(finding, evidence=evidence)


def _places(seen: str, parameters: Parameters, recording: Recording) -> Iterator[SourceError]:
    named = {value for _, value in parameters if isinstance(value, str)}
    if recording.scene and "published" in parameters.about and not hasattr(parameters, "topic"):
        # About the robot: it does what it is commanded.
        named.add(recording.scene.command_topic)
    kinds = tuple(kind for kind in parameters.about if kind in named) or parameters.about
    published = {one.data.get("topic") for one in recording.declared("published")}
    if "published" in kinds and named and not published & named:
        # Nothing was published, and these are what should have done it.
        kinds += ("timer", "publisher")
    declared = {kind: recording.declared(kind) for kind in kinds}
    timers = declared.pop("timer", ())
    found = [
        one
        for kind, items in declared.items()
        for one in items
        if (name := str(one.data.get(_NAMES.get(kind, "topic")))) in named or f"`{name}`" in seen
    ]
    nodes = {one.data.get("node") for one in found}
    for one in [*(one for one in timers if not nodes or one.data.get("node") in nodes), *found]:
        path = submission_path(str(one.data.get("file")), recording.submission)
        if path and isinstance(line := one.data.get("line"), int):
            name = str(one.data.get(_NAMES.get(one.kind, "topic")))[:_LONGEST_NAME]
            words = _WORDS.get(one.kind, f"the {one.kind} {{}} is created here")
            yield SourceError(path, line, words.format(name))
