"""A check: a name, typed parameters, and a pure function that judges."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

from grader.checks.finding import Finding
from grader.checks.need import Doubt, Need
from grader.checks.value import EXACT, Tolerance
from grader.spec.source import Model


class Subject(str, Enum):
    """What a check looks at."""

    SUBMISSION = "submission"
    """Packages as handed in and built: a :class:`~grader.submission.record.SubmissionRecord`."""
    RECORDING = "recording"
    """One run: a :class:`~grader.recording.model.Recording`."""


@dataclass(frozen=True)
class NamedFields:
    """Fields of a message, a request or an answer that a check names, for validation.

    Attributes:
        place: Where they stand below ``with``.
        fields: What is expected of which field, nested or by path; or one path.
        part: Of the definition: 0 message, request or goal; 1 response or result; 2 feedback.
    """

    place: tuple[str | int, ...]
    endpoint: str
    fields: Mapping[str, Any] | str
    part: int = 0
    tolerance: Tolerance = EXACT


class Parameters(Model):
    """Base of every check's parameters (the ``with`` of the YAML)."""

    needs: ClassVar[tuple[Need, ...]] = ()
    doubt: ClassVar[Doubt | None] = None
    """A failure in a run that was disturbed so must happen twice to count."""

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields that the check names, so that a misspelt one is found before any run."""
        yield from ()


class NoParameters(Parameters):
    """A check without parameters."""


@dataclass(frozen=True)
class Check:
    """One entry of the catalogue.

    Attributes:
        name: ``family.noun`` as in YAML's ``uses``.
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
