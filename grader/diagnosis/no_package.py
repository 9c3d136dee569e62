"""Why a submission has no package of a name, or none whose package.xml can be used."""

from __future__ import annotations

from dataclasses import dataclass

from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken, remedy
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, codes
from grader.recording.submission import EMPTY, PackageRecord, SourceError, SubmissionRecord
from grader.spec.name import package_name
from grader.spec.names import Thing
from grader.spec.nearest_name import nearest

_CMAKE = ("ament_cmake", "cmake")


@dataclass(frozen=True)
class NoPackage(Symptom[Finding], concept="packages"):
    """A package is missing."""

    submission: SubmissionRecord
    name: str

    @property
    def names(self) -> list[str]:
        """The packages that are there."""
        return [item.name for item in self.submission.packages]

    @property
    def match(self) -> str | None:
        """The package whose name is nearly the wanted one."""
        own = self.submission.names.own(Thing.PACKAGE, self.name)
        return own if own != self.name else nearest(self.name, self.names)


def why_no_package(submission: SubmissionRecord, name: str) -> Finding | None:
    """Why the submission has no package of a name and none instead, or None if it has one."""
    if submission.problem is None and submission.package(name) is not None:
        return None
    return cause_of(NoPackage(submission, name))


def existing_package(submission: SubmissionRecord, name: str) -> PackageRecord:
    """The package of a name for which :func:`why_no_package` had nothing to say."""
    package = submission.package(name)
    if package is None:
        raise LookupError(f"no package {name!r}")
    return package


def why_misnamed(submission: SubmissionRecord, name: str) -> Finding | None:
    """Why a package has another name than that which it stands in for, or None if it has not."""
    if existing_package(submission, name).name == name:
        return None
    return cause_of(NoPackage(submission, name))


def why_no_manifest(submission: SubmissionRecord, name: str) -> Finding | None:
    """Why the submission has no package of a name with a package.xml that can be used."""
    cause = why_no_package(submission, name)
    if cause is not None:
        return cause
    error = existing_package(submission, name).manifest_error
    return _unusable(f"package.xml cannot be used: {error}", [error]) if error else None


def breach_of_rep_144(name: str) -> str:
    """What is wrong with the name of a package that colcon builds all the same, or nothing."""
    try:
        package_name(name)
    except ValueError as error:
        return f", but {error}"
    return ""


@explanation(NoPackage)
def no_workspace(symptom: NoPackage) -> Finding | None:
    """There is no package.xml (an empty archive), or two packages have the same name."""
    problem = symptom.submission.problem
    if problem is None and symptom.names:
        return None
    mistake = "not_once" if symptom.names else "no_workspace"
    return mistaken(mistake, problem or "no package.xml was found")


@explanation(NoPackage)
def broken_package_xml(symptom: NoPackage) -> Finding | None:
    """package.xml cannot be read: broken XML or an invalid e-mail address."""
    errors = [item.manifest_error for item in symptom.submission.packages if item.manifest_error]
    if not errors or symptom.match is not None:
        return None
    observed = f"no package {code(symptom.name)} was found, and a package.xml cannot be used"
    return _unusable(f"{observed}: {errors[0]}", errors)


@explanation(NoPackage, general=True)
def other_package_name(symptom: NoPackage) -> Finding:
    """The package has another name, or lies inside another package."""
    match, packages = symptom.match, symptom.submission.packages
    mistake, advice_on_place = "other_package_name", ""
    if match is None:
        observed = f"found {codes(symptom.names)} only"
        advice_on_place = f" {remedy('inside_another')}"
    else:
        observed = f"found package {code(match)}"
        packages = tuple(item for item in packages if item.name == match)
        if existing_package(symptom.submission, match).build_type in _CMAKE:
            mistake = "other_cmake_name"
    observed += "".join(breach_of_rep_144(item.name) for item in packages)
    places = tuple(
        SourceError(item.file("package.xml"), None, f"the package {code(item.name)}")
        for item in packages[:10]
    )
    evidence = Evidence(places=places)
    return mistaken(mistake, observed, evidence, name=symptom.name, apart=advice_on_place)


def _unusable(observed: str, errors: list[SourceError]) -> Finding:
    is_empty = any(error.message == EMPTY for error in errors)
    mistake = "empty_file" if is_empty else "broken_package_xml"
    return mistaken(mistake, observed, Evidence(places=tuple(errors)))
