"""Check of what package.xml says about the package: description, maintainer, licence."""

from __future__ import annotations

import re
from collections.abc import Iterator

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.package.package import OfPackage
from grader.diagnosis.mistake import mistaken
from grader.diagnosis.not_built import existing_package, why_no_manifest
from grader.findings.finding import Evidence, Finding
from grader.findings.wording import code
from grader.recording.submission import PackageRecord, SourceError, SubmissionRecord

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
