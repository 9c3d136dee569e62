"""What a check says."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from grader.submission.record import SourceError


class Status(str, Enum):
    """How a check ended, and whose fault it is if not well."""

    PASSED = "passed"
    FAILED = "failed"
    """The student's: points are lost."""
    SKIPPED = "skipped"
    """A check that this one requires did not pass."""
    ERROR = "error"
    """Ours or the machine's: the submission is not graded."""


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
        y: Ordinates, as many.
        band: Lowest and highest allowed ordinate, or None.
    """

    title: str
    x_label: str
    y_label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    band: tuple[float, float] | None = None


@dataclass(frozen=True)
class Table:
    """Rows to show beside a finding."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Evidence:
    """Where a finding can be seen.

    Attributes:
        moments: Times in the recording.
        places: Places in the student's files.
        log: Lines of output that matter, as printed.
        plots: Series to draw.
        tables: Small tables.
    """

    moments: tuple[Moment, ...] = ()
    places: tuple[SourceError, ...] = ()
    log: tuple[str, ...] = ()
    plots: tuple[Plot, ...] = ()
    tables: tuple[Table, ...] = ()


@dataclass(frozen=True)
class Finding:
    """What a check says of one recording or of the submission.

    Attributes:
        status: See :class:`Status`.
        expected: What was asked for, a short phrase with units.
        observed: What was seen instead, or seen as well; one cause, the deepest.
        hint: What to try next, in the words of the ROS docs; the author's own hint in the
            YAML is shown besides.
        credit: Share of the points in [0, 1].
        evidence: Where to see it.
        disturbed: For an error: the host took so much that the verdict would not be fair;
            the run is worth repeating.
    """

    status: Status
    expected: str
    observed: str
    hint: str = ""
    credit: float = 0.0
    evidence: Evidence = field(default_factory=Evidence)
    disturbed: bool = False

    @classmethod
    def passed(cls, expected: str, observed: str, evidence: Evidence | None = None) -> Finding:
        """Full credit."""
        return cls(Status.PASSED, expected, observed, "", 1.0, evidence or Evidence())

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
        return cls(Status.FAILED, expected, observed, hint, credit, evidence or Evidence())

    @classmethod
    def error(
        cls, expected: str, observed: str, *, disturbed: bool = False, hint: str = ""
    ) -> Finding:
        """Not judged, through no fault of the student's."""
        return cls(Status.ERROR, expected, observed, hint, 0.0, Evidence(), disturbed)
