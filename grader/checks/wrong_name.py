"""A wrong name in a check of one: it costs the points of this check, and of no other."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from pydantic import Field

from grader.checks.check import Parameters
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Evidence, Finding, Status
from grader.findings.words import code
from grader.recording.model import Recording
from grader.spec.names import Names, Thing, WrongName

_MOST_RULES = 2


class Renamable(Parameters):
    """Part of the parameters of every check whose name may be put right."""

    remap: bool = Field(
        False,
        description="If the student has exactly one that can be meant, under another name, run "
        "again with that name put right. This check fails, and the checks that require it are "
        "judged in that run: a wrong name costs the points of one check.",
    )


class Named(Renamable):
    """Part of the parameters of every check that asks for one thing by its name."""

    thing: ClassVar[Thing]
    called: ClassVar[str]
    """Its name in full, made of the parameters."""

    @property
    def asked_name(self) -> tuple[Thing, str]:
        """The thing and its name."""
        return self.thing, self.called.format(self=self)

    def wrong(self, own: str) -> Names:
        """That thing under another name."""
        thing, asked = self.asked_name
        return Names.of([WrongName(thing, own, asked)])


def misnamed(
    recording: Recording,
    parameters: Named,
    cause: Finding | None,
    meant: str | None,
    shown: Evidence,
) -> Finding | None:
    """The finding of what is not there, or only since this run puts its name right.

    Args:
        cause: Why it is not there, or None if it is.
        meant: The name of what is probably meant instead.
        shown: What to show if it is there.
    """
    if cause is not None:
        if meant is None or not parameters.remap or cause.status is not Status.FAILED:
            return cause
        names = parameters.wrong(meant)
        return cause if names.all_in(recording.names) else replace(cause, names=names)
    thing, asked = parameters.asked_name
    own = recording.names.own(thing, asked)
    if own == asked or not parameters.remap:
        return None
    names = parameters.wrong(own)
    how = " that corrects the name"
    if len(names.rules) <= _MOST_RULES:
        how = f", with `--ros-args -r {' -r '.join(names.rules)}` to correct the name"
    mistake, name = "other_name", _written(thing, asked)
    if thing is Thing.NODE and name == _written(thing, own):
        mistake, name = "other_namespace", asked.rpartition("/")[0] or "/"
    seen = f"found {code(own)} instead; everything else was judged in a second run{how}"
    return replace(mistaken(mistake, seen, shown, thing=thing.value, name=name), names=names)


def _written(thing: Thing, name: str) -> str:
    """A name as code says it; the namespace of a node is no part of it."""
    return name.rpartition("/")[2] if thing is Thing.NODE else name.lstrip("/")
