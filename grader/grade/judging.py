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
from grader.assignment.model import Counts, Scenario
from grader.assignment.random_values import fixed_values
from grader.assignment.selection import required_by
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
    checks = {bound.spec.id: bound for bound in loaded.checks}
    parameters_first = _parameters_first(checks)
    order = TopologicalSorter(
        {name: (*bound.spec.requires, *parameters_first[name]) for name, bound in checks.items()}
    )
    results: dict[str, CheckResult] = {}
    for name in order.static_order():
        results[name] = known.result(checks[name], parameters_first[name], results)
    return Grade(loaded, submission, tuple(results[name] for name in checks), named.chosen)


def _parameters_first(checks: Mapping[str, BoundCheck]) -> dict[str, list[str]]:
    """By check, the checks of given parameters that are judged before it.

    None for those checks themselves, and for what they require: these come first.
    """
    requires = {name: bound.spec.requires for name, bound in checks.items()}
    of_parameters = [n for n, bound in checks.items() if bound.check.name == PARAMETERS_GIVEN]
    earliest = set(of_parameters).union(*(required_by(name, requires) for name in of_parameters))
    return {name: [] if name in earliest else of_parameters for name in checks}


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

    def result(
        self,
        bound: BoundCheck,
        parameters_first: Iterable[str],
        results: Mapping[str, CheckResult],
    ) -> CheckResult:
        """Judge one check, or skip it by the results of the checks before it."""
        blockers = _blockers(bound.spec.requires, results)
        with speaking(self.submission.spoken(self.about(bound))):
            hints = tuple(map(str, bound.spec.hints))
            findings = () if blockers else tuple(self.findings(bound))
        # One mistake costs its own check, and takes no credit from another.
        lost_parameters = _blockers(parameters_first, results)
        if findings and lost_parameters and self.is_lost_by_parameters(bound, findings):
            blockers = lost_parameters
        if blockers:
            findings = (_skipped([results[name] for name in blockers]),)
        return self._with_points(bound, findings, blockers, hints)

    def findings(self, bound: BoundCheck) -> Iterator[ScenarioFinding]:
        """What a check says of the submission, or of each of its scenarios."""
        scenarios = [scenario.id for scenario in self.loaded.scenarios_of(bound)]
        unnamed = next((item for item in self.unnamed if self._needs(bound, item)), None)
        if unnamed is not None and (unnamed.finding.asks or not unnamed.can_run):
            yield from (ScenarioFinding(name, unnamed.finding) for name in scenarios or (None,))
        elif bound.check.subject is Subject.SUBMISSION:
            yield self._of_submission(bound)
        elif not scenarios:
            # Else a check that judges nothing would pass, and every student would get its points.
            yield ScenarioFinding(None, fault("there is no scenario that this check could judge"))
        else:
            for scenario in scenarios:
                yield _with_reason(self._of_run(bound, scenario), unnamed)

    def is_lost_by_parameters(self, bound: BoundCheck, findings: Sequence[ScenarioFinding]) -> bool:
        """Whether a check failed without credit in a run whose parameters the nodes do not take."""
        if _status_and_credit(bound.spec.counts, findings) != (Status.FAILED, 0.0):
            return False
        failed = {item.scenario for item in findings if item.finding.status is Status.FAILED}
        runs = (run for name, run in self.recordings.items() if name in failed)
        return any(not_taken(run) is not None for run in runs)

    def _with_points(
        self,
        bound: BoundCheck,
        findings: tuple[ScenarioFinding, ...],
        blockers: tuple[str, ...],
        hints: tuple[str, ...],
    ) -> CheckResult:
        """What a check is worth by its findings."""
        spec = bound.spec
        status, credit = _status_and_credit(spec.counts, findings)
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
        packages = self.loaded.assignment.packages
        launches = self._scenario(scenario).launch
        return tuple(dict.fromkeys(launch.package or packages[0].name for launch in launches))

    def _scenario(self, name: str) -> Scenario:
        return next(item for item in self.loaded.assignment.scenarios if item.id == name)

    def _of_submission(self, bound: BoundCheck) -> ScenarioFinding:
        only = bound.parameters.only
        if only in ("", CPP) or self.submission.spoken(self.about(bound)) != CPP:
            return judged(Case(bound, self.submission))
        unread = f"this check reads {only}, and the package is written in C++"
        asked = bound.parameters.asked_for
        return ScenarioFinding(None, Finding.error(asked, unread, hint=NOT_YOURS))

    def _of_run(self, bound: BoundCheck, scenario: str) -> ScenarioFinding:
        recording, robot = self.recordings.get(scenario), bound.spec.robot
        if recording is None:
            return ScenarioFinding(scenario, self._why_not_recorded(scenario))
        unusable = _why_unusable(recording, scenario, self.submission)
        if unusable is not None:
            return ScenarioFinding(scenario, fault(unusable))
        if robot:
            if robot not in recording.scenes:
                return ScenarioFinding(scenario, fault(f"the recording has no robot {robot!r}"))
            recording = of_robot(recording, robot)
        launched = self._launched(scenario)
        return judged(Case(bound, self.submission, recording, scenario, launched))

    def _why_not_recorded(self, scenario: str) -> Finding:
        """Why there is no recording of a scenario, the deepest cause first."""
        launched = self._launched(scenario)
        packages = [*launched, *(package.name for package in self.loaded.assignment.packages)]
        lost = self.faults.get(scenario, f"there is no recording of the scenario {scenario!r}")
        return (
            self._why_no_bag(scenario)
            or why_incomplete(self.submission, launched, "a run of what was handed in")
            or why_not_run(self.submission, packages)
            or fault(lost)
        )

    def _why_no_bag(self, scenario: str) -> Finding | None:
        """What is wrong with the bags, if the scenario reads one and cannot."""
        options = self._scenario(scenario).bag
        bag = chosen_bag(options, scenario, self.submission) if options else None
        return bag if isinstance(bag, Finding) else None

    def _is_put_right(self, item: ScenarioFinding) -> bool:
        """Whether no check has to wait for a finding: it passed, or the others do not need it."""
        finding = item.finding
        if finding.status is Status.PASSED or finding.stands_alone:
            return True
        runs = [run for name, run in self.recordings.items() if item.scenario in (None, name)]
        return bool(finding.names) and all(finding.names.all_in(run.names) for run in runs)


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


def _status_and_credit(counts: Counts, items: Sequence[ScenarioFinding]) -> tuple[Status, float]:
    """Status and credit of a check that judged several scenarios.

    Those that could not be judged leave it open only where they matter: a check that failed
    elsewhere is worth no more. So the credit is counted twice, with none and with all for them.
    """
    findings = [item.finding for item in items]
    worst = min((finding.status for finding in findings), key=SEVERITY.index)
    if worst is Status.SKIPPED:
        return worst, 0.0

    def credit(if_not_judged: float) -> float:
        return _CREDIT[counts](
            [if_not_judged if one.status is Status.ERROR else one.credit for one in findings]
        )

    least, most = credit(0.0), credit(1.0)
    if least < most:
        return Status.ERROR, 0.0
    return (Status.PASSED if most == 1.0 else Status.FAILED), most


def _blockers(requires: Iterable[str], results: Mapping[str, CheckResult]) -> tuple[str, ...]:
    """Of the checks that a check requires, or of theirs, those that failed or ended as an error."""
    roots: list[str] = []
    for result in (results[name] for name in requires):
        if result.status is not Status.PASSED and not result.put_right:
            roots += result.waits_for or (result.id,)
    return tuple(dict.fromkeys(roots))


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
    completed = dict(recordings)
    for scenario in loaded.assignment.scenarios:
        fixed, recording = fixed_values(scenario), recordings.get(scenario.id)
        if recording is not None and not fixed.keys() <= recording.values.keys():
            completed[scenario.id] = replace(recording, values={**fixed, **recording.values})
    return completed


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
