"""A check: a name, typed parameters, and a pure function that judges."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import wraps
from typing import Any, ClassVar

from grader.checks.need import Doubt, Need, OfSimulator
from grader.findings.finding import Finding, Status
from grader.findings.value import EXACT, NoSuchField, Tolerance
from grader.spec.source import Model


class Subject(str, Enum):
    """What a check looks at."""

    SUBMISSION = "submission"
    """Packages as handed in and built: a :class:`~grader.recording.submission.SubmissionRecord`."""
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
    of_bags: ClassVar[bool] = False
    """Whether it looks at messages and motion only, which the bag of a real robot has too."""
    only: ClassVar[str] = ""
    """The one language that it can read, or nothing if it is the same for all."""
    about: ClassVar[tuple[str, ...]] = ("publisher", "subscription", "node")
    """What it judges of all that a program declares: a failure shows where that is created."""
    asks: ClassVar[str] = ""
    """What is asked for, in the words of the handout, such as ``the node `{self.name}```."""

    @property
    def judges_bags(self) -> bool:
        """Whether a bag has all that it looks at, with these parameters: it has no walls."""
        walls = (need for need in self.needs if isinstance(need, OfSimulator))
        return self.of_bags and not any(need.applies_to(self) for need in walls)

    @property
    def asked_for(self) -> str:
        """The text of :attr:`asks` with the values of the parameters."""
        return self._asked()

    def asked_of(self, subject: Any) -> str:
        """The same, with what only the run or the submission tells, such as a random goal."""
        return self.asked_for

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


class Unmet(Exception):
    """Ends a check with what it found; :func:`stop_if` and :func:`stop_if_any` raise it."""

    def __init__(self, found: Finding) -> None:
        super().__init__()
        self.found = found


def stop_if(found: Finding | None) -> None:
    """End a check here if something is not as it should be: that is its finding."""
    if found is not None:
        raise Unmet(found)


def stop_if_any(findings: Iterable[Finding | None]) -> None:
    """End a check here by the first of some findings, one for each case, that is the student's.

    Only where there is none, by one of the machine: an undisturbed case decides without the others.
    """
    undecided = None
    for found in findings:
        if found is None:
            continue
        if found.status is not Status.ERROR:
            raise Unmet(found)
        undecided = undecided or found
    stop_if(undecided)


def check(
    name: str, subject: Subject, parameters: type[Parameters] = NoParameters, concept: str = ""
) -> Callable[[Callable[[Any, Any], Finding]], Check]:
    """Make a :class:`Check` of a function; its docstring becomes the catalogue's text.

    A finding that does not say what is expected expects what the parameters ask of its subject.
    """

    def decorate(judge: Callable[[Any, Any], Finding]) -> Check:
        @wraps(judge)
        def judged(subject: Any, parameters: Any) -> Finding:
            try:
                found = judge(subject, parameters)
            except Unmet as unmet:
                found = unmet.found
            except NoSuchField as error:
                found = Finding.ours(f"the assignment expects what cannot be: {error}")
            if not isinstance(found, Finding):
                return found  # An instructor's own check is not typed: judging says what it is.
            page = concept if found.status is Status.FAILED else ""
            expected = found.expected or parameters.asked_of(subject)
            return replace(found, expected=expected, concept=found.concept or page)

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
    if isinstance(tolerance, Mapping):
        for path in tolerance:
            yield NamedFields(("tolerance", path), endpoint, path, part)
