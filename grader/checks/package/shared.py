"""Check of the files that a package installs beside its programs: launch files, parameters."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import PurePosixPath

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.package.package import OfPackage
from grader.checks.wrong_name import Named
from grader.diagnosis.mistake import mistaken
from grader.diagnosis.not_built import existing_package, why_not_built
from grader.findings.finding import Finding
from grader.findings.wording import code, codes
from grader.findings.words import worded
from grader.recording.submission import SubmissionRecord
from grader.spec.names import Thing
from grader.spec.nearest_name import meant


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
    package, asked = existing_package(submission, parameters.package), parameters.asked_for
    installed = [path for path, _ in package.shared]
    found = [path for path in installed if fnmatchcase(path, parameters.path)]
    if found:
        return Finding.passed(asked, f"it installs {codes(found)}")
    if not installed:
        # Each package installs its package.xml.
        return Finding.ours("what it installs was not recorded: grade again")
    folder, _, name = parameters.path.rpartition("/")
    other = _meant(parameters.path, installed) if parameters.remap else None
    if other:
        seen = f"it installs {code(other)} instead; everything else was judged with that file"
        found_there = mistaken("other_file", seen, file=name, folder=f"{package.name}/{folder}")
        names = parameters.wrong(f"share/{package.name}/{other}")
        return replace(found_there, names=names)
    own = [path for path in submission.files if fnmatchcase(path.rpartition("/")[2], name)]
    seen = f"{codes(own)} is handed in, but not installed; " if own else ""
    line = f"install(DIRECTORY {folder} DESTINATION share/${{PROJECT_NAME}})` in CMakeLists.txt"
    if package.build_type != "ament_cmake":
        line = worded(
            python=f"('share/{package.name}/{folder}', glob('{parameters.path}'))` in data_files "
            "of setup.py",
            cpp=line,
        )
    mistake = "not_installed" if own else "no_such_file"
    return mistaken(mistake, f"{seen}it installs {codes(installed)}", line=line)


def _meant(path: str, installed: Iterable[str]) -> str | None:
    """The installed file that is probably meant by a path: of that name elsewhere, or of its kind.

    Of several in its folder it is the one with the nearest name.
    """
    asked = PurePosixPath(path)
    others = [PurePosixPath(one) for one in installed]
    same = [str(one) for one in others if one.name == asked.name]
    kind = [
        str(one)
        for one in others
        if (one.parent, one.suffixes) == (asked.parent, asked.suffixes) and asked.suffix
    ]
    return meant(path, same or kind)
