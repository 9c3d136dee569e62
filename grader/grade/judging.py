"""Judging: every check of an assignment, on one submission and its recordings.

A check is worth the credit of its worst scenario, if its ``counts`` says nothing else: it passes
only where every scenario passes, and partial credit counts only as far as every scenario gives it.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from graphlib import TopologicalSorter

from grader.assignment.binding import BoundCheck
from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Counts
from grader.assignment.mutant import required_by
from grader.assignment.random_values import fixed_values
from grader.checks.check import Subject
from grader.checks.parameter.parameter import PARAMETERS_GIVEN
from grader.diagnosis.not_built import why_not_built
from grader.findings.finding import Finding, Status, Verdict
from grader.findings.words import speaking
from grader.grade.bags import chosen_bag
from grader.grade.chain import NOT_YOURS, Case, fault, judged, not_taken, why_incomplete
from grader.grade.model import SEVERITY, CheckResult, Grade, ScenarioFinding, points_for
from grader.grade.naming import Unnamed, with_chosen_names
from grader.grade.runtime_imports import with_runtime_imports
from grader.recording.model import Ending, Recording
from grader.recording.one_robot import of_robot
from grader.recording.submission import CPP, SubmissionRecord

_CREDIT: Mapping[Counts, Callable[[Sequence[float]], float]] = {
    Counts.WORST: min,
    Counts.BEST: max,
    Counts.MEDIAN: statistics.median_low,
    Counts.MEAN: statistics.fmean,
}


def judge_all(
    loaded: LoadedAssignment,
    submission: SubmissionRecord,
    recordings: Mapping[str, Recording],
    faults: Mapping[str, str] = {},
) -> Grade:
    """Judge a submission, with its names in the places of the assignment's variables.

    A check whose requirement did not pass is skipped, unless that failed alone, such as by a wrong
    name which the runs put right. So is one without credit that failed in a run whose parameters
    the node does not take, if a check is about that. A check that raises an exception ends as an
    error and keeps the traceback.

    Args:
        recordings: By scenario id; empty where nothing could be launched.
        faults: By scenario id: why there is no recording.
    """
    with speaking(submission.spoken(())):
        named = with_chosen_names(loaded, submission, recordings)
    loaded, submission = named.loaded, named.submission
    recordings = _with_fixed_values(loaded, recordings)
    imported = with_runtime_imports(submission, recordings.values())
    known = _Known(loaded, imported, recordings, faults, named.unnamed)
    bound = {item.spec.id: item for item in loaded.checks}
    parameters_first = _parameters_first(bound)
    order = TopologicalSorter(
        {name: (*item.spec.requires, *parameters_first[name]) for name, item in bound.items()}
    )
    results: dict[str, CheckResult] = {}
    for name in order.static_order():
        item = bound[name]
        blockers = _blockers(item.spec.requires, results)
        lacking = _blockers(parameters_first[name], results)
        with speaking(imported.spoken(known.about(item))):
            hints = tuple(map(str, item.spec.hints))
            findings = () if blockers else tuple(known.findings(item))
        # One mistake costs its own check, and takes no credit from another.
        if findings and lacking and known.is_lost_by_parameters(item, findings):
            blockers = lacking
        if blockers:
            findings = (_skipped([results[one] for one in blockers]),)
        results[name] = known.result(item, findings, blockers, hints)
    ordered = tuple(results[name] for name in bound)
    return Grade(loaded, submission, ordered, named.chosen)


def _parameters_first(bound: Mapping[str, BoundCheck]) -> dict[str, list[str]]:
    """By check, the checks of given parameters: all others are judged after them.

    But not what these require themselves.
    """
    requires = {name: item.spec.requires for name, item in bound.items()}
    checks = [name for name, item in bound.items() if item.check.name == PARAMETERS_GIVEN]
    before = set(checks).union(*(required_by(name, requires) for name in checks))
    return {name: [] if name in before else checks for name in bound}


@dataclass(frozen=True)
class _Known:
    """All that is known of a submission when its checks are judged.

    Attributes:
        loaded: The assignment, with the names that the submission chose.
        unnamed: Those of these names that are not known.
    """

    loaded: LoadedAssignment
    submission: SubmissionRecord
    recordings: Mapping[str, Recording]
    faults: Mapping[str, str]
    unnamed: tuple[Unnamed, ...]

    def about(self, bound: BoundCheck) -> list[str]:
        """The packages that a check is about: one that it names, or what its scenarios launch."""
        named = getattr(bound.parameters, "package", None)
        scenarios = self.loaded.scenarios_of(bound)
        return [named] if named else [name for one in scenarios for name in self._launched(one.id)]

    def findings(self, bound: BoundCheck) -> Iterator[ScenarioFinding]:
        """What a check says of the submission, or of each of its scenarios."""
        scenarios = [scenario.id for scenario in self.loaded.scenarios_of(bound)]
        unnamed = next((one for one in self.unnamed if self._needs(bound, one)), None)
        if unnamed is not None and (unnamed.finding.asks or not unnamed.can_run):
            yield from (ScenarioFinding(one, unnamed.finding) for one in scenarios or (None,))
        elif bound.check.subject is Subject.SUBMISSION:
            yield self._of_submission(bound)
        elif not scenarios:
            # Else a check that judges nothing would pass, and every student would get its points.
            yield ScenarioFinding(None, fault("there is no scenario that this check could judge"))
        else:
            found = (self._of_run(bound, scenario) for scenario in scenarios)
            yield from (_with_reason(one, unnamed) for one in found)

    def is_lost_by_parameters(self, bound: BoundCheck, findings: Sequence[ScenarioFinding]) -> bool:
        """Whether a check failed without credit in a run whose parameters the nodes do not take."""
        lost = _counted(bound.spec.counts, [item.finding for item in findings])
        failed = {item.scenario for item in findings if item.finding.status is Status.FAILED}
        runs = (run for name, run in self.recordings.items() if name in failed)
        return lost == (Status.FAILED, 0.0) and any(map(not_taken, runs))

    def result(
        self,
        bound: BoundCheck,
        findings: tuple[ScenarioFinding, ...],
        blockers: tuple[str, ...],
        hints: tuple[str, ...],
    ) -> CheckResult:
        """What a check is worth by its findings."""
        spec = bound.spec
        status, credit = _counted(spec.counts, [item.finding for item in findings])
        return CheckResult(
            id=spec.id,
            title=bound.title,
            status=status,
            points=points_for(spec.points, credit),
            max_points=spec.points,
            visibility=spec.visibility,
            scenarios=tuple(scenario.id for scenario in self.loaded.scenarios_of(bound)),
            findings=findings,
            waits_for=blockers,
            hints=hints,
            credit=credit,
            put_right=status is Status.FAILED and all(map(self._is_put_right, findings)),
            asked_name=getattr(bound.parameters, "asked_name", None),
        )

    def _needs(self, bound: BoundCheck, unnamed: Unnamed) -> bool:
        """Whether a check needs one of some names, or a run that cannot be made without them."""
        own = str(self.loaded.entries.get(bound.spec.id, {}).get("with"))
        is_lost = bound.check.subject is Subject.RECORDING and not unnamed.can_run
        return is_lost or any(f"{{{name}}}" in own for name in unnamed.variables)

    def _launched(self, scenario: str) -> tuple[str, ...]:
        """Packages that a scenario launches something of."""
        assignment = self.loaded.assignment
        launches = next(item.launch for item in assignment.scenarios if item.id == scenario)
        return tuple(
            dict.fromkeys(launch.package or assignment.packages[0].name for launch in launches)
        )

    def _of_submission(self, bound: BoundCheck) -> ScenarioFinding:
        only = bound.parameters.only
        if only in ("", CPP) or self.submission.spoken(self.about(bound)) != CPP:
            return judged(Case(bound, self.submission))
        unread = f"this check reads {only}, and the package is written in C++"
        asked = bound.parameters.asked_for
        return ScenarioFinding(None, Finding.error(asked, unread, hint=NOT_YOURS))

    def _of_run(self, bound: BoundCheck, scenario: str) -> ScenarioFinding:
        recording, launched = self.recordings.get(scenario), self._launched(scenario)
        if recording is None and (why := self._why_no_bag(scenario)) is not None:
            return ScenarioFinding(scenario, why)
        if recording is None:
            lost = self.faults.get(scenario, f"there is no recording of the scenario {scenario!r}")
            packages = [*launched, *(one.name for one in self.loaded.assignment.packages)]
            finding = why_incomplete(self.submission, launched, "a run of what was handed in")
            finding = finding or why_not_run(self.submission, packages) or fault(lost)
        elif unusable := _why_unusable(recording, scenario, self.submission):
            finding = fault(unusable)
        elif (robot := bound.spec.robot) and robot not in recording.scenes:
            finding = fault(f"the recording has no robot {robot!r}")
        else:
            shown = of_robot(recording, robot) if robot else recording
            return judged(Case(bound, self.submission, shown, scenario, launched))
        return ScenarioFinding(scenario, finding)

    def _why_no_bag(self, scenario: str) -> Finding | None:
        """What is wrong with the bags, if the scenario reads one and cannot."""
        run = next(one for one in self.loaded.assignment.scenarios if one.id == scenario)
        found = run.bag and chosen_bag(run.bag, scenario, self.submission)
        return found if isinstance(found, Finding) else None

    def _is_put_right(self, item: ScenarioFinding) -> bool:
        """Whether no check has to wait for a finding: it passed, or the others do not need it."""
        names = item.finding.names
        runs = [run for name, run in self.recordings.items() if item.scenario in (None, name)]
        goes_on = item.finding.status is Status.PASSED or item.finding.stands_alone
        return goes_on or (bool(names) and all(names <= run.names for run in runs))


def _with_reason(item: ScenarioFinding, unnamed: Unnamed | None) -> ScenarioFinding:
    """What was judged under the author's example, as what it is: nothing has the role."""
    if unnamed is None or item.finding.status not in (Status.FAILED, Status.PASSED):
        return item
    why = unnamed.finding
    if item.finding.status is Status.PASSED:
        # Only its name is that of the example.
        return replace(item, finding=why)
    finding = replace(item.finding, expected=why.expected, observed=why.observed, hint=why.hint)
    return replace(item, finding=finding)


def _counted(counts: Counts, findings: Sequence[Finding]) -> tuple[Status, float]:
    """Status and credit of a check that judged several scenarios.

    Those that could not be judged leave it open only where they matter: a check that failed
    elsewhere is worth no more.
    """
    worst = min((finding.status for finding in findings), key=SEVERITY.index)
    if worst is Status.SKIPPED:
        return worst, 0.0
    least, credit = (
        _CREDIT[counts]([open_ if one.status is Status.ERROR else one.credit for one in findings])
        for open_ in (0.0, 1.0)
    )
    if least < credit:
        return Status.ERROR, 0.0
    return (Status.PASSED if credit == 1.0 else Status.FAILED), credit


def _blockers(requires: Iterable[str], results: Mapping[str, CheckResult]) -> tuple[str, ...]:
    """Of the checks that a check requires, or of theirs, those that failed or ended as an error."""
    required = [results[name] for name in requires]
    lacking = [one for one in required if one.status != Status.PASSED and not one.put_right]
    return tuple(dict.fromkeys(root for item in lacking for root in item.waits_for or (item.id,)))


def _skipped(blockers: Sequence[CheckResult]) -> ScenarioFinding:
    titles = " and ".join(f"“{one.title}”" for one in blockers)
    if any(one.status is Status.ERROR for one in blockers):
        observed, hint = f"{titles} could not be judged, so neither could this", NOT_YOURS
    else:
        observed = f"{titles} did not pass, so this could not be judged"
        hint = f"Fix {titles} first: this is not a second mistake."
    return ScenarioFinding(
        None, Finding(observed, hint, verdict=Verdict.SKIPPED, expected=f"{titles} to pass first")
    )


def why_not_run(submission: SubmissionRecord, packages: Iterable[str]) -> Finding | None:
    """Why nothing of a submission could be launched, or None where every package was built."""
    for package in packages:
        cause = why_not_built(submission, package)
        if cause is not None:
            return replace(
                cause.after("was not run because the package was not built"),
                expected=f"the package {package} to build, so that its nodes can be launched",
            )
    return None


def _with_fixed_values(
    loaded: LoadedAssignment, recordings: Mapping[str, Recording]
) -> Mapping[str, Recording]:
    """The recordings, also those from before a number got its name under ``values``."""
    found = dict(recordings)
    for scenario in loaded.assignment.scenarios:
        fixed, recording = fixed_values(scenario), found.get(scenario.id)
        if recording is not None and not fixed.keys() <= recording.values.keys():
            found[scenario.id] = replace(recording, values={**fixed, **recording.values})
    return found


def _why_unusable(recording: Recording, scenario: str, submission: SubmissionRecord) -> str | None:
    """Why a recording cannot be judged, or None."""
    if recording.faults:
        return "; ".join(recording.faults)
    if recording.ending is Ending.FAULT:
        return "the run was ended by a fault that left no message"
    if (recording.scenario, recording.submission.sha256) != (scenario, submission.sha256):
        other = f"{recording.scenario!r} of {recording.submission.id!r}"
        return f"the recording is of another run, {other}"
    return None
