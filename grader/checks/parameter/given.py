"""The check that a node takes the parameters which the launch gives it."""

from __future__ import annotations

from dataclasses import replace

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.need import Doubt, ParametersGiven
from grader.checks.wrong_name import Renamable
from grader.diagnosis.no_parameter import why_not_taken
from grader.findings.finding import Finding
from grader.findings.wording import code, codes, listing
from grader.measure.parameter_calls import misnamed_parameters
from grader.recording.model import Recording
from grader.spec.names import Names, Thing, WrongName


class Given(Renamable):
    """Parameters of parameter.given."""

    doubt = Doubt.ANSWER_MISSED
    needs = (ParametersGiven(),)

    names: tuple[str, ...] = Field(
        (), description="Names of the parameters; by default all that the launch gives."
    )

    def _asked(self) -> str:
        return f"{codes(self.names) or 'every parameter that the launch gives'} declared by a node"


PARAMETERS_GIVEN = "parameter.given"


@check(PARAMETERS_GIVEN, Subject.RECORDING, Given)
def given(recording: Recording, parameters: Given) -> Finding:
    """The node declares the parameters that the launch gives it.

    Judged by what the student's nodes answer when the probe asks for their parameters. Without an
    answer of each node it passes: what the node does is judged by other checks. Where a launch file
    starts the nodes, a parameter file that is for none of them fails, too. If it fails, others
    that fail in the same scenario, without partial credit, are skipped, but for those it requires.
    """
    given, asked = parameters.names or recording.given_parameters, parameters.asked_for
    finding = why_not_taken(recording, given)
    if finding is None:
        return Finding.passed(asked, "no other parameter is given")
    likely = misnamed_parameters(recording, given) if parameters.remap else {}
    if not likely:
        return finding
    names = Names.of(WrongName(Thing.PARAMETER, other, name) for name, other in likely.items())
    meant = listing(f"{code(other)} for {code(name)}" for name, other in likely.items())
    seen = f"{finding.observed}; everything else was judged with {meant}"
    return replace(finding, observed=seen, names=names)
