"""Why a package is not there, or was not built: shared by all checks of packages."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from grader.diagnosis.build_error import BuildError
from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken, remedy
from grader.findings.finding import Evidence, Finding, Status
from grader.findings.words import code, codes
from grader.machine.bootstrap import COMPILERS
from grader.recording.submission import (
    EMPTY,
    BuildRecord,
    PackageRecord,
    SourceError,
    SubmissionRecord,
)
from grader.spec.name import package_name
from grader.spec.names import Thing
from grader.spec.nearest_name import nearest
from grader.submission.build.build_log import modules_not_found, not_found
from grader.submission.build.ros_damage import damage_in
from grader.submission.build.toolchain import apt_package
from grader.submission.intake.paths import is_within
from grader.submission.underlay.definition import ways_to_get

_LOG_LINES = 15
# Of the first error's message, which may join several lines of the log.
_COMPARED = 60
_ANSI = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
# Lines of colcon itself around the tool's output.
_CHATTER = re.compile(r"Starting +>>>|(Finished|Failed|Aborted) +<<<|Summary:|\s+\d+ packages? ")
# What CMake tells of its work, and how far make is.
_STEPS = re.compile(r"-- |\[ *\d+%\] (?!Building)")
_CMAKE = ("ament_cmake", "cmake")
# What the build adds at the end when it ended colcon itself.
_OURS = re.compile(r"\n\[rosgrade: (.+)\]\n\Z")


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
    seen = f"no package {code(symptom.name)} was found, and a package.xml cannot be used"
    return _unusable(f"{seen}: {errors[0]}", errors)


@explanation(NoPackage, general=True)
def other_package_name(symptom: NoPackage) -> Finding:
    """The package has another name, or lies inside another package."""
    name, match = symptom.name, symptom.match
    places = tuple(
        SourceError(item.file("package.xml"), None, f"the package {code(item.name)}")
        for item in symptom.submission.packages
        if match in (None, item.name)
    )
    build_type = existing_package(symptom.submission, match).build_type if match else ""
    mistake = "other_cmake_name" if build_type in _CMAKE else "other_package_name"
    apart = "" if match else f" {remedy('inside_another')}"
    seen = f"found package {code(match)}" if match else f"found {codes(symptom.names)} only"
    seen += "".join(map(breach_of_rep_144, [match] if match else symptom.names))
    return mistaken(mistake, seen, Evidence(places=places[:10]), name=name, apart=apart)


def why_misnamed(submission: SubmissionRecord, name: str) -> Finding | None:
    """Why a package has another name than that which it stands in for, or None if it has not."""
    if existing_package(submission, name).name == name:
        return None
    return cause_of(NoPackage(submission, name))


def breach_of_rep_144(name: str) -> str:
    """What is wrong with the name of a package that colcon builds all the same, or nothing."""
    try:
        package_name(name)
    except ValueError as error:
        return f", but {error}"
    return ""


def why_no_manifest(submission: SubmissionRecord, name: str) -> Finding | None:
    """Why the submission has no package of a name with a package.xml that can be used."""
    cause = why_no_package(submission, name)
    if cause is not None:
        return cause
    error = existing_package(submission, name).manifest_error
    return _unusable(f"package.xml cannot be used: {error}", [error]) if error else None


def _unusable(seen: str, errors: list[SourceError]) -> Finding:
    is_empty = any(error.message == EMPTY for error in errors)
    mistake = "empty_file" if is_empty else "broken_package_xml"
    return mistaken(mistake, seen, Evidence(places=tuple(errors)))


def existing_package(submission: SubmissionRecord, name: str) -> PackageRecord:
    """The package of a name for which :func:`why_no_package` had nothing to say."""
    package = submission.package(name)
    if package is None:
        raise LookupError(f"no package {name!r}")
    return package


def why_too_new(package: PackageRecord) -> Finding | None:
    """Code that the Python of ROS 2 Jazzy can read, but not the one that grades."""
    if not package.newer_syntax:
        return None
    return Finding.ours(
        f"the Python of this machine cannot read {package.newer_syntax[0]}", remedy("too_new")
    )


@dataclass(frozen=True)
class NotBuilt(Symptom[Finding], concept="packages"):
    """A package was not built."""

    submission: SubmissionRecord
    name: str
    build: BuildRecord


def why_not_built(submission: SubmissionRecord, name: str) -> Finding | None:
    """Why a package was not built, or None if it was."""
    cause = why_no_package(submission, name)
    cause = cause or why_too_new(existing_package(submission, name))
    if cause is not None:
        return cause
    build, name = submission.build, existing_package(submission, name).name
    if build is None:
        return Finding.ours("nothing was built, so this cannot be judged")
    # A package that is not among the failed ones was built, even if others failed.
    if build.succeeded or (build.failed_packages and name not in build.failed_packages):
        return None
    return cause_of(NotBuilt(submission, name, build))


_TIMED_OUT = {None: "endless_build", True: "build_waits", False: "build_computes"}
"""Whether the build waited for something, as far as that was measured -> the mistake."""


@explanation(NotBuilt)
def build_takes_too_long(symptom: NotBuilt) -> Finding | None:
    """The build does not end: a sleep or an endless loop in setup.py or CMakeLists.txt."""
    build, name = symptom.build, symptom.name
    begun = [one for one in build.failed_packages if _failed_itself(build, one)]
    if not build.timed_out or name not in (begun or build.failed_packages or [name]):
        return None
    return mistaken(
        _TIMED_OUT[build.waited],
        "`colcon build` did not finish within its time limit and was ended",
        _evidence(build, name),
    )


@explanation(NotBuilt)
def machine_lacks_a_package(symptom: NotBuilt) -> Finding | None:
    """The build needs something that the machine lacks; this is an error and costs no points."""
    if not _failed_itself(symptom.build, symptom.name):
        return None
    lacking = _lacking(symptom.submission, symptom.build, symptom.name)
    return _not_here(lacking) if lacking else None


@explanation(NotBuilt)
def build_failed(symptom: NotBuilt) -> Finding | None:
    """The build fails: the first error is shown, with its file and line."""
    build, name = symptom.build, symptom.name
    if not _failed_itself(build, name):
        return None
    folder = existing_package(symptom.submission, name).path
    # Where the first error is another package's, this one has its own.
    started = f"Starting >>> {name}" in _clean(build).splitlines()
    if build.culprit and started and not is_within(build.culprit.file, folder):
        build = replace(build, culprit=None)
    return _failed(symptom.submission, build, name)


@explanation(NotBuilt, general=True)
def depends_on_another(symptom: NotBuilt) -> Finding:
    """Another package, on which it depends, failed to build."""
    submission, build, name = symptom.submission, symptom.build, symptom.name
    failed = [one for one in build.failed_packages if one != name and _failed_itself(build, one)]
    blamed = [one for one in _needs(submission, name) if one in failed] or failed
    if not blamed:
        return _failed(submission, build, name)
    broken = [one for one in blamed if not _lacking(submission, build, one)]
    if broken:
        why = f": {build.culprit}" if build.culprit and broken == blamed else ""
        return mistaken(
            "depends_on_another",
            f"it was not built, because {codes(broken)} failed to build{why}",
            _evidence(build, broken[0]),
            broken=codes(broken),
            first=broken[0],
        )
    lacking = sorted({what for one in blamed for what in _lacking(submission, build, one)})
    return _not_here(lacking).after(f"it was not built, because it depends on {codes(blamed)}")


def why_lacking(submission: SubmissionRecord, name: str) -> Finding | None:
    """What this machine lacks for a package, or for what the package rests on; else None."""
    for one in (name, *_needs(submission, name)):
        cause = why_not_built(submission, one)
        if cause is not None and cause.status is Status.ERROR:
            return cause
    return None


def _not_here(lacking: list[str]) -> Finding:
    packages = " ".join(filter(None, map(apt_package, lacking)))
    ways = [f"`sudo apt install --reinstall {packages}`"] if packages else []
    ways += filter(None, [ways_to_get(lacking)])
    return Finding.ours(
        f"it needs {codes(lacking)} to build: ROS 2 Jazzy has it, but it is missing or damaged on "
        "the machine that grades",
        remedy("not_here", ways="".join(f", or {way}" for way in ways)),
    )


def _failed_itself(build: BuildRecord, name: str) -> bool:
    """Whether colcon began to build a package that failed, and did not abort it for another."""
    ends = rf"<<< {re.escape(name)}(?: |$)"
    if re.search(f"^Aborted +{ends}", _clean(build), re.MULTILINE):
        return False
    begins = rf"^(?:Starting >>> {re.escape(name)}$|Failed +{ends})"
    return re.search(begins, _clean(build), re.MULTILINE) is not None


def _needs(submission: SubmissionRecord, name: str) -> list[str]:
    """Other packages of the submission that a package names or imports, and those that they do."""
    own = {package.name for package in submission.packages}
    needed = [name]
    # The list grows while it is read: what is needed may need more.
    for needed_name in needed:
        package = submission.package(needed_name)
        if package is not None:
            named = {item.name for item in package.dependencies}
            named |= {item.module for item in package.imports}
            needed += sorted(named & own - set(needed))
    return needed[1:]


def _failed(submission: SubmissionRecord, build: BuildRecord, name: str) -> Finding:
    ended = _OURS.search(build.log)
    culprit = build.culprit or SourceError("", None, ended[1] if ended else "")
    package = existing_package(submission, name)
    # setuptools names no line of what setup() refuses, and CMake one beyond an empty file.
    better = [
        error
        for error in package.syntax_errors
        if error.file == culprit.file and (not culprit.line or error.message == EMPTY)
    ]
    error = better[0] if better else culprit
    return Finding(
        f"`colcon build` failed: {error if error.file else error.message}".removesuffix(": "),
        cause_of(BuildError(error, package)),
        replace(_evidence(build, name), places=(error,) if error.file else ()),
    )


def _lacking(submission: SubmissionRecord, build: BuildRecord, name: str) -> list[str]:
    """What the build of a package did not find because this machine does not have it.

    Only CMake looks for packages; what a setup.py prints may be put in the same words.
    """
    missing: set[str] = set()
    to_read, known = [name], {name}
    while to_read:
        reading = to_read.pop()
        log = "\n".join(_written(build, reading))
        missing_here = modules_not_found(log)
        package = submission.package(reading)
        if package is None or package.build_type != "ament_python":
            missing_here |= not_found(log) | damage_in(log) | set(COMPILERS.values())
        missing |= missing_here
        # Another package of the submission is not there, which lacks something itself.
        to_read += missing_here & set(build.failed_packages) - known
        known |= missing_here
    return sorted(missing & set(build.lacking))


def _evidence(build: BuildRecord, name: str) -> Evidence:
    return Evidence(places=(build.culprit,) if build.culprit else (), log=_relevant(build, name))


def _clean(build: BuildRecord) -> str:
    return _ANSI.sub("", build.log)


def _relevant(build: BuildRecord, name: str) -> tuple[str, ...]:
    """The log of the package's build, up to its first error or to its end."""
    message = build.culprit.message[:_COMPARED] if build.culprit is not None else ""
    relevant: list[str] = []
    for line in _written(build, name):
        if line.strip() and not _CHATTER.match(line) and not _STEPS.match(line):
            relevant.append(line)
            if message and message in line:
                # What follows is the complaint of the tools that called the student's file.
                break
    return tuple(relevant[-_LOG_LINES:])


def _written(build: BuildRecord, name: str) -> list[str]:
    """What the build of the package wrote; all of the log where it was never begun."""
    lines = _clean(build).splitlines()
    begin = _last_index(lines, f"Starting >>> {name}")
    if begin is None:
        return lines
    lines = lines[begin:]
    return lines[: _last_index(lines, f"Failed   <<< {name}", f"Aborted  <<< {name}")]


def _last_index(lines: list[str], *beginnings: str) -> int | None:
    """The index of the last line with one of some beginnings, or None."""
    indexes = [index for index, line in enumerate(lines) if line.startswith(beginnings)]
    return indexes[-1] if indexes else None
