"""Check of messages that are made of other messages: their values follow them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pydantic import Field

from grader.checks.check import NamedFields, Parameters, Subject, check, toleranced
from grader.checks.need import Recorded
from grader.diagnosis.explanation import cause_of, mistaken
from grader.diagnosis.no_messages import why_few, why_silent
from grader.diagnosis.not_following import NotFollowing, spread
from grader.findings.fields import FieldTolerance, within_words
from grader.findings.finding import Evidence, Finding, Plot, evidence_at
from grader.findings.value import FieldPath
from grader.findings.words import code, counted, listing
from grader.measure.derived_messages import DerivedMessages, Sample
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration

# A source that varies by fewer tolerances cannot tell a right value from a wrong one.
_CONCLUSIVE = 4.0


class Follows(Parameters):
    """Parameters of messages.follows."""

    of_bags = True
    about = ("published", "subscription")
    needs = (Recorded(), Recorded("source"))

    topic: TopicName = Field(description="Topic of the messages that are judged.")
    source: TopicName = Field(description="Recorded topic that their values come from.")
    fields: dict[FieldPath, FieldPath] = Field(
        min_length=1,
        description="Field of the judged message -> where its value comes from: a field of the "
        "source, or an expression such as `yaw(pose.pose.orientation)`.",
    )
    tolerance: FieldTolerance
    within: Duration = Field(0.5, description="Largest age of the values.", validate_default=False)
    settle: Duration = Field(
        2.0,
        description="For this time after the first message of the source, a node may still publish "
        "older values.",
        validate_default=False,
    )
    at_least: int = Field(5, ge=1, description="Least number of messages needed to judge.")

    def _asked(self) -> str:
        pairs = listing(f"{code(field)} = {code(value)}" for field, value in self.fields.items())
        of = f"the values of {code(self.source)}: {pairs}{within_words(self.tolerance)}"
        return f"on {code(self.topic)} {of}"

    def named_fields(self) -> Iterator[NamedFields]:
        """The judged fields, and those of the source."""
        for field, text in self.fields.items():
            yield NamedFields(("fields", field), self.topic, field)
            yield NamedFields(("fields", field), self.source, text)
        yield from toleranced("fields", self.topic, {}, self.tolerance)


@check("messages.follows", Subject.RECORDING, Follows)
def follows(recording: Recording, parameters: Follows) -> Finding:
    """The values of the messages follow those of another topic.

    Every message must hold the values of one message of the source that was published at most
    `within` before it. Delays of the machine do not count. Angles are compared on the circle. What
    is published before the first message of the source does not count.
    """
    source = code(parameters.source)
    messages, sources = recording.on(parameters.topic), recording.on(parameters.source)
    if not messages:
        return why_silent(recording, parameters.topic)
    if not sources:
        return Finding.ours(f"nothing was recorded on {source}, so it cannot be judged")
    derived = DerivedMessages.of(sources, parameters.fields, parameters.tolerance)
    samples = derived.samples(recording, messages, parameters.within)
    columns = zip(derived.tolerances, zip(*derived.table, strict=True), strict=True)
    if not all(spread(column) > _CONCLUSIVE * tolerance for tolerance, column in columns):
        return Finding.ours(f"the values on {source} hardly change: it cannot be judged")
    right = {sample.number for sample in samples if derived.fitting(sample.errors)}
    judged = _judged(recording, parameters, samples, right)
    if len(judged) < parameters.at_least:
        if len(messages) < parameters.at_least:
            return why_few(recording, parameters.topic, parameters.at_least)
        return mistaken(
            "not_after",
            f"of {counted(len(messages), 'message')} only {len(judged)} came after the first one "
            f"on {source}",
            evidence_at(recording, "the last message", messages[-1].stamp_ns),
            source=source,
        )
    wrong = [sample for sample in judged if sample.number not in right]
    if wrong:
        symptom = NotFollowing(source, derived, judged, wrong)
        return _held_up(recording, parameters, symptom) or _failure(recording, symptom)
    # Those that have older values than are right without what the machine took.
    late = [one for one in judged if not derived.fitting(one.errors[one.excused :])]
    # If most of the messages come when it took nothing, they decide for all.
    undisturbed = sum(not one.excused for one in judged)
    if late and undisturbed < max(parameters.at_least, len(judged) / 2):
        return Finding.undecided(
            f"{len(late)} of {counted(len(judged), 'message')} have older values, but the machine "
            "took the time from the process"
        )
    plots = tuple(_plot(recording, derived, judged, index) for index in range(len(derived.fields)))
    seen = f"right in all of {counted(len(judged), 'message')}"
    return Finding.as_asked(seen, Evidence(plots=plots))


def _judged(
    recording: Recording, parameters: Follows, samples: list[Sample], right: set[int]
) -> list[Sample]:
    """The messages that count: from the first right one on, if that comes soon enough."""
    # One that fits nothing may be made of a message that was not recorded.
    known = [sample for sample in samples if sample.is_known or sample.number in right]
    begin_ns = recording.on(parameters.source)[0].stamp_ns
    settled_ns = recording.own_end_ns(begin_ns, parameters.settle)
    first = next((index for index, sample in enumerate(known) if sample.number in right), 0)
    if first and known[first - 1].message.stamp_ns > settled_ns:
        first = 0
    return known[first:]


def _held_up(recording: Recording, parameters: Follows, symptom: NotFollowing) -> Finding | None:
    """Undecided, if the machine had taken as much time as all of the values are too old.

    What waits in the queues of several nodes after a delay takes as long again.
    """
    stolen_s = 0.0
    for sample, age_s in zip(symptom.examples, symptom.ages_s or (), strict=False):
        now_ns = sample.message.stamp_ns
        stolen_s = recording.stolen_s(now_ns - round(2.0 * age_s * NS), now_ns)
        if age_s - parameters.within > stolen_s:
            return None
    if stolen_s == 0.0:
        return None
    return Finding.held_up(f"{len(symptom.wrong)} of the messages have older values", stolen_s)


def _failure(recording: Recording, symptom: NotFollowing) -> Finding:
    sample = symptom.wrong[len(symptom.wrong) // 2]
    derived, judged, cause = symptom.derived, symptom.judged, cause_of(symptom)
    shown = symptom.wrong_fields or range(len(derived.fields))
    plots = (_plot(recording, derived, judged, index) for index in shown)
    label = f"message {sample.number} is wrong"
    evidence = evidence_at(recording, label, sample.message.stamp_ns, *plots)
    wrong = f"{len(symptom.wrong)} of {counted(len(judged), 'message')} wrong"
    return Finding(f"{cause.observed} ({wrong})", cause.hint, evidence)


def _plot(recording: Recording, derived: DerivedMessages, judged: list[Sample], index: int) -> Plot:
    field = derived.fields[index]
    # The least error is that of the source that the value comes from.
    errors = [min((row[index] for row in sample.errors), key=abs) for sample in judged]
    pairs = zip(judged, errors, strict=True)
    finite = [(sample, error) for sample, error in pairs if math.isfinite(error)]
    return Plot(
        f"{field}: how far it is off",
        "time since launch (s)",
        f"error of {field}",
        tuple(recording.since_launch_s(sample.message.stamp_ns) for sample, _ in finite),
        tuple(error for _, error in finite),
        (-derived.tolerances[index], derived.tolerances[index]),
    )
