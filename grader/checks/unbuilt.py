"""Why a package is not there, or was not built: shared by all checks of packages."""

from __future__ import annotations

import re

from grader.checks.cause import Cause
from grader.checks.finding import Evidence
from grader.checks.wording import code, codes
from grader.nearest import nearest
from grader.submission.record import BuildRecord, PackageRecord, SubmissionRecord

_LOG_LINES = 15
_ANSI = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
# What colcon says of its own doings around the tool's output.
_CHATTER = re.compile(
    r"^(Starting +>>>|Finished +<<<|Failed +<<<|Aborted +<<<|Summary:|---|\s+\d+ packages? )"
)


def why_no_package(submission: SubmissionRecord, name: str) -> Cause | None:
    """Why the submission has no package of a name, or None if it has one."""
    if submission.problem is not None:
        return Cause(
            submission.problem,
            "Hand in the workspace, its src folder or the package itself: a folder with a "
            "package.xml must be in it.",
        )
    if submission.package(name) is not None:
        return None
    names = [item.name for item in submission.packages]
    if not names:
        return Cause("no package.xml was found", "A ROS package is a folder with a package.xml.")
    match = nearest(name, names)
    errors = [item.manifest_error for item in submission.packages if item.manifest_error]
    if errors and match is None:
        return Cause(
            f"no package {code(name)} was found, and a package.xml cannot be used: {errors[0]}",
            "Mend package.xml at the line that is named here.",
            Evidence(places=tuple(errors)),
        )
    found = f"found package {code(match)}" if match else f"found {codes(names)} only"
    return Cause(
        found,
        f"Write <name>{name}</name> in package.xml, and the same name in setup.py, setup.cfg, "
        "resource/ and the folder of the Python module.",
    )


def existing_package(submission: SubmissionRecord, name: str) -> PackageRecord:
    """The package of a name for which :func:`why_no_package` had nothing to say.

    Raises:
        LookupError: There is none, after all.
    """
    package = submission.package(name)
    if package is None:
        raise LookupError(f"no package {name!r}")
    return package


def why_not_built(submission: SubmissionRecord, name: str) -> Cause | None:
    """Why a package was not built, or None if it was."""
    cause = why_no_package(submission, name)
    if cause is not None:
        return cause
    build = submission.build
    if build is None:
        return Cause("nothing was built, so this cannot be judged", ours=True)
    if build.succeeded:
        return None
    if build.timed_out:
        return Cause(
            "`colcon build` did not finish within its time limit and was ended",
            "Look for input(), an endless loop or a long computation in setup.py or "
            "CMakeLists.txt.",
            _evidence(build, name),
        )
    failed = build.failed_packages
    aborted = {found[1] for found in re.finditer(r"^Aborted +<<< (\S+)", _clean(build), re.M)}
    others = [other for other in failed if other != name and other not in aborted]
    if name in failed and not (name in aborted and others):
        return _failed(build, name)
    package = existing_package(submission, name)
    if name not in failed and (package.executables or package.misplaced_executables):
        return None
    if not others:
        return _failed(build, name)
    return Cause(
        f"it was not built, because {codes(others)} failed to build",
        f"Mend {codes(others)} first: `colcon build --packages-select {others[0]}`.",
        _evidence(build, others[0]),
    )


def _failed(build: BuildRecord, name: str) -> Cause:
    where = f": {build.culprit}" if build.culprit else ""
    return Cause(
        f"`colcon build` failed{where}",
        f"Run `colcon build --packages-select {name}` in the workspace and mend the first error "
        "that it prints.",
        _evidence(build, name),
    )


def _evidence(build: BuildRecord, name: str) -> Evidence:
    return Evidence(
        places=(build.culprit,) if build.culprit else (), log=_relevant(_clean(build), name)
    )


def _clean(build: BuildRecord) -> str:
    return _ANSI.sub("", build.log)


def _relevant(log: str, name: str) -> tuple[str, ...]:
    """The end of what the build of the package wrote, without colcon's own lines."""
    lines = log.splitlines()
    marks = [i for i, line in enumerate(lines) if line.startswith(f"--- stderr: {name}")]
    if marks:
        block = lines[marks[-1] + 1 :]
        end = next((i for i, line in enumerate(block) if line.strip() == "---"), len(block))
        block = [line for line in block[:end] if line.strip()]
        if block:
            return tuple(block[-_LOG_LINES:])
    kept = [line for line in lines if line.strip() and not _CHATTER.match(line)]
    return tuple(kept[-_LOG_LINES:])
