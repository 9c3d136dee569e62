"""What to do about the first error of a build, by the table ``build_error.yaml``."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from string import Template

from grader.diagnosis.explanation import Explanation, Symptom, add, explanation, remedy
from grader.recording.submission import CPP, EMPTY, PYTHON, PackageRecord, SourceError
from grader.spec.source import Model, read_source


@dataclass(frozen=True)
class BuildError(Symptom[str]):
    """A build ended with an error.

    The explanations answer with a hint.
    """

    error: SourceError
    package: PackageRecord


class KnownError(Model):
    """A row of the table: a mistake, how to recognise its error, and what to do.

    What each column means stands at the top of ``build_error.yaml``.
    """

    mistake: str
    examples: tuple[str, ...]
    message: str
    file: str = r"(?<!\.py)$"
    hint: str

    def hint_for(self, symptom: BuildError) -> str | None:
        """The hint, if the error is that of the mistake."""
        message = re.search(self.message, symptom.error.message)
        if message is None or not re.search(self.file, symptom.error.file):
            return None
        return Template(self.hint).safe_substitute(
            message.groupdict(""), package=symptom.package.name
        )

    @property
    def language(self) -> str:
        """The language of the packages that can have it: only those in Python have a setup.py."""
        return PYTHON if "setup" in self.file else CPP


class Table(Model):
    """The whole of ``build_error.yaml``."""

    errors: tuple[KnownError, ...]


TABLE = read_source(Path(__file__).with_suffix(".yaml")).read(Table)

_OWN_HEADER = re.compile(r"^'?(\w+)/\S+?'?(?:: No such file or directory| file not found)")
_COMMAND = re.compile(r'Unknown CMake command "(\w+)"')
_PACKAGE_OF_COMMAND = {
    "rosidl_": "rosidl_default_generators",
    "ament_auto_": "ament_cmake_auto",
    "ament_python_": "ament_cmake_python",
    "ament_add_gtest": "ament_cmake_gtest",
    "rclcpp_components_": "rclcpp_components",
}
"""Beginning of a command -> the package that has it."""


@explanation(BuildError)
def empty_file(symptom: BuildError) -> str | None:
    """A file that the build reads is empty."""
    return remedy("empty_file") if symptom.error.message == EMPTY else None


@explanation(BuildError, only=CPP)
def own_header(symptom: BuildError) -> str | None:
    """CMakeLists.txt does not say where the package's own headers lie."""
    match = _OWN_HEADER.match(symptom.error.message)
    if match is None or match[1] != symptom.package.name:
        return None
    return remedy("own_header", package=match[1])


@explanation(BuildError, only=CPP)
def command_of_another_package(symptom: BuildError) -> str | None:
    """CMakeLists.txt uses a command of a package without find_package() of it above."""
    match = _COMMAND.search(symptom.error.message)
    if match is None:
        return None
    for beginning, package in _PACKAGE_OF_COMMAND.items():
        if match[1].startswith(beginning):
            return remedy("command_of_another_package", package=package, command=match[1])
    return None


for _row in TABLE.errors:
    _entry = Explanation(BuildError, _row.mistake, _row.hint_for, __name__, sentence=_row.mistake)
    add(replace(_entry, example=_row.examples[0], only=_row.language))


@explanation(BuildError, general=True)
def any_build_error(symptom: BuildError) -> str:
    """Any other error: the build is run again to see it."""
    return remedy("any_build_error", package=symptom.package.name)
