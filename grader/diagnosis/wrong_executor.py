"""Callbacks that do not run as they should: in another executor, group or thread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from grader.diagnosis.explanation import Symptom, explanation, remedy
from grader.measure.callback_runs import Run
from grader.measure.declarations import declares, executors
from grader.recording.model import Recording

SINGLE, MULTI = "SingleThreadedExecutor", "MultiThreadedExecutor"
GROUP = "MutuallyExclusiveCallbackGroup"
"""How a process declares a mutually exclusive one."""


@dataclass(frozen=True)
class OtherExecution(Symptom[str], concept="executors"):
    """Callbacks run at the same time where they should not, or the other way round.

    The explanations answer with a hint.

    Attributes:
        together: Whether they should run at the same time.
    """

    recording: Recording
    runs: Sequence[Run]
    together: bool


@explanation(OtherExecution)
def other_executor_spins(symptom: OtherExecution) -> str | None:
    """The MultiThreadedExecutor that was made never spins."""
    spun = dict(executors(symptom.recording))
    if not symptom.together or not declares(symptom.recording, "made") or MULTI in spun:
        return None
    return remedy("other_executor_spins")


@explanation(OtherExecution)
def one_group(symptom: OtherExecution) -> str | None:
    """The callbacks are in one mutually exclusive group, perhaps the default one."""
    groups = {run.group for run in symptom.runs}
    if not symptom.together or len(groups) != 1 or not min(groups).startswith(GROUP):
        return None
    return remedy("one_group")


@explanation(OtherExecution, general=True)
def other_executor_or_groups(symptom: OtherExecution) -> str:
    """Another kind of executor spins, or the callbacks are in other groups."""
    return remedy("other_executor_or_groups")
