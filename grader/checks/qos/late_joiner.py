"""What a subscription that comes late gets of what was published before it."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.need import Act, Stimulated
from grader.diagnosis.explanation import cause_of
from grader.diagnosis.kept_history import OtherHistory, TooFewKept, TooManyKept, UnpublishedBefore
from grader.diagnosis.no_messages import why_few
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.finding import Finding
from grader.findings.words import code, counted
from grader.recording.model import Recording
from grader.spec.name import Id, TopicName


class LateJoiner(Parameters):
    """Parameters of qos.late_joiner."""

    needs = (Stimulated(Act.JOIN, "joiner"),)

    topic: TopicName = Field(
        description="Fully qualified topic name. If the scenario does not record it, the late "
        "joiner is the only subscription."
    )
    joiner: Id = Field(description="The `name` of a `join` among the stimuli.")
    last: int = Field(
        ge=0, description="How many of the messages from before it joined the late joiner must get."
    )

    def _asked(self) -> str:
        who = f"a late joiner on {code(self.topic)} gets"
        if self.last == 0:
            return f"{who} no message published before it"
        return f"{who} the last {counted(self.last, 'message')} published before it, and no more"


@check("qos.late_joiner", Subject.RECORDING, LateJoiner, concept="qos")
def late_joiner(recording: Recording, parameters: LateJoiner) -> Finding:
    """A late joiner gets the last messages, and no more.

    Judged by behaviour: a subscription of the probe joins in the middle of the run, and gets the
    last messages that were published before (`last` of them, or none for 0), as the durability
    and depth of the publisher make it. Messages that were published just while it was matched
    may count as before or after.

    A scenario that records the topic subscribes to it from the start. Without `record`, there
    is no subscription until the late joiner's; the sequence numbers of the publisher's middleware
    show how many messages came before. So the check detects a publisher that publishes only while
    there is a subscription.
    """
    join = next((item for item in recording.joins if item.name == parameters.joiner), None)
    if join is None:
        return _why_not_judged(recording, parameters, "the run ended before it joined")
    case = OtherHistory.of(recording, parameters.topic, parameters.last, join)
    number, last = len(case.history), parameters.last
    if case.number <= last:
        if not recording.on(parameters.topic) and recording.joined.get(join.name):
            return cause_of(UnpublishedBefore(**vars(case)))
        published_before = f"only {counted(case.number, 'message')} had been published"
        seen = f"when it joined, {published_before} of the {last + 1} that are needed to judge"
        return _why_not_judged(recording, parameters, seen)
    if number > last:
        return cause_of(TooManyKept(**vars(case)))
    if not case.is_newest:
        seen = f"{case.seen}, but not the newest ones: some were lost on their way"
        return Finding.undecided(seen)
    if number < case.least:
        return cause_of(TooFewKept(**vars(case)))
    return Finding.as_asked(case.seen, case.evidence)


def _why_not_judged(recording: Recording, parameters: LateJoiner, seen: str) -> Finding:
    """Why it did not join, or too little had been published to see what is kept of it."""
    needed = parameters.last + 1
    if len(recording.on(parameters.topic)) < needed:
        return why_few(recording, parameters.topic, needed)
    return why_ended(recording, seen) or Finding.ours(seen)
