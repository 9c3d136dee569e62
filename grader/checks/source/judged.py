"""What checks of the source have in common: which code they judge, and when they cannot."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from pydantic import Field, field_validator

from grader.checks.check import stop_if
from grader.checks.package.package import OfPackage
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_package import existing_package, why_no_package
from grader.diagnosis.not_built import why_too_new
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, percent
from grader.recording.submission import (
    CPP,
    PYTHON,
    PackageRecord,
    SourceError,
    SourceFile,
    SubmissionRecord,
)
from grader.spec.quantity import Ratio

MOST_PLACES = 20
_BOTH = (PYTHON, CPP)


class OfPython(OfPackage):
    """Part of the parameters of every check that reads only Python."""

    only = PYTHON


def judged_package(
    submission: SubmissionRecord, name: str, languages: Collection[str] = _BOTH
) -> tuple[PackageRecord, list[SourceFile]]:
    """The package with its files in some languages; ends the check if they cannot be judged."""
    stop_if(why_no_package(submission, name))
    package = existing_package(submission, name)
    stop_if(why_too_new(package))
    stop_if(why_unreadable(package))
    files = [file for file in package.sources if file.language in languages]
    if not files:
        if submission.language(package) == CPP and CPP in languages:
            stop_if(_of_before())
        what = "code" if languages == _BOTH else f"{PYTHON} code"
        seen = f"the package {code(name)} has no {what}"
        stop_if(mistaken("no_code", seen, folder=code(f"{name}/{name}")))
    return package, files


def why_unreadable(package: PackageRecord) -> Finding | None:
    """Why Python cannot parse the package; None if it can."""
    if not package.syntax_errors:
        return None
    seen = f"Python cannot read {package.syntax_errors[0]}"
    return mistaken("unreadable", seen, Evidence(places=package.syntax_errors[:MOST_PLACES]))


def _of_before() -> Finding:
    seen = "the record of the submission says nothing of its C++: it is of an older rosgrade"
    return Finding.ours(seen, "`rosgrade check` and `batch` read it again.")


def unless_unread(
    submission: SubmissionRecord, package: PackageRecord, finding: Finding
) -> Finding:
    """A failure; or that nothing is judged, if a part of the C++ that holds it was not read."""
    unread = [file.unread for file in package.sources if file.unread is not None]
    if not unread:
        return finding
    if submission.build is not None and package.name in submission.build.failed_packages:
        evidence = Evidence(places=tuple(unread[:MOST_PLACES]))
        return mistaken("unreadable", str(unread[0]), evidence)
    hint = "A person has to look at it: a macro or a rare form of C++ may hide what was looked for."
    return Finding.ours(f"{finding.observed}; but {unread[0]}", hint)


class Share(OfPackage):
    """Part of the parameters of checks that ask something of a share of the code."""

    share: Ratio = Field(1.0, description="Share of them that must have one.")

    @field_validator("share")
    @classmethod
    def _possible(cls, share: float) -> float:
        if not 0.0 < share <= 1.0:
            raise ValueError("the share must be more than 0 % and at most 100 %")
        return share

    @property
    def needed(self) -> str:
        """The share in words."""
        return "all" if self.share == 1.0 else f"at least {percent(self.share)} of the"


def shared(
    parameters: Share, judged: Sequence[tuple[bool, SourceError]], what: str, mistake: str
) -> Finding:
    """The finding by the share of items that have what they need."""
    lacking = [place for good, place in judged if not good]
    having = len(judged) - len(lacking)
    observed = f"{having} of {len(judged)} have {what}"
    # The small amount is float noise of the product.
    if judged and having >= parameters.share * len(judged) - 1e-9:
        return Finding.as_asked(observed)
    first = f"the first without is {lacking[0]}" if lacking else "there is nothing to judge"
    shown = Evidence(places=tuple(lacking[:MOST_PLACES]))
    return mistaken(mistake, f"{observed}; {first}", shown)
