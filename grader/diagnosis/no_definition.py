"""The student's definition of an interface: where it is, or why it is not there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePosixPath

from grader.checks.finding import Evidence
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.not_built import existing_package, why_no_package
from grader.spec.nearest_name import nearest
from grader.submission.record import Definition, PackageRecord, SourceError, SubmissionRecord


@dataclass(frozen=True)
class InterfaceName:
    """The parts of an interface's name, such as ``bot_msgs/msg/BotStatus``.

    Attributes:
        kind: ``msg``, ``srv`` or ``action``; folder and suffix of its definition.
    """

    package: str
    kind: str
    name: str

    @classmethod
    def of(cls, interface: str) -> InterfaceName:
        """Take a name apart."""
        return cls(*interface.split("/"))

    @property
    def file(self) -> str:
        """The file of its definition, in the package's folder."""
        return f"{self.kind}/{self.name}.{self.kind}"

    def __str__(self) -> str:
        """Write it in full."""
        return f"{self.package}/{self.kind}/{self.name}"


def find_definition(submission: SubmissionRecord, interface: InterfaceName) -> Definition | Cause:
    """The definition of an interface, as the build took it or else as it was handed in.

    Returns:
        The definition with its path in the submission, or why there is none.
    """
    cause = why_no_package(submission, interface.package)
    if cause is not None:
        return cause
    package = existing_package(submission, interface.package)
    own = [item for item in package.definitions if item.file == package.file(interface.file)]
    built = [item for item in package.generated if item.file == interface.file]
    if built:
        # Where CMakeLists.txt takes it from is the student's affair.
        same = [item for item in (*own, *package.definitions) if item.text == built[0].text]
        return same[0] if same else Definition(package.file(interface.file), built[0].text)
    return own[0] if own else cause_of(NoDefinition(submission, package, interface))


@dataclass(frozen=True)
class NoDefinition(Symptom[Cause]):
    """The definition of an interface is missing."""

    submission: SubmissionRecord
    package: PackageRecord
    interface: InterfaceName


@explanation(NoDefinition)
def near_definition(symptom: NoDefinition) -> Cause | None:
    """The file lies in a wrong folder, or has a similar name or another suffix."""
    near = _near(symptom.package, symptom.interface)
    if near is None:
        return None
    found, what = near
    wanted, file = symptom.package.file(symptom.interface.file), symptom.interface.file
    return Cause(
        f"found {code(found.file)}: {what}",
        f"Name it {code(wanted)}, and write {code(file)} in CMakeLists.txt.",
        Evidence(places=(SourceError(found.file, None, what),)),
    )


@explanation(NoDefinition)
def in_other_package(symptom: NoDefinition) -> Cause | None:
    """The file lies in another package."""
    wanted = symptom.package.file(symptom.interface.file)
    for other in symptom.submission.packages:
        if other.name == symptom.interface.package:
            continue
        for item in other.definitions:
            if PurePosixPath(item.file).name == PurePosixPath(wanted).name:
                return Cause(
                    f"found {code(item.file)}, in the package {code(other.name)}",
                    f"Move it to {code(wanted)}: the package is a part of the interface's name.",
                    Evidence(places=(SourceError(item.file, None, "in another package"),)),
                )
    return None


@explanation(NoDefinition, general=True)
def no_definition(symptom: NoDefinition) -> Cause:
    """There is no such file."""
    interface = symptom.interface
    there = [item.file for item in symptom.package.definitions]
    return Cause(
        f"there is no {code(interface.file)}"
        + (f"; found {codes(there)} only" if there else f", and no .{interface.kind} file at all"),
        f"Make the folder {code(interface.kind)} beside package.xml, and in it the file "
        f"{code(f'{interface.name}.{interface.kind}')}.",
    )


def _near(package: PackageRecord, interface: InterfaceName) -> tuple[Definition, str] | None:
    """A file that was probably meant, with what is wrong with it."""
    files = [(item, PurePosixPath(item.file)) for item in package.definitions]
    suffix = f".{interface.kind}"
    for item, path in files:
        if (path.stem, path.suffix) == (interface.name, suffix):
            folder = path.parent.name
            where = f"the folder is called {code(folder)}" if folder else "it is in no folder"
            if folder == interface.kind:
                where = "this folder does not lie beside package.xml"
            return item, f"{where}, and the definition belongs into {code(interface.kind)}"
    for item, path in files:
        if path.stem == interface.name:
            told = code(path.suffix) if path.suffix else "missing"
            return item, f"its suffix is {told}, not {code(suffix)}"
    for item, path in files:
        if path.stem.lower() == interface.name.lower():
            return item, "upper and lower case differ"
        if _folded(path.stem) == _folded(interface.name):
            return item, "the name of an interface is in CamelCase"
    stems = {path.stem: item for item, path in files if path.suffix.lower() == suffix}
    match = nearest(interface.name, stems)
    return (stems[match], f"it is not called {code(interface.name)}") if match else None


def _folded(name: str) -> str:
    return name.replace("_", "").replace("-", "").lower()
