"""Checks of a package as handed in: it is found, it builds, its executable is installed."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Literal

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding
from grader.checks.need import Submitted
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.not_built import existing_package, why_no_manifest, why_not_built
from grader.spec.name import PackageName
from grader.spec.nearest_name import nearest
from grader.submission.record import PackageRecord, SourceError, SubmissionRecord


class PackageFound(Parameters):
    """Parameters of package.found."""

    needs = (Submitted(),)

    package: PackageName = Field(description="Name in package.xml.")
    build_type: Literal["ament_python", "ament_cmake"] | None = Field(
        None, description="Expected build type; by default any."
    )


@check("package.found", Subject.SUBMISSION, PackageFound)
def found(submission: SubmissionRecord, parameters: PackageFound) -> Finding:
    """The package is there, with a sound package.xml.

    Judged by the files that were handed in: a package.xml with this name, which can be read,
    and with the expected build type.
    """
    expected = f"the package {code(parameters.package)}"
    if parameters.build_type:
        expected += f" with the build type {parameters.build_type}"
    cause = why_no_manifest(submission, parameters.package)
    if cause is not None:
        return cause.finding(expected)
    package = existing_package(submission, parameters.package)
    if parameters.build_type not in (None, package.build_type):
        manifest = _manifest(package)
        return Finding.failed(
            expected,
            f"its build type is {package.build_type}",
            f"Write <export><build_type>{parameters.build_type}</build_type></export> in "
            "package.xml.",
            Evidence(places=(SourceError(manifest, None, f"build type {package.build_type}"),)),
        )
    return Finding.passed(expected, f"found in {code(package.path)}")


class Builds(Parameters):
    """Parameters of package.builds."""

    needs = (Submitted(),)

    package: PackageName = Field(description="Name in package.xml.")


@check("package.builds", Subject.SUBMISSION, Builds)
def builds(submission: SubmissionRecord, parameters: Builds) -> Finding:
    """The package builds with colcon.

    Judged by `colcon build` on a copy of what was handed in. A syntax error in the module of
    an executable counts too, if the package has no other executable: colcon only prints it and
    goes on.
    """
    expected = f"`colcon build` builds {code(parameters.package)}"
    cause = why_not_built(submission, parameters.package)
    if cause is None:
        cause = _why_unreadable(existing_package(submission, parameters.package))
    if cause is not None:
        return cause.finding(expected)
    return Finding.passed(expected, "it builds")


def _why_unreadable(package: PackageRecord) -> Cause | None:
    """A syntax error that leaves no executable of the package to run."""
    origins = dict(package.files)
    broken = {error.file: error for error in package.syntax_errors}
    errors: list[SourceError] = []
    for _, target in package.entry_points:
        found = [origins.get(path, "") for path in _modules(target.partition(":")[0])]
        error = next((broken[path] for path in found if path in broken), None)
        if error is None:
            return None
        errors.append(error)
    if not errors:
        return None
    hint = "Correct this line or the one before it"
    if "null bytes" in errors[0].message:
        hint = "Save this file as plain text in UTF-8, not in UTF-16"
    return Cause(
        f"Python cannot read {errors[0]}",
        f"{hint}; `colcon build` prints the error too, but goes on.",
        Evidence(places=tuple(dict.fromkeys(errors))),
    )


def _modules(dotted: str) -> list[str]:
    """Installed paths that the import of a module reads: ``a.b`` reads a/__init__.py first."""
    steps = dotted.strip().split(".")
    folders = ["/".join(steps[:end]) for end in range(1, len(steps) + 1)]
    return [*(f"{folder}/__init__.py" for folder in folders), f"{folders[-1]}.py"]


# Its name is the student's, and stands in a list of rules.
_FILE = re.compile(r"[\w.-]+(/[\w.-]+)+")


class Executable(Parameters):
    """Parameters of package.executable."""

    needs = (Submitted(executable="executable"),)

    package: PackageName = Field(description="Name in package.xml.")
    executable: str = Field(min_length=1, description="Name that `ros2 run` is given.")
    remap: bool = Field(
        False,
        description="Where the one executable of the package has another name or lies in bin/, run "
        "that in its place. This check fails, and what requires it is judged all the same.",
    )


@check("package.executable", Subject.SUBMISSION, Executable)
def executable(submission: SubmissionRecord, parameters: Executable) -> Finding:
    """The executable is installed where `ros2 run` finds it.

    Judged by what the build installed in lib/<package>, and by whether the function behind it
    exists in the package.
    """
    package, name = parameters.package, parameters.executable
    expected = f"the executable {code(name)}, for `ros2 run {package} {name}`"
    cause = why_not_built(submission, package)
    if cause is None:
        cause = _why_no_executable(existing_package(submission, package), name)
        # The deeper cause, unless the package's own entry point is the one to mend.
        if cause is not None and name not in dict(
            existing_package(submission, package).entry_points
        ):
            cause = _elsewhere(submission, package, name) or cause
    if cause is not None:
        remap = _misnamed(submission, parameters) if parameters.remap else ""
        return replace(cause.finding(expected), remap=remap)
    return Finding.passed(expected, f"installed in lib/{package}")


def _misnamed(submission: SubmissionRecord, parameters: Executable) -> str:
    """Rule of the one file of the install space that can be run in place of what is missing."""
    if why_not_built(submission, parameters.package) is not None:
        return ""
    package, name = existing_package(submission, parameters.package), parameters.executable
    if name in package.misplaced_executables:
        found = [f"bin/{name}"]
    else:
        found = [f"lib/{package.name}/{other}" for other in package.executables]
    runs = len(found) == 1 and name not in package.executables and _FILE.fullmatch(found[0])
    return f"{found[0]}:=lib/{package.name}/{name}" if runs else ""


def _elsewhere(submission: SubmissionRecord, package: str, name: str) -> Cause | None:
    """The executable is there, but another package of the submission has it."""
    others = [p for p in submission.packages if p.name != package and name in p.executables]
    if not others:
        return None
    return Cause(
        f"it is in the package {code(others[0].name)}: `ros2 run {others[0].name} {name}`",
        f"Move its entry of console_scripts, and the module behind it, to {code(package)}.",
        Evidence(places=(SourceError(_beside(others[0], "setup.py"), None, "console_scripts"),)),
    )


def _why_no_executable(package: PackageRecord, name: str) -> Cause | None:
    target = dict(package.missing_targets).get(name)
    if target is not None:
        points_to = dict(package.entry_points).get(name, "")
        entry = f" = {points_to}" if points_to else ""
        hint = (
            "An entry of console_scripts is `name = module:function`: the module with its "
            "package in front, the function as it is called there."
        )
        if target.message.endswith("/__init__.py"):
            hint = (
                "find_packages() in setup.py leaves out a folder without __init__.py, which may be "
                "empty: create it there."
            )
        return Cause(
            f"the entry point {code(name + entry)} leads nowhere: {target}",
            hint,
            Evidence(places=(target,)),
        )
    if name in package.executables:
        return None
    if name in package.misplaced_executables:
        return _misplaced(package, name)
    if package.build_type != "ament_python":
        return _not_installed_by_cmake(package, name)
    scripts = [script for script, _ in package.entry_points]
    setup = Evidence(places=(SourceError(_beside(package, "setup.py"), None, "console_scripts"),))
    if not scripts:
        return Cause(
            "setup.py defines no console_scripts",
            f"Add to setup.py: {_entry_points(package, name)}.",
            setup,
        )
    if name in scripts:
        return Cause(
            f"setup.py defines {code(name)}, but the build did not install it",
            "setup() must be given it in entry_points={'console_scripts': [...]}, and setup.cfg "
            f"the folder: install_scripts=$base/lib/{package.name}.",
            setup,
        )
    match = nearest(name, scripts)
    defines = code(match) if match else codes(scripts)
    return Cause(
        f"setup.py defines {defines}",
        f"The left side of an entry of console_scripts is the executable's name: write "
        f"'{name} = ...'.",
        setup,
    )


def _misplaced(package: PackageRecord, name: str) -> Cause:
    lines = (
        "[develop]",
        f"script_dir=$base/lib/{package.name}",
        "[install]",
        f"install_scripts=$base/lib/{package.name}",
    )
    return Cause(
        f"{code(name)} was installed in bin/, where `ros2 run` does not look",
        f"setup.cfg beside setup.py must hold these four lines: {' / '.join(lines)}",
        Evidence(places=(SourceError(_beside(package, "setup.cfg"), None, "script_dir"),)),
    )


def _not_installed_by_cmake(package: PackageRecord, name: str) -> Cause:
    match = nearest(name, package.executables)
    there = f"installed is {code(match)}" if match else "it was not installed"
    if not match and package.executables:
        there = f"installed are {codes(package.executables)}"
    return Cause(
        there,
        f"CMakeLists.txt needs `install(TARGETS {name} DESTINATION lib/${{PROJECT_NAME}})`, or "
        "install(PROGRAMS ...) for a Python script.",
        Evidence(places=(SourceError(_beside(package, "CMakeLists.txt"), None, "install"),)),
    )


def _entry_points(package: PackageRecord, name: str) -> str:
    entry = f"{name} = {package.name}.<your module>:main"
    return f"entry_points={{'console_scripts': ['{entry}']}}"


def _manifest(package: PackageRecord) -> str:
    return _beside(package, "package.xml")


def _beside(package: PackageRecord, file: str) -> str:
    return file if package.path in ("", ".") else f"{package.path}/{file}"
