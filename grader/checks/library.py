"""Python libraries that a submission imports and that it may not use where it is graded."""

from __future__ import annotations

import re

from grader.checks.wording import code, codes
from grader.nearest import nearest
from grader.recording.model import Recording
from grader.submission.rosdistro import PACKAGES

_MISSING = re.compile(r"No module named '([A-Za-z_]\w*)")


def library_hint(message: str, recording: Recording) -> str | None:
    """What to do about an import of a library that is not among those of the assignment.

    Args:
        message: Of the ``ModuleNotFoundError``.
        recording: Of the run; where it was in a sandbox, it names the libraries.

    Returns:
        A hint, or None where the name is rather that of a package of the student's or of ROS.
    """
    allowed = recording.environment.get("libraries")
    found = _MISSING.match(message)
    if not allowed or found is None:
        return None
    own = {package.name for package in recording.submission.packages}
    if nearest(found[1], own | PACKAGES, cutoff=0.8) is not None:
        return None
    return (
        "Where this is graded, Python has the standard library, ROS 2 and "
        f"{codes(allowed.split())}; {code(found[1])} is not among them, even if it is installed "
        "on your machine: do without it, or ask your instructor to allow it. If it is a module of "
        "your own: import it from its package (from my_package import my_module), and let "
        "setup.py install it (packages=[...])."
    )
