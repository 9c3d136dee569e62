"""The finding: the result of a check, with its evidence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import islice

from grader.recording.model import Endpoint, Message, Recording
from grader.recording.submission import SourceError
from grader.spec.names import NO_NAMES, Names
from grader.spec.unit import format_duration


class Status(str, Enum):
    """How a check ended, and whose fault it is if not well."""

    PASSED = "passed"
    FAILED = "failed"
    """The fault is the student's: points are lost."""
    SKIPPED = "skipped"
    """A check that this one requires did not pass."""
    ERROR = "error"
    """The fault is rosgrade's or the machine's: the submission is not graded."""


class Verdict(Enum):
    """What a check decided, or why it decided nothing."""

    PASSED = "passed"
    FAILED = "failed"
    DOUBTFUL = "failed, perhaps by the machine: it counts if it happens again"
    SKIPPED = "not judged, because of a check that this one requires"
    OURS = "not judged, because of rosgrade or the assignment"
    ASKS = "not judged until the submission says which of several things is meant"
    MACHINE = "not judged, because of the machine: the run should be repeated"

    @property
    def status(self) -> Status:
        """The status of a check that ends so."""
        return _STATUS[self]


_STATUS = {
    Verdict.PASSED: Status.PASSED,
    Verdict.FAILED: Status.FAILED,
    Verdict.DOUBTFUL: Status.FAILED,
    Verdict.SKIPPED: Status.SKIPPED,
    Verdict.OURS: Status.ERROR,
    Verdict.ASKS: Status.ERROR,
    Verdict.MACHINE: Status.ERROR,
}


@dataclass(frozen=True)
class Moment:
    """A time in the recording worth looking at.

    Attributes:
        label: What happened.
        time_s: Seconds since launch.
    """

    label: str
    time_s: float


@dataclass(frozen=True)
class Plot:
    """Values to draw.

    Attributes:
        title: What is shown.
        x_label: With unit, such as ``time since launch (s)``.
        y_label: With unit.
        x: Abscissas.
        y: Ordinates, as many as abscissas.
        band: Lowest and highest allowed ordinate, or None.
        histogram: Whether to show a histogram of the ordinates as well.
        judged: Abscissas between which the band holds, or None for all: outside of them nothing
            was judged, and nothing is marked as wrong.
    """

    title: str
    x_label: str
    y_label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    band: tuple[float, float] | None = None
    histogram: bool = False
    judged: tuple[float, float] | None = None


@dataclass(frozen=True)
class Table:
    """Rows to show beside a finding."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Span:
    """Something that lasted, such as one call of a callback; drawn as a bar.

    Attributes:
        name: Whose it is; the same name, the same row.
        begin_s: Seconds since launch.
        end_s: Seconds since launch, not before ``begin_s``.
        wrong: Whether the finding is about this one.
    """

    name: str
    begin_s: float
    end_s: float
    wrong: bool = False


@dataclass(frozen=True)
class Case:
    """One case that was tried, with how far off the answer was.

    Attributes:
        name: What was asked, short.
        group: Cases of one kind have the same, such as ``gimbal lock``.
        error: In the unit of :attr:`Cases.label`; None where no answer came.
    """

    name: str
    group: str
    error: float | None


@dataclass(frozen=True)
class Cases:
    """Errors of many cases against one limit; drawn on a logarithmic scale.

    Attributes:
        title: What was tried.
        label: What the error is, with unit, such as ``error of the rotation (deg)``.
        limit: Greatest allowed error.
        cases: In the order in which they were tried.
    """

    title: str
    label: str
    limit: float
    cases: tuple[Case, ...]


@dataclass(frozen=True)
class Comparison:
    """Two texts side by side, such as message definitions; differing lines are marked.

    Attributes:
        title: What is compared.
        expected: Lines as they should be.
        observed: Lines as they are.
    """

    title: str
    expected: tuple[str, ...]
    observed: tuple[str, ...]


@dataclass(frozen=True)
class Evidence:
    """What the report shows for a finding.

    Attributes:
        moments: Times in the recording.
        places: Places in the student's files.
        origins: Where the student's program creates what the finding is about; the verdict does
            not depend on it.
        log: Lines of output that matter, as printed.
        plots: Series to draw.
        tables: Small tables.
        spans: Durations to draw.
        cases: Errors of many cases.
        comparisons: Texts to compare.
    """

    moments: tuple[Moment, ...] = ()
    places: tuple[SourceError, ...] = ()
    log: tuple[str, ...] = ()
    plots: tuple[Plot, ...] = ()
    tables: tuple[Table, ...] = ()
    spans: tuple[Span, ...] = ()
    cases: tuple[Cases, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    origins: tuple[SourceError, ...] = ()


@dataclass(frozen=True)
class Finding:
    """What a check says of one recording or of the submission, and an explanation of a symptom.

    Without a verdict it is a failure, the student's fault.

    Attributes:
        observed: What was observed, and the deepest cause.
        hint: What to try next, in the words of the ROS docs. The author's hint in the YAML is
            shown too.
        evidence: What to show.
        verdict: What is decided by it.
        expected: What is expected, a short phrase with units; empty for what the parameters of
            the check ask for.
        credit: Share of the points in [0, 1].
        names: If wrong names are the only cause of the failure: those. The other checks are then
            judged in a run that puts them right.
        concept: The page of ``docs/concepts`` that explains the idea behind a failure.
        stands_alone: Whether the checks that require this one can be judged although it failed.
    """

    observed: str
    hint: str = ""
    evidence: Evidence = field(default_factory=Evidence)
    verdict: Verdict = Verdict.FAILED
    expected: str = ""
    credit: float = 0.0
    names: Names = NO_NAMES
    concept: str = ""
    stands_alone: bool = False

    @property
    def status(self) -> Status:
        """How the check ends."""
        return self.verdict.status

    @property
    def disturbed(self) -> bool:
        """Whether the run should be repeated because of the machine."""
        return self.verdict in (Verdict.DOUBTFUL, Verdict.MACHINE)

    @property
    def asks(self) -> bool:
        """Whether it is a question to the student."""
        return self.verdict is Verdict.ASKS

    def doubted(self, doubt: bool = True) -> Finding:
        """The same, but a failure counts only if it happens again, where there is a doubt."""
        is_failed = doubt and self.verdict is Verdict.FAILED
        return replace(self, verdict=Verdict.DOUBTFUL) if is_failed else self

    @classmethod
    def passed(cls, expected: str, observed: str, evidence: Evidence | None = None) -> Finding:
        """Full credit."""
        return cls(observed, "", evidence or Evidence(), Verdict.PASSED, expected, 1.0)

    @classmethod
    def as_asked(cls, observed: str, evidence: Evidence | None = None) -> Finding:
        """Full credit, for what the parameters of the check ask for."""
        return cls.passed("", observed, evidence)

    @classmethod
    def failed(
        cls,
        expected: str,
        observed: str,
        hint: str = "",
        evidence: Evidence | None = None,
        credit: float = 0.0,
    ) -> Finding:
        """The student's fault; ``credit`` may be partial."""
        return cls(observed, hint, evidence or Evidence(), expected=expected, credit=credit)

    @classmethod
    def error(
        cls, expected: str, observed: str, *, disturbed: bool = False, hint: str = ""
    ) -> Finding:
        """Not judged, through no fault of the student's."""
        return replace(cls.ours(observed, hint, disturbed=disturbed), expected=expected)

    @classmethod
    def ours(cls, observed: str, hint: str = "", *, disturbed: bool = False) -> Finding:
        """A cause in rosgrade, the assignment or the machine: nothing is judged."""
        return cls(observed, hint, verdict=Verdict.MACHINE if disturbed else Verdict.OURS)

    @classmethod
    def undecided(cls, observed: str) -> Finding:
        """A cause in the machine or in rosgrade: the run should be repeated."""
        return cls.ours(observed, disturbed=True)

    @classmethod
    def held_up(cls, observed: str, stolen_s: float) -> Finding:
        """What may be so only because the machine took time from the process meanwhile."""
        took = f"the machine took up to {format_duration(stolen_s)} meanwhile"
        return cls.undecided(f"{observed}; {took}, which may explain it")

    def after(self, beginning: str) -> Finding:
        """The same with a text before what was observed."""
        return replace(self, observed=f"{beginning}: {self.observed}")


# Moments for evidence. Something that is missing has no time: these show what there was instead.
_MOST = 5


def nodes_seen(recording: Recording) -> tuple[Moment, ...]:
    """When the student's nodes appeared, the first few."""
    return tuple(
        moment(recording, f"node {node.name} appeared", node.appeared_ns)
        for node in recording.student_nodes[:_MOST]
    )


def endpoints_seen(recording: Recording, endpoints: Iterable[Endpoint]) -> tuple[Moment, ...]:
    """When endpoints appeared, the first few."""
    return tuple(
        moment(recording, f"{item.kind.value} on {item.topic} appeared", item.appeared_ns)
        for item in islice(endpoints, _MOST)
    )


def first_seen(recording: Recording, messages: Iterable[Message]) -> tuple[Moment, ...]:
    """When the first of some messages was published; nothing where there is none."""
    return tuple(
        moment(recording, f"first message on {item.topic}", item.stamp_ns)
        for item in islice(messages, 1)
    )


def until_the_end(recording: Recording, what: str = "the observation ended") -> Moment:
    """The end of the observation, for what lasted or was missing until then."""
    return moment(recording, what, recording.stop_ns)


def moment(recording: Recording, label: str, time_ns: int) -> Moment:
    """A moment of a run."""
    return Moment(label, recording.since_launch_s(time_ns))


def evidence_at(
    recording: Recording, label: str, time_ns: int, *plots: Plot, log: Iterable[str] = ()
) -> Evidence:
    """A moment of a run, with series to draw and lines that were written."""
    return Evidence(moments=(moment(recording, label, time_ns),), plots=plots, log=tuple(log))
