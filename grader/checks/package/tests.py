"""Check of the student's own tests of a package."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.need import StudentTests
from grader.checks.package.package import OfPackage
from grader.diagnosis.mistake import mistaken
from grader.diagnosis.not_built import existing_package, why_not_built
from grader.findings.finding import Evidence, Finding
from grader.findings.wording import code, codes, counted
from grader.recording.submission import SubmissionRecord


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
