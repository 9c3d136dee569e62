"""Why a package was not built: its own error, another package's, or what the machine lacks."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from grader.diagnosis.build_error import BuildError
from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken, remedy
from grader.diagnosis.no_package import existing_package, why_no_package
from grader.findings.finding import Evidence, Finding, Status
from grader.findings.words import codes
from grader.machine.bootstrap import COMPILERS
from grader.recording.submission import (
    EMPTY,
    BuildRecord,
    PackageRecord,
    SourceError,
    SubmissionRecord,
)
from grader.submission.build.build_log import modules_not_found, not_found
from grader.submission.build.package_log import PackageLog
from grader.submission.build.ros_damage import damage_in
from grader.submission.build.toolchain import apt_package
from grader.submission.intake.paths import is_within
from grader.submission.underlay.definition import ways_to_get

_LOG_LINES = 15
# Of the first error's message, which may join several lines of the log.
_COMPARED = 60
# Lines of colcon itself around the tool's output.
_CHATTER = re.compile(r"Starting +>>>|(Finished|Failed|Aborted) +<<<|Summary:|\s+\d+ packages? ")
# What CMake tells of its work, and how far make is.
_STEPS = re.compile(r"-- |\[ *\d+%\] (?!Building)")
# What the build adds at the end when it ended colcon itself.
_OURS = re.compile(r"\n\[rosgrade: (.+)\]\n\Z")
_TIMED_OUT = {None: "endless_build", True: "build_waits", False: "build_computes"}
"""Whether the build waited for something, as far as that was measured -> the mistake."""


@dataclass(frozen=True)
class NotBuilt(Symptom[Finding], concept="packages"):
    """A package was not built."""

    submission: SubmissionRecord
    name: str
    build: BuildRecord

    @property
    def failed_itself(self) -> bool:
        """Whether it was begun and failed, and not only ended or left out because of another."""
        return PackageLog.of(self.build.log, self.name).failed_itself

    @property
    def blamed(self) -> list[str]:
        """Other packages that failed themselves: those that it needs, or all if it needs none."""
        failed = [name for name in _failed_themselves(self.build) if name != self.name]
        return [name for name in _needs(self.submission, self.name) if name in failed] or failed

    def lacking(self, package: str) -> list[str]:
        """What the build of a package did not find because this machine does not have it."""
        missing: set[str] = set()
        to_read, known = [package], {package}
        while to_read:
            name = to_read.pop()
            log = "\n".join(PackageLog.of(self.build.log, name).lines)
            missing_here = modules_not_found(log)
            record = self.submission.package(name)
            # Only CMake looks for packages; a setup.py may print something in the same words.
            if record is None or record.build_type != "ament_python":
                missing_here |= not_found(log) | damage_in(log) | set(COMPILERS.values())
            missing |= missing_here
            # Another package of the submission is not there, which lacks something itself.
            to_read += missing_here & set(self.build.failed_packages) - known
            known |= missing_here
        return sorted(missing & set(self.build.lacking))


def why_too_new(package: PackageRecord) -> Finding | None:
    """Code that the Python of ROS 2 Jazzy can read, but not the one that grades."""
    if not package.newer_syntax:
        return None
    return Finding.ours(
        f"the Python of this machine cannot read {package.newer_syntax[0]}", remedy("too_new")
    )


def why_not_built(submission: SubmissionRecord, name: str) -> Finding | None:
    """Why a package was not built, or None if it was."""
    cause = why_no_package(submission, name)
    if cause is not None:
        return cause
    package, build = existing_package(submission, name), submission.build
    too_new = why_too_new(package)
    if too_new is not None:
        return too_new
    if build is None:
        return Finding.ours("nothing was built, so this cannot be judged")
    # A package that is not among the failed ones was built, even if others failed.
    if build.succeeded or (build.failed_packages and package.name not in build.failed_packages):
        return None
    return cause_of(NotBuilt(submission, package.name, build))


@explanation(NotBuilt)
def build_takes_too_long(symptom: NotBuilt) -> Finding | None:
    """The build does not end: a sleep or an endless loop in setup.py or CMakeLists.txt."""
    build = symptom.build
    suspects = _failed_themselves(build) or build.failed_packages
    if not build.timed_out or (suspects and symptom.name not in suspects):
        return None
    return mistaken(
        _TIMED_OUT[build.waited],
        "`colcon build` did not finish within its time limit and was ended",
        _evidence(build, symptom.name),
    )


@explanation(NotBuilt)
def machine_lacks_a_package(symptom: NotBuilt) -> Finding | None:
    """The build needs something that the machine lacks; this is an error and costs no points."""
    if symptom.failed_itself:
        lacking = symptom.lacking(symptom.name)
        return _not_here(lacking) if lacking else None
    lacking_by_package = {name: symptom.lacking(name) for name in symptom.blamed}
    if not lacking_by_package or not all(lacking_by_package.values()):
        return None
    return _not_here(sorted(set().union(*lacking_by_package.values()))).after(
        f"it was not built, because it depends on {codes(lacking_by_package)}"
    )


@explanation(NotBuilt)
def build_failed(symptom: NotBuilt) -> Finding | None:
    """The build fails: the first error is shown, with its file and line."""
    build, name = symptom.build, symptom.name
    if not symptom.failed_itself and symptom.blamed:
        return None
    package = existing_package(symptom.submission, name)
    has_own_error = symptom.failed_itself and PackageLog.of(build.log, name).started
    if build.culprit and has_own_error and not is_within(build.culprit.file, package.path):
        # The first error of the log is another package's.
        build = replace(build, culprit=None)
    error = _first_error(build, package)
    return Finding(
        f"`colcon build` failed: {error if error.file else error.message}".removesuffix(": "),
        cause_of(BuildError(error, package)),
        replace(_evidence(build, name), places=(error,) if error.file else ()),
    )


@explanation(NotBuilt, general=True)
def depends_on_another(symptom: NotBuilt) -> Finding:
    """Another package, on which it depends, failed to build."""
    build, blamed = symptom.build, symptom.blamed
    # What the machine lacks is no mistake of the packages that need it.
    broken = [name for name in blamed if not symptom.lacking(name)]
    observed = f"it was not built, because {codes(broken)} failed to build"
    if build.culprit and broken == blamed:
        observed += f": {build.culprit}"
    first, evidence = broken[0], _evidence(build, broken[0])
    return mistaken("depends_on_another", observed, evidence, broken=codes(broken), first=first)


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


def _failed_themselves(build: BuildRecord) -> list[str]:
    """The packages of which the log shows that they failed, and not only what rests on them."""
    return [name for name in build.failed_packages if PackageLog.of(build.log, name).failed_itself]


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


def _first_error(build: BuildRecord, package: PackageRecord) -> SourceError:
    """What the log names first, or the file's own syntax error where that says more."""
    culprit = build.culprit
    if culprit is None:
        ended = _OURS.search(build.log)
        culprit = SourceError("", None, ended[1] if ended else "")
    for error in package.syntax_errors:
        # setuptools names no line of what setup() refuses, and CMake one beyond an empty file.
        if error.file == culprit.file and (not culprit.line or error.message == EMPTY):
            return error
    return culprit


def _evidence(build: BuildRecord, name: str) -> Evidence:
    """The log of the package's build, up to its first error or to its end."""
    message = build.culprit.message[:_COMPARED] if build.culprit else ""
    relevant: list[str] = []
    for line in PackageLog.of(build.log, name).lines:
        if line.strip() and not _CHATTER.match(line) and not _STEPS.match(line):
            relevant.append(line)
            if message and message in line:
                # What follows is the complaint of the tools that called the student's file.
                break
    places = (build.culprit,) if build.culprit else ()
    return Evidence(places=places, log=tuple(relevant[-_LOG_LINES:]))
