"""A check: a name, typed parameters, and a pure function that judges."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import wraps
from typing import Any, ClassVar, Protocol

from grader.checks.need import Doubt, Need
from grader.findings.finding import Finding, Status
from grader.findings.value import EXACT, NoSuchField, Tolerance
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
    """After such disturbances a failure must happen twice to count."""
    pauses: ClassVar[bool] = False
    """Whether the executors pause at the end of each run that it judges."""
    only: ClassVar[str] = ""
    """The one language that it can read, or nothing if it is the same for all."""
    about: ClassVar[tuple[str, ...]] = ("publisher", "subscription", "node")
    """What it judges of all that a program declares: a failure shows where that is created."""
    asks: ClassVar[str] = ""
    """What is asked for, in the words of the handout, such as ``the node `{self.name}```."""

    @property
    def asked_for(self) -> str:
        """The text of :attr:`asks` with the values of the parameters."""
        return self._asked()

    def _asked(self) -> str:
        return self.asks.format(self=self)

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields that the check names, so that a misspelt one is found before any run."""
        yield from ()


class NoParameters(Parameters):
    """A check without parameters."""


@dataclass(frozen=True)
class Check:
    """One entry of the catalogue: ``family.noun``, as in YAML's ``uses``, and its function.

    ``concept`` is the page of ``docs/concepts`` for a failure whose cause names no other.
    """

    name: str
    subject: Subject
    parameters: type[Parameters]
    judge: Callable[[Any, Any], Finding]
    concept: str = ""

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


class Reason(Protocol):
    """Why something is not as expected: a :class:`~grader.diagnosis.cause.Cause`."""

    def finding(self, expected: str) -> Finding:
        """The finding of a check that expected something else."""


class Unmet(Exception):
    """What a check asks for is not there."""

    def __init__(self, reason: Reason) -> None:
        super().__init__()
        self.reason = reason


def stop_if(reason: Reason | None) -> None:
    """End a check here if there is a reason: its finding says what is expected, and the reason."""
    if reason is not None:
        raise Unmet(reason)


def stop_if_any(reasons: Iterable[Reason | None]) -> None:
    """End a check here by the first of some reasons, one for each case, that is the student's.

    Only where there is none, by one of the machine: an undisturbed case decides without the others.
    """
    undecided = None
    for reason in reasons:
        if reason is not None and reason.finding("").status is not Status.ERROR:
            stop_if(reason)
        undecided = undecided or reason
    stop_if(undecided)


def check(
    name: str, subject: Subject, parameters: type[Parameters] = NoParameters, concept: str = ""
) -> Callable[[Callable[[Any, Any], Finding | Reason]], Check]:
    """Make a :class:`Check` of a function; its docstring becomes the catalogue's text.

    It returns a finding, or the reason why what its parameters ask for is not so.
    """

    def decorate(judge: Callable[[Any, Any], Finding | Reason]) -> Check:
        @wraps(judge)
        def judged(subject: Any, parameters: Any) -> Finding:
            try:
                found = judge(subject, parameters)
            except Unmet as unmet:
                found = unmet.reason
            except NoSuchField as error:
                text = f"the assignment expects what cannot be: {error}"
                return Finding.error(parameters.asked_for, text)
            finding = found if isinstance(found, Finding) else found.finding(parameters.asked_for)
            is_open = finding.status is Status.FAILED and not finding.concept
            return replace(finding, concept=concept) if is_open else finding

        return Check(name, subject, parameters, judged, concept)

    return decorate


def toleranced(
    key: str,
    endpoint: str,
    fields: Mapping[str, Any],
    tolerance: Tolerance = EXACT,
    *,
    part: int = 0,
) -> Iterator[NamedFields]:
    """The fields below one key of ``with``, and those that have a tolerance of their own."""
    yield NamedFields((key,), endpoint, fields, part, tolerance)
    for path in tolerance if isinstance(tolerance, Mapping) else ():
        yield NamedFields(("tolerance", path), endpoint, path, part)
