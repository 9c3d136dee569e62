"""Checks of a package as handed in: it is found, builds, and has what belongs to it.

That is its executable, its dependencies, what package.xml says, its files and its own tests.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import ClassVar

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Need, StudentTests, Submitted
from grader.checks.wrong_name import Named
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_executable import why_no_executable, why_nothing_to_run
from grader.diagnosis.no_package import (
    breach_of_rep_144,
    existing_package,
    why_misnamed,
    why_no_manifest,
)
from grader.diagnosis.not_built import why_not_built, why_too_new
from grader.diagnosis.wrong_dependencies import why_unknown_imports, why_wrong_dependencies
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, codes, counted, worded
from grader.recording.submission import PackageRecord, SourceError, SubmissionRecord
from grader.spec.name import BuildTypes, PackageName
from grader.spec.names import NO_NAMES, Names, Thing, WrongName
from grader.spec.nearest_name import meant
from grader.submission.read.reachable import only_for


class OfPackage(Parameters):
    """Part of the parameters of every check of a package."""

    needs: ClassVar[tuple[Need, ...]] = (Submitted(),)

    package: PackageName = Field(description="Name in package.xml.")


class PackageFound(OfPackage, Named):
    """Parameters of package.found."""

    thing, called = Thing.PACKAGE, "{self.package}"

    build_type: BuildTypes = Field(
        (), description="Expected build type, or several; by default any."
    )

    def _asked(self) -> str:
        types = f" with the build type {' or '.join(self.build_type)}" if self.build_type else ""
        return f"the package {code(self.package)}{types}"


@check("package.found", Subject.SUBMISSION, PackageFound, concept="packages")
def found(submission: SubmissionRecord, parameters: PackageFound) -> Finding:
    """The package is there and has a valid package.xml.

    Judged by the submitted files: a valid package.xml with this name and the expected build type.
    A name that a variable found must also keep REP-144: it begins with a lower case letter.
    """
    stop_if(why_no_manifest(submission, parameters.package))
    package = existing_package(submission, parameters.package)
    finding = why_misnamed(submission, parameters.package)
    if finding is not None:
        seen = f"{finding.observed}; everything else was judged in this package"
        return replace(finding, observed=seen, names=parameters.wrong(package.name))
    breach = breach_of_rep_144(package.name)
    if breach:
        return mistaken("bad_name", f"found in {code(package.path)}{breach}")
    if not parameters.build_type or package.build_type in parameters.build_type:
        return Finding.as_asked(f"found in {code(package.path)}")
    manifest = SourceError(package.file("package.xml"), None, f"build type {package.build_type}")
    tags = (f"<export><build_type>{one}</build_type></export>" for one in parameters.build_type)
    seen, shown = f"its build type is {package.build_type}", Evidence(places=(manifest,))
    return mistaken("other_build_type", seen, shown, tags=" or ".join(tags))


class Builds(OfPackage):
    """Parameters of package.builds."""

    asks = "`colcon build` builds `{self.package}`"


@check("package.builds", Subject.SUBMISSION, Builds, concept="packages")
def builds(submission: SubmissionRecord, parameters: Builds) -> Finding:
    """The package builds with colcon.

    Judged by `colcon build` on a copy of the submission. A syntax error in the module of an
    executable counts too, if the package has no other executable: colcon only prints it and
    continues.
    """
    stop_if(why_not_built(submission, parameters.package))
    stop_if(why_nothing_to_run(existing_package(submission, parameters.package)))
    return Finding.as_asked("it builds")


# Its name is the student's, and becomes an argument.
_FILE = re.compile(r"[\w.-]+(/[\w.-]+)+")


class Executable(OfPackage, Named):
    """Parameters of package.executable."""

    needs = (Submitted(executable="executable"),)
    asks = "the executable `{self.executable}`, for `ros2 run {self.package} {self.executable}`"
    thing, called = Thing.FILE, "lib/{self.package}/{self.executable}"

    executable: str = Field(min_length=1, description="Name in the command `ros2 run`.")


@check("package.executable", Subject.SUBMISSION, Executable, concept="packages")
def executable(submission: SubmissionRecord, parameters: Executable) -> Finding:
    """The executable is installed where `ros2 run` finds it.

    Judged by what the build installed in lib/<package>, and by whether the function behind it
    exists in the package.
    """
    cause = why_no_executable(submission, parameters.package, parameters.executable)
    if cause is None:
        return Finding.as_asked(f"installed in lib/{parameters.package}")
    return replace(cause, names=_names(submission, parameters)) if parameters.remap else cause


def _names(submission: SubmissionRecord, parameters: Executable) -> Names:
    """The only file of the install space that can run in place of the missing one."""
    if why_not_built(submission, parameters.package) is not None:
        return NO_NAMES
    package, name = existing_package(submission, parameters.package), parameters.executable
    misplaced = package.misplaced(name)
    files = [f"lib/{package.name}/{other}" for other in package.executables]
    if misplaced:
        files = [misplaced]
    if name in package.executables or len(files) != 1 or not _FILE.fullmatch(files[0]):
        return NO_NAMES
    return Names.of([WrongName(Thing.FILE, files[0], f"lib/{package.name}/{name}")])


class Dependencies(OfPackage):
    """Parameters of package.dependencies."""

    needs = (Submitted(executable="executable"),)

    executable: str | None = Field(
        None,
        description="Judge only the imports of the modules, or the includes of the sources, that "
        "this executable needs; by default those of the whole package.",
    )

    def _asked(self) -> str:
        whose = f"the executable {code(self.executable)}" if self.executable else code(self.package)
        uses = worded("imports", "includes")
        return f"every ROS package that {whose} {uses} is in package.xml"


@check("package.dependencies", Subject.SUBMISSION, Dependencies, concept="packages")
def dependencies(submission: SubmissionRecord, parameters: Dependencies) -> Finding:
    """package.xml declares the ROS packages that the code uses.

    Every ROS package that the Python code imports, whose headers the C++ code includes or that
    CMakeLists.txt looks for or links must be named in package.xml by `depend`, `exec_depend`,
    `build_depend`, `build_export_depend` or `run_depend`, and every package that is named there
    must exist. An optional import (guarded by `try`) or include (in `#if`) needs no entry. Modules
    that the code imports only during a run also count.
    """
    stop_if(why_no_manifest(submission, parameters.package))
    package = existing_package(submission, parameters.package)
    stop_if(why_too_new(package))
    stop_if(why_unknown_imports(package))
    if parameters.executable is not None:
        stop_if(why_no_executable(submission, parameters.package, parameters.executable))
        package = only_for(package, parameters.executable)
    stop_if(why_wrong_dependencies(submission, package))
    names = sorted({item.module for item in package.ros_imports} - {package.name})
    observed = f"{codes(names)} declared" if names else f"none {worded('imported', 'included')}"
    return Finding.as_asked(observed)


# What `ros2 pkg create` writes where nothing was given, on any machine.
_PLACEHOLDER = re.compile(r"TODO|@todo\.todo|@todo$", re.IGNORECASE)


class Manifest(OfPackage):
    """Parameters of package.manifest."""

    asks = "the description, the maintainer and the licence in package.xml of `{self.package}`"

    license: str | None = Field(
        None, description="Expected licence, such as `Apache-2.0`; by default any."
    )


@check("package.manifest", Subject.SUBMISSION, Manifest, concept="packages")
def manifest(submission: SubmissionRecord, parameters: Manifest) -> Finding:
    """package.xml names the description, the maintainer and the licence of the package.

    Placeholders that `ros2 pkg create` writes, such as `TODO: License declaration`, do not count.
    """
    stop_if(why_no_manifest(submission, parameters.package))
    package = existing_package(submission, parameters.package)
    faults = [*_placeholders(package), *_other_license(package, parameters)]
    if not faults:
        seen = f"{', '.join(package.maintainers)}; {', '.join(package.licenses)}"
        return Finding.as_asked(seen)
    shown = Evidence(places=(SourceError(package.file("package.xml"), None, faults[0]),))
    return mistaken("unsaid", "; ".join(faults), shown)


def _placeholders(package: PackageRecord) -> Iterator[str]:
    tags = {
        "description": (package.description,),
        "maintainer": package.maintainers,
        "license": package.licenses,
    }
    for tag, values in tags.items():
        for value in values:
            if not value.strip() or _PLACEHOLDER.search(value.rstrip(">")):
                yield f"<{tag}> is {code(value) if value.strip() else 'empty'}"


def _other_license(package: PackageRecord, parameters: Manifest) -> Iterator[str]:
    expected = parameters.license
    if expected is not None and expected.casefold() not in map(str.casefold, package.licenses):
        yield f"the licence is {code(', '.join(package.licenses))}, not {code(expected)}"


class File(OfPackage, Named):
    """Parameters of package.file."""

    asks = "the package installs `share/{self.package}/{self.path}`"
    thing, called = Thing.FILE, "share/{self.package}/{self.path}"

    path: str = Field(
        min_length=1,
        description="Path below `share/<package>/`, such as `launch/robot.launch.py`; `*` and `?` "
        "stand for any text and any character, as in `config/*.yaml`.",
    )


@check("package.file", Subject.SUBMISSION, File, concept="packages")
def file(submission: SubmissionRecord, parameters: File) -> Finding:
    """The package installs a file, such as a launch file or a parameter file.

    Judged by what the build installed in `share/<package>/`.
    """
    stop_if(why_not_built(submission, parameters.package))
    package = existing_package(submission, parameters.package)
    installed = [path for path, _ in package.shared]
    found = [path for path in installed if fnmatchcase(path, parameters.path)]
    if found:
        return Finding.as_asked(f"it installs {codes(found)}")
    if not installed:
        # Each package installs its package.xml.
        return Finding.ours("what it installs was not recorded: grade again")
    folder, _, name = parameters.path.rpartition("/")
    other = _meant(parameters.path, installed) if parameters.remap else None
    if other:
        seen = f"it installs {code(other)} instead; everything else was judged with that file"
        instead = mistaken("other_file", seen, file=name, folder=f"{package.name}/{folder}")
        return replace(instead, names=parameters.wrong(f"share/{package.name}/{other}"))
    line = f"install(DIRECTORY {folder} DESTINATION share/${{PROJECT_NAME}})` in CMakeLists.txt"
    if package.build_type != "ament_cmake":
        line = worded(
            python=f"('share/{package.name}/{folder}', glob('{parameters.path}'))` in data_files "
            "of setup.py",
            cpp=line,
        )
    seen = f"it installs {codes(installed)}"
    own = [path for path in submission.files if fnmatchcase(path.rpartition("/")[2], name)]
    if not own:
        return mistaken("no_such_file", seen, line=line)
    return mistaken(
        "not_installed", f"{codes(own)} is handed in, but not installed; {seen}", line=line
    )


def _meant(path: str, installed: Iterable[str]) -> str | None:
    """The installed file that is probably meant by a path: of that name elsewhere, or of its kind.

    Of several in its folder it is the one with the nearest name.
    """
    asked = PurePosixPath(path)
    others = [PurePosixPath(one) for one in installed]
    of_that_name = [str(one) for one in others if one.name == asked.name]
    of_that_kind = [
        str(one)
        for one in others
        if asked.suffix and one.parent == asked.parent and one.suffixes == asked.suffixes
    ]
    return meant(path, of_that_name or of_that_kind)


class Tests(OfPackage):
    """Parameters of package.tests."""

    needs = (StudentTests(),)

    at_least: int = Field(1, ge=1, description="Least number of tests.")

    def _asked(self) -> str:
        return f"at least {counted(self.at_least, 'test')} in {code(self.package)}, all pass"


@check("package.tests", Subject.SUBMISSION, Tests)
def tests(submission: SubmissionRecord, parameters: Tests) -> Finding:
    """The student's own tests of the package pass.

    They are run with pytest after the build, in the sandbox of the build. The linters that `ros2
    pkg create` puts into `test/` do not count.
    """
    stop_if(why_not_built(submission, parameters.package))
    runs = submission.build.tests if submission.build else ()
    name = existing_package(submission, parameters.package).name
    run = next((one for one in runs if one.package == name), None)
    if run is None:
        return Finding.ours("the tests were not run: grade again")
    if run.problem is not None:
        return mistaken("no_tests", run.problem)
    if run.failed:
        names = codes(name for name, _ in run.failed)
        seen = f"{counted(run.passed, 'test')} passed, {len(run.failed)} failed: {names}"
        log = tuple(f"{name} - {message}" for name, message in run.failed)
        return mistaken("failed_tests", seen, Evidence(log=log))
    if run.passed < parameters.at_least:
        seen = f"there {'is' if run.passed == 1 else 'are'} {counted(run.passed, 'test')}"
        return mistaken("few_tests", seen)
    return Finding.as_asked(f"{counted(run.passed, 'test')} passed")
