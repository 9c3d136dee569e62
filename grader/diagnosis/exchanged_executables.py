"""Whether setup.py lets an executable run what another one should."""

from __future__ import annotations

import re

from grader.diagnosis.cause import Cause
from grader.findings.finding import Evidence
from grader.findings.wording import code
from grader.recording.model import Recording
from grader.submission.record import PackageRecord, SourceError


def why_exchanged(recording: Recording) -> Cause | None:
    """The cause if a launched executable runs what bears the name of another one; else None."""
    launched = {process.name for process in recording.processes}
    for process in recording.processes:
        name, _, executable = process.name.partition("/")
        package = recording.submission.package(name)
        other = package and _runs(package, executable)
        # Where both run, each node is there all the same.
        if package and other and f"{name}/{other}" not in launched:
            target = dict(package.entry_points)[executable]
            place = SourceError(package.file("setup.py"), None, f"{executable} = {target}")
            return Cause(
                f"in setup.py the executable {code(executable)} runs {code(target)}, the "
                f"function of {code(other)}",
                "Each line of console_scripts is name = module:function. Give each name its own "
                "function.",
                Evidence(places=(place,)),
            )
    return None


def _runs(package: PackageRecord, executable: str) -> str | None:
    """The other executable whose function one runs, by the names of both."""
    targets = dict(package.entry_points)
    own = targets.get(executable, "")
    for other, target in targets.items():
        parts, its_parts = (re.split(r"[.:]", text) for text in (own, target))
        if (
            other in parts
            and executable not in parts
            and (executable in its_parts or target == own)
        ):
            return other
    return None
