"""A check: a name, typed parameters, and a pure function that judges."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from grader.assignment.source import Model
from grader.checks.finding import Finding


class Subject(str, Enum):
    """What a check looks at."""

    SUBMISSION = "submission"
    """Packages as handed in and built: a :class:`~grader.submission.record.SubmissionRecord`."""
    RECORDING = "recording"
    """One run: a :class:`~grader.recording.model.Recording`."""


class Parameters(Model):
    """Base of every check's parameters (the ``with`` of the YAML)."""


class NoParameters(Parameters):
    """A check without parameters."""


@dataclass(frozen=True)
class Check:
    """One entry of the catalogue.

    Attributes:
        name: ``family.noun`` as in YAML's ``uses``.
        subject: What it judges.
        parameters: Model of the YAML's ``with``.
        judge: The pure function: (subject, parameters) -> Finding.
    """

    name: str
    subject: Subject
    parameters: type[Parameters]
    judge: Callable[[Any, Any], Finding]

    @property
    def documentation(self) -> str:
        """The docstring of the function: the text of the catalogue."""
        return inspect.getdoc(self.judge) or ""

    @property
    def family(self) -> str:
        """First part of the name."""
        return self.name.partition(".")[0]

    @property
    def title(self) -> str:
        """First line of the documentation, without the full stop."""
        return self.documentation.partition("\n")[0].rstrip(".")


def check(
    name: str, subject: Subject, parameters: type[Parameters] = NoParameters
) -> Callable[[Callable[[Any, Any], Finding]], Check]:
    """Make a :class:`Check` of a function; its docstring becomes the catalogue's text."""

    def decorate(judge: Callable[[Any, Any], Finding]) -> Check:
        return Check(name, subject, parameters, judge)

    return decorate
