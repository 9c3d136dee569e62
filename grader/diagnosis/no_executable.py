"""Why the build installed no executable of a name where `ros2 run` finds it."""

from __future__ import annotations

from dataclasses import dataclass

from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken
from grader.diagnosis.no_package import existing_package
from grader.diagnosis.not_built import why_not_built
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, codes
from grader.recording.submission import CPP, PYTHON, PackageRecord, SourceError, SubmissionRecord
from grader.spec.nearest_name import nearest


@dataclass(frozen=True)
class NoExecutable(Symptom[Finding], concept="packages"):
    """An executable is missing, or its function does not exist."""

    submission: SubmissionRecord
    package: PackageRecord
    name: str

    @property
    def setup_py(self) -> Evidence:
        """Where executables of a Python package are defined."""
        return _at(self.package, "setup.py", "console_scripts")

    @property
    def misplaced(self) -> str:
        """That it is in a wrong folder, in words; or nothing."""
        folder = self.package.misplaced(self.name).rpartition("/")[0]
        where = f"{code(self.name)} was installed in {folder}/, where `ros2 run` does not look"
        return where if folder else ""


def why_no_executable(submission: SubmissionRecord, package: str, name: str) -> Finding | None:
    """Why a package has no executable of a name, or None if it has one."""
    cause = why_not_built(submission, package)
    if cause is not None:
        return cause
    record = existing_package(submission, package)
    # The setup.cfg of a package with a wrong name may say the right one.
    is_there = name in record.executables or record.misplaced(name) == f"lib/{package}/{name}"
    is_there = is_there and name not in dict(record.missing_targets)
    if is_there and (record.registered or record.build_type == "ament_python"):
        return None
    return cause_of(NoExecutable(submission, record, name))


def _at(package: PackageRecord, file: str, what: str) -> Evidence:
    return Evidence(places=(SourceError(package.file(file), None, what),))


@explanation(NoExecutable, only=PYTHON)
def no_such_function(symptom: NoExecutable) -> Finding | None:
    """The entry point names a module or function that does not exist or is not installed."""
    target = dict(symptom.package.missing_targets).get(symptom.name)
    if target is None:
        return None
    points_to = dict(symptom.package.entry_points).get(symptom.name, "")
    entry = f"{symptom.name} = {points_to}" if points_to else symptom.name
    is_init = target.message.endswith("/__init__.py")
    seen = f"the entry point {code(entry)} does not work: {target}"
    mistake = "no_init" if is_init else "no_such_function"
    return mistaken(mistake, seen, Evidence(places=(target,)))


@explanation(NoExecutable, only=PYTHON)
def installed_elsewhere(symptom: NoExecutable) -> Finding | None:
    """setup.cfg is missing or wrong: the executable is in bin/ or in another package's folder."""
    package = symptom.package
    if not symptom.misplaced or package.build_type != "ament_python":
        return None
    folder = f"$base/lib/{package.name}"
    return mistaken(
        "installed_elsewhere",
        symptom.misplaced,
        _at(package, "setup.cfg", "script_dir"),
        folder=folder,
    )


@explanation(NoExecutable, only=CPP)
def not_installed_by_cmake(symptom: NoExecutable) -> Finding | None:
    """CMakeLists.txt does not build it, or does not install it where `ros2 run` looks."""
    package, name = symptom.package, symptom.name
    if package.build_type == "ament_python":
        return None
    seen = f"the build installed {codes(package.executables) or 'no executable'}"
    if symptom.misplaced:
        seen = symptom.misplaced
    elif package.cmake is not None and not package.cmake.strip():
        seen = "CMakeLists.txt is empty"
    elif name in package.executables:
        seen = f"ROS does not find the package, so `ros2 run {package.name}` does not either"
    shown = _at(package, "CMakeLists.txt", "install")
    return mistaken("not_installed_by_cmake", seen, shown, name=name)


@explanation(NoExecutable, only=PYTHON)
def no_console_scripts(symptom: NoExecutable) -> Finding | None:
    """setup.py defines no executables."""
    if symptom.package.entry_points:
        return None
    entry = f"{symptom.name} = {symptom.package.name}.<your module>:main"
    return mistaken(
        "no_console_scripts", "setup.py defines no console_scripts", symptom.setup_py, entry=entry
    )


@explanation(NoExecutable, general=True, only=PYTHON)
def other_console_scripts(symptom: NoExecutable) -> Finding:
    """setup.py gives the executable another name, or setup() does not get it."""
    name, scripts = symptom.name, [script for script, _ in symptom.package.entry_points]
    if name in scripts:
        return mistaken(
            "not_given_to_setup",
            f"setup.py defines {code(name)}, but the build did not install it",
            symptom.setup_py,
            package=symptom.package.name,
        )
    match = nearest(name, scripts)
    return mistaken(
        "other_console_scripts",
        f"setup.py defines {code(match) if match else codes(scripts)}",
        symptom.setup_py,
        name=name,
    )


def why_nothing_to_run(package: PackageRecord) -> Finding | None:
    """A syntax error that leaves no executable of the package to run."""
    origins = dict(package.files)
    broken = {error.file: error for error in package.syntax_errors}
    errors: list[SourceError] = []
    for _, target in package.entry_points:
        files = (origins.get(path, "") for path in _modules(target.partition(":")[0]))
        error = next((broken[file] for file in files if file in broken), None)
        if error is None:
            return None
        errors.append(error)
    if not errors:
        return None
    mistake = "other_encoding" if "null bytes" in errors[0].message else "unreadable_module"
    shown = Evidence(places=tuple(dict.fromkeys(errors)))
    return mistaken(mistake, f"Python cannot read {errors[0]}", shown)


def _modules(dotted: str) -> list[str]:
    """Installed paths that the import of a module reads: ``a.b`` reads a/__init__.py first."""
    steps = dotted.strip().split(".")
    folders = ["/".join(steps[:end]) for end in range(1, len(steps) + 1)]
    return [*(f"{folder}/__init__.py" for folder in folders), f"{folders[-1]}.py"]
