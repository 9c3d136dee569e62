"""Who or what ended a build that did not come to its end by itself.

A limit is the student's affair. The machine, or somebody who killed the build, is not: that raises.
"""

from __future__ import annotations

import errno
import re
import shutil

from grader.errors import GraderFault, machine_fault
from grader.submission.build.bounded import Outcome
from grader.submission.build.colcon import Colcon
from grader.submission.intake.members import MIB

_SUMMARY = re.compile(r"Summary: \d+ packages? finished")
# How a shell and bubblewrap tell of a signal: its number is added.
_SIGNALLED = 128
# What colcon, Python, compilers and make say of a program of theirs that was killed.
_KILLED = re.compile(r"code -9\b|\bSIGKILL\b|\bKilled\b")
_LEAST_FREE_BYTES = 64 * MIB
# Error messages of the programs that set up a sandbox, the last of which starts colcon.
_NOT_STARTED = re.compile(r"(?:/\S*/)?(?:sh|unshare|mkdir|mount|setpriv|bwrap|prlimit): .*")


class BuildKilled(GraderFault):
    """A build was ended from outside; once more it may come to its end."""


def check_machine(
    outcome: Outcome, colcon: Colcon, *, memory_ran_out: bool, is_second: bool
) -> None:
    """Raise an error for a failure that is not the student's fault.

    Args:
        memory_ran_out: Whether the machine killed a process for lack of memory during the build.
        is_second: Whether the build was killed before, which is what its own program may do.

    Raises:
        BuildKilled: The build was ended from outside.
        GraderFault: The machine ran out of something, or the sandbox could not be started.
    """
    status, output = outcome.status, outcome.output
    if status is None:
        return
    failed = status != 0
    was_killed = failed and _KILLED.search(output) is not None
    if was_killed and memory_ran_out:
        raise GraderFault("this machine ran out of memory: a program of the build was killed")
    unstarted = _NOT_STARTED.match(output)
    if failed and unstarted and "Starting >>>" not in output:
        raise GraderFault(f"the sandbox of the build could not be started: {unstarted[0]}")
    # A program of the build may also kill itself; then it does so again.
    if _is_cut_off(status, output) or (was_killed and not is_second):
        raise BuildKilled(
            f"colcon ended in the middle of a build (status {status}), twice, although the "
            "build was within its limits. Was it stopped, or did memory run out? Grade again"
        )
    if failed and "No space left on device" in output:
        for place in (colcon.scratch, colcon.install.parent):
            full = machine_fault(OSError(errno.ENOSPC, "", str(place)))
            if full is not None and shutil.disk_usage(place).free < _LEAST_FREE_BYTES:
                raise full


def _is_cut_off(status: int, output: str) -> bool:
    """Whether colcon ended without coming to its end.

    In a sandbox no program of a build can send it a signal (see :func:`student_filter`), and none
    can write to its memory: see :data:`~grader.submission.build.colcon.UNTOUCHABLE`.
    """
    if _SUMMARY.search(output):
        # It ends with the status of what failed, such as sys.exit(137).
        return False
    if status < 0 or status > _SIGNALLED:
        return True
    return "Starting >>>" in output


def passed_limit(outcome: Outcome, wall_s: float) -> str | None:
    """The limit that a build passed, in words for the student."""
    if outcome.ended_by_us is None:
        return None
    waited = "it waited for something" if outcome.waited else "it was still computing"
    reasons = {
        "time": f"after {wall_s:.0f} s: {waited}",
        "output": "because it wrote too much output",
    }
    reason = reasons.get(outcome.ended_by_us, f"because {outcome.ended_by_us}")
    return f"the build was ended {reason}"
