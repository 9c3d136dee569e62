"""What to do about the first error of a build: ``build_error.yaml``, and what no table can tell."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template

from grader.diagnosis.explanation import Explanation, Symptom, add, explanation
from grader.findings.wording import code, codes
from grader.spec.nearest_name import nearest
from grader.spec.source import Model, read_source
from grader.submission.intake.paths import is_within
from grader.submission.read.cmake import read_commands
from grader.submission.read.dependencies import meant
from grader.submission.read.includes import SOURCES
from grader.submission.read.rosdistro import PACKAGES
from grader.submission.record import CPP, PYTHON, PackageRecord, SourceError, SubmissionRecord

_NO_HEADER = re.compile(r"^(\S+): No such file or directory|^'(\S+)' file not found")
_UNDEFINED = re.compile(r"undefined reference to [`'](?P<symbol>(?P<space>[A-Za-z]\w*).*)'")
_NOT_FOUND = re.compile(r'configuration file provided by "([^"]+)"')
_CAPITAL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_INTERFACES = ("_msgs", "_interfaces", "_srvs")
_TARGETS = ("ament_target_dependencies", "target_link_libraries")


@dataclass(frozen=True)
class BuildError(Symptom[str]):
    """A build ended with an error.

    The explanations answer with a hint.
    """

    error: SourceError
    submission: SubmissionRecord
    package: PackageRecord

    @property
    def message(self) -> str:
        """What the error says."""
        return self.error.message

    def files(self, *endings: str) -> list[str]:
        """Files of the package with these endings, as seen from its folder."""
        folder = self.package.path
        return [
            path if folder == "." else path[len(folder) + 1 :]
            for path in self.submission.files
            if is_within(path, folder) and path.endswith(endings)
        ]

    def names(self, *commands: str) -> set[str]:
        """Words in commands of CMakeLists.txt; of ``a::b`` the ``a``."""
        return {
            word.partition("::")[0]
            for one in read_commands(self.package.cmake or "")
            if one.name in commands
            for word in one.arguments
            # Without `::` it is the name of a library only, which brings no headers.
            if one.name != "target_link_libraries" or "::" in word
        }

    def knows(self, package: str) -> bool:
        """Whether there is a package of that name, in ROS or in the submission."""
        return package in PACKAGES or self.submission.package(package) is not None

    @property
    def target(self) -> str:
        """The first program that CMakeLists.txt defines."""
        commands = read_commands(self.package.cmake or "")
        found = (one.arguments[0] for one in commands if one.name == "add_executable")
        return next((name for name in found if name), "<program>")

    def use(self, package: str) -> str:
        """The lines of CMakeLists.txt that are missing for the use of a package."""
        lines = [f"ament_target_dependencies({self.target} {package})"]
        if package not in self.names("find_package"):
            lines.insert(0, f"find_package({package} REQUIRED)")
        return codes(lines)


class Row(Model):
    """A row of the table: a mistake, how to recognise its error, and what to do."""

    mistake: str
    examples: tuple[str, ...]
    message: str
    file: str = r"(?<!\.py)$"
    hint: str

    def __call__(self, symptom: BuildError) -> str | None:
        """The hint, if the error is that of the mistake."""
        found = re.search(self.message, symptom.message)
        if found is None or not re.search(self.file, symptom.error.file):
            return None
        return Template(self.hint).safe_substitute(
            found.groupdict(""), package=symptom.package.name
        )


class Table(Model):
    """The whole of ``build_error.yaml``."""

    errors: tuple[Row, ...]


TABLE = read_source(Path(__file__).with_suffix(".yaml")).read(Table)


@explanation(BuildError, only=CPP)
def header_not_found(symptom: BuildError) -> str | None:
    """A header is not found: CMakeLists.txt does not use its package, or it is misspelt."""
    match = _NO_HEADER.match(symptom.message)
    if match is None:
        return None
    header = match[1] or match[2]
    name, _, rest = header.partition("/")
    own = [path for path in symptom.files(f"/{header}")]
    if own:
        folder = own[0][: -len(header) - 1]
        return (
            f"It lies in {code(folder)}, where the compiler does not look: write "
            f"{code(f'target_include_directories({symptom.target} PRIVATE {folder})')} in "
            "CMakeLists.txt."
        )
    if name == symptom.package.name or not rest:
        better = nearest(header, symptom.files(".h", ".hh", ".hpp"), cutoff=0.6)
        there = f"it has {code(better)}" if better else "it belongs into the folder include/"
        return (
            f"The package has no header {code(header)}: {there}. Compare the two, letter by letter."
        )
    if not symptom.knows(name):
        better = meant(name)
        start = f"Did you mean {code(better)}? " if better else ""
        return f"{start}There is no header {code(header)} here: look at its path."
    if name not in symptom.names(*_TARGETS):
        return (
            f"Write {symptom.use(name)} in CMakeLists.txt, and `<depend>{name}</depend>` in "
            "package.xml."
        )
    small = "/".join([name, *(_CAPITAL.sub("_", part).lower() for part in rest.split("/"))])
    usual = f"{name}/msg/<type>.hpp" if name.endswith(_INTERFACES) else f"{name}/{name}.hpp"
    line = f'#include "{usual if small == header else small}"'
    return (
        f"CMakeLists.txt uses {code(name)}, so the rest of the path is misspelt. Names of headers "
        f"have small letters and end with .hpp: {code(line)}."
    )


@explanation(BuildError, only=CPP)
def package_not_found(symptom: BuildError) -> str | None:
    """find_package() names a package that does not exist, or that is misspelt."""
    match = _NOT_FOUND.search(symptom.message)
    if match is None:
        return None
    better = meant(match[1], (one.name for one in symptom.submission.packages))
    if better == match[1]:
        return f"Name {code(match[1])} in package.xml, too: it is then built before this package."
    if better:
        return f"Did you mean `find_package({better} REQUIRED)`?"
    return f"There is no package {code(match[1])} here: take it out, or look at its name."


@explanation(BuildError, only=CPP)
def undefined_reference(symptom: BuildError) -> str | None:
    """A function is declared, but has no body, or its file or library is not linked."""
    match = _UNDEFINED.search(symptom.message)
    if match is None or match["symbol"] == "main" or match["space"] == "vtable":
        return None
    words = symptom.names("add_executable", "add_library")
    if not any("*" in word or "$" in word for word in words) and "GLOB" not in words:
        left = [path for path in symptom.files(*SOURCES) if path not in words]
        if left:
            return (
                f"{codes(left)} is not compiled: if the function is there, add the file to "
                f"add_executable({symptom.target} ...) in CMakeLists.txt."
            )
    space = match["space"]
    owner = next((one for one in _prefixes(space) if symptom.knows(one)), None)
    if owner is not None and owner != symptom.package.name:
        return (
            f"It belongs to the package {code(owner)}, which the program does not use: write "
            f"{symptom.use(owner)} in CMakeLists.txt."
        )
    return (
        f"{code(match['symbol'])} is declared and called, but has no body. Define it with the same "
        "parameters, and with its class and `::` before its name if it belongs to a class."
    )


def _prefixes(name: str) -> list[str]:
    """``a_b_c``, ``a_b`` and ``a``: C functions begin with the name of their package."""
    parts = name.split("_")
    return ["_".join(parts[:end]) for end in range(len(parts), 0, -1)]


for _row in TABLE.errors:
    _example = _row.examples[0]
    _only = PYTHON if "setup" in _row.file else CPP
    add(
        Explanation(
            BuildError, _row.mistake, _row, __name__, _row.mistake, example=_example, only=_only
        )
    )


@explanation(BuildError, general=True)
def any_build_error(symptom: BuildError) -> str:
    """Any other error: the build is run again to see it."""
    return (
        f"Run `colcon build --packages-select {symptom.package.name}` in the workspace and correct "
        "the first error that it prints."
    )
