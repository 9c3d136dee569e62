"""Checks of rotations: whether a node converts them rightly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.findings.finding import Evidence, Finding, Moment
from grader.findings.finding import first_seen
from grader.measure.numbering import published
from grader.checks.need import PUBLISHED, Recorded
from grader.findings.words import code, counted, listing
from grader.diagnosis.explanation import remedy
from grader.diagnosis.wrong_value import misread_words, was_integer
from grader.diagnosis.no_messages import why_not_sent
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.process.not_called import why_raised
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.words import MATH, SLEEP, worded
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import QuantityOf
from grader.spec.unit import Dimension

from .case import Case, CaseLimits, cases
from .common_mistakes import explain, wrong_part
from .conversion import (
    CONVERSIONS,
    Group,
    WrongMessage,
    degrees,
)
from .evidence import evidence_of, right_words, shown

# An answer takes a callback of some microseconds; a question that was sent later than this
# before the end may be unanswered.
_TIME_TO_ANSWER_S = 0.25
# Share of the answers that must be right on another topic to say that they are there.
_ELSEWHERE = 0.9
# Share of the answers that must belong to the question before to say so.
_STALE = 0.8
_AT_ONCE_S = 0.05
# A callback that converts answers within some ms; a slower one holds up the questions.
_SLOW_S = 0.05
# What rounding or single precision may cost, but no mistake in a formula.
_LITTLE_RAD = 1e-3
# Answers before the first question: a node may publish one message when it is created.
_GREETINGS = 2
# Nor does one that says everything twice; one that does not stop answers the last far more often.
_MORE_COPIES = 2
_UNPROMPTED_HINT = (
    "Publish in the callback of the subscription, once for each message, and not in a timer."
)

Tolerance = Annotated[float, QuantityOf(Dimension.ANGLE, minimum=0.0, exclusive=True)]


class Answers(Parameters):
    """Parameters of rotation.answers."""

    needs = (Recorded(), PUBLISHED)

    stimulus: TopicName = Field(description="Topic on which the probe sends what to convert.")
    topic: TopicName = Field(description="Topic on which the node answers.")
    conversion: Literal["axis_angle_to_quaternion", "rpy_to_quaternion", "quaternion_to_rpy"] = (
        Field(
            description="What is asked. `axis_angle_to_quaternion`: `data` = [x, y, z, angle] to a "
            "Quaternion; `rpy_to_quaternion`: a Vector3 of roll, pitch and yaw about fixed axes to "
            "a Quaternion; `quaternion_to_rpy`: the reverse."
        )
    )
    tolerance: Tolerance = Field(
        math.radians(0.01),
        description="Largest angle between the answer's rotation and the right one, by default "
        "0.01 deg.",
        validate_default=False,
    )
    length: float = Field(
        1e-6, gt=0, description="How far the length of a quaternion may be from 1."
    )
    cases: tuple[Group, ...] = Field(
        (),
        description="Which cases are judged: `ordinary`, `scaled` (an axis or a quaternion whose "
        "length is not 1), `gimbal_lock`, `zero` (an axis or a quaternion of length 0); by "
        "default all.",
    )
    at_least: int = Field(1, ge=1, description="How many such cases must have been sent.")

    def _asked(self) -> str:
        which = f" ({listing((group.words for group in self.cases), 'or')})" if self.cases else ""
        unit = (
            "" if self.conversion == "quaternion_to_rpy" else f", length 1 within {self.length:g}"
        )
        return (
            f"each message on {code(self.stimulus)}{which} answered on {code(self.topic)} with "
            f"the same rotation, within {degrees(self.tolerance)}{unit}"
        )

    @property
    def limits(self) -> CaseLimits:
        """What is right."""
        return CaseLimits(self.tolerance, self.length)

    def judges(self, case: Case) -> bool:
        """Whether a case is judged."""
        return not self.cases or case.group in self.cases


@check("rotation.answers", Subject.RECORDING, Answers, concept="angles")
def answers(recording: Recording, parameters: Answers) -> Finding:
    """Rotations are converted correctly.

    The probe sends what to convert, and the node answers. An answer is right if its rotation is the
    right one within `tolerance`, as scipy computes it, and if a quaternion has length 1. `q` and
    `-q` are the same rotation. Angles are compared as rotations, so at gimbal lock every roll and
    yaw with the right rotation is right. A zero axis or a zero quaternion may be answered by no
    rotation at all (the identity) or by nothing, but not by NaN. Answers may come late or twice.
    Each answer is paired with its question, so a missing answer does not shift the others. A node
    that repeats its last answer without a new question is wrong.
    """
    sent = recording.sent.get(parameters.stimulus, ())
    received = recording.on(parameters.topic)
    if not sent:
        return why_not_sent(recording, parameters.stimulus)
    if not received:
        return _elsewhere(recording, parameters) or why_silent(recording, parameters.topic)
    try:
        found = cases(parameters.conversion, sent, received, parameters.limits)
    except WrongMessage as error:
        return Finding.ours(f"the messages are not what the check converts: {error}")
    judged = [case for case in found if parameters.judges(case) and _answerable(recording, case)]
    wrong = [case for case in judged if case.answers and not case.good]
    missing = [case for case in judged if not case.answers and not case.optional]
    evidence = evidence_of(
        recording, parameters.conversion, parameters.topic, parameters.tolerance, judged
    )
    stop_if(_elsewhere(recording, parameters) if wrong or missing else None)
    if _is_behind(found):
        return Finding(
            "each answer belongs to the message before: that to case 1 came after case 2 had been "
            f"sent, and so on; case {len(found)}, the last, has none",
            "Compute from the message that the callback is called with, then publish. What an "
            "earlier call stored is one message old.",
            evidence,
        )
    if wrong:
        return _wrong(parameters, judged, wrong, evidence)
    if missing:
        return _missing(recording, parameters, judged, missing, evidence)
    unasked = sum(message.stamp_ns < sent[0].stamp_ns for message in received)
    if unasked > _GREETINGS:
        evidence = replace(evidence, moments=first_seen(recording, received))
        observed = (
            f"{counted(unasked, 'message')} on {code(parameters.topic)} before anything was asked "
            f"on {code(parameters.stimulus)}"
        )
        return Finding(observed, _UNPROMPTED_HINT, evidence)
    copies = max((len(case.answers) for case in judged[:-1]), default=1)
    if judged and (times := len(judged[-1].answers)) > max(copies, 1) + _MORE_COPIES:
        when_s = recording.since_launch_s(received[-1].stamp_ns)
        evidence = replace(evidence, moments=(Moment("once more the same answer", when_s),))
        observed = (
            f"case {judged[-1].number} was answered {counted(times, 'time')}: the same answer "
            f"comes on {code(parameters.topic)} again and again when nothing new is asked"
        )
        return Finding(observed, _UNPROMPTED_HINT, evidence)
    if len(judged) < parameters.at_least:
        return _too_few(recording, parameters, found, judged)
    return Finding.as_asked(_summary(judged), evidence)


def _elsewhere(recording: Recording, parameters: Answers) -> Finding | None:
    """The right answers on another topic, as exchanged publishers give them."""
    for topic, received in recording.messages.items():
        if topic == parameters.topic:
            continue
        try:
            found = cases(
                parameters.conversion,
                recording.sent[parameters.stimulus],
                received,
                parameters.limits,
            )
        except WrongMessage:
            continue
        if sum(bool(case.answers) and case.good for case in found) > _ELSEWHERE * len(found):
            return Finding(
                f"the answers to {code(parameters.stimulus)} are right, but come on {code(topic)}",
                f"The callback of {code(parameters.stimulus)} publishes on "
                f"{code(parameters.topic)}: look which publisher has which topic, and which "
                "callback uses it.",
                Evidence(moments=first_seen(recording, received)),
            )
    return None


def _answerable(recording: Recording, case: Case) -> bool:
    """Whether there is an answer, or was time for one."""
    left_s = (recording.stop_ns - case.asked_ns) / NS
    return bool(case.answers) or case.optional or left_s >= _TIME_TO_ANSWER_S


def _summary(judged: list[Case]) -> str:
    errors = [answer.error_rad for case in judged for answer in case.answers]
    unanswered = sum(not case.answers for case in judged)
    silent = f", {unanswered} without an answer, as allowed" if unanswered else ""
    worst = f", largest error {degrees(max(errors))}" if errors else ""
    return f"all of {counted(len(judged), 'case')} right{worst}{silent}"


def _is_behind(found: tuple[Case, ...]) -> bool:
    """Whether each answer comes at once with the next question, and the last question has none.

    A slow node has late answers too, but not at once.
    """
    answered = [case for case in found if case.answers]
    prompt = sum(case.behind_s is not None and case.behind_s < _AT_ONCE_S for case in answered)
    return (
        len(answered) == len(found) - 1 > 1
        and not found[-1].answers
        and prompt >= _STALE * len(answered)
    )


def _wrong(
    parameters: Answers, judged: list[Case], wrong: list[Case], evidence: Evidence
) -> Finding:
    conversion = CONVERSIONS[parameters.conversion]
    first = wrong[0]
    answer = first.answers[0]
    observed = f"{len(wrong)} of {counted(len(judged), 'case')} wrong"
    words, hint = _explanation(parameters, judged, wrong)
    observed += f": {words}" if words else ""
    observed += (
        f"; case {first.number}, {conversion.shown(first.row)}, gave {shown(answer)}"
        f" instead of {right_words(parameters.conversion, first)}"
    )
    return Finding(observed, hint, evidence)


def _explanation(parameters: Answers, judged: list[Case], wrong: list[Case]) -> tuple[str, str]:
    """What went wrong, in words, and what to try."""
    misread = [v for case in wrong for v in case.answers[0].row if was_integer(v)]
    if misread:
        return (
            misread_words("a number of the answer"),
            remedy("float_field"),
        )
    infinite = [case for case in wrong if not case.answers[0].finite]
    if 2 * len(infinite) >= len(wrong):
        return (
            "the answer is not a number",
            "Look for a division by zero, such as by the length of a zero axis, and for "
            + worded("math.asin or numpy.arcsin", "std::asin or std::acos")
            + " of more than 1, which rounding can give: limit it to [-1, 1].",
        )
    bad = [(case.row, case.answers[0].row) for case in wrong if case.answers[0].finite]
    if len({case.answers[0].row for case in judged if case.answers}) == 1 and len(bad) > 1:
        return (
            "every answer is the same",
            "Compute the answer in the callback from the message that it is called with, and set "
            "the fields before you publish; a new Quaternion has w = 1, all else is 0.",
        )
    if all(case.group in (Group.GIMBAL_LOCK, Group.ZERO) for case in wrong):
        # There, several mistakes give the same: at gimbal lock the usual formula does so by
        # rounding errors, and of a zero axis nothing is left that could be normalized.
        return _by_kind(parameters, wrong)
    # Before the formulas: of a tiny angle, taken for degrees, as little is left.
    if all(_none(row) for _, row in bad) and (
        len(bad) < len(judged) or all(case.group is Group.SCALED for case in wrong)
    ):
        return (
            "the answer is no rotation at all",
            "Only a zero axis, a quaternion of zeros and an angle of 0 are no rotation: look for "
            "the condition that takes something else for one, such as a short axis, a small "
            "angle, a sum or a product that is 0.",
        )
    if parameters.conversion == "quaternion_to_rpy" and all(
        math.isclose(abs(answer[1]), 0.5 * math.pi, abs_tol=1e-6) for _, answer in bad
    ):
        return (
            "they are answered as at gimbal lock, with a pitch of 90 deg or -90 deg, but are not "
            "there",
            "Test for gimbal lock right at it only: abs(sin_pitch) > 0.9999999. At 0.99 the pitch "
            "is 82 deg, at 0.9999 it is 89.2 deg.",
        )
    questions = np.array([question for question, _ in bad])
    found = explain(
        parameters.conversion,
        questions,
        np.array([answer for _, answer in bad]),
        parameters.tolerance,
    )
    if found is not None:
        mistake, share = found
        of = f"all {len(bad)}" if share == 1.0 else f"{round(share * len(bad))} of {len(bad)}"
        return f"{mistake.words} (that gives {of} of these answers)", str(mistake.hint)
    part = wrong_part(parameters.conversion, questions, np.array([row for _, row in bad]))
    return part or _by_kind(parameters, wrong)


def _none(row: tuple[float, ...]) -> bool:
    """Whether an answer says that nothing turns."""
    return row in ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def _by_kind(parameters: Answers, wrong: list[Case]) -> tuple[str, str]:
    """The explanation of wrong answers by kind, where no known mistake explains them."""
    groups = {case.group for case in wrong}
    answers = [case.answers[0] for case in wrong]
    lengths = [answer.length for answer in answers if answer.length]
    if groups != {Group.ZERO} and all(answer.error_rad < _LITTLE_RAD for answer in answers):
        if lengths and max(abs(length - 1.0) for length in lengths) > parameters.length:
            return (
                f"the rotation is right, but the quaternion's length is not 1 (it is "
                f"{min(lengths):.6g} to {max(lengths):.6g})",
                "Normalize what you compute with, and compute in double precision.",
            )
        return "the rotation is a little off", "Compute in double precision, and round nothing."
    if groups == {Group.ZERO}:
        return (
            "",
            "Answer with no rotation (x = y = z = 0, w = 1) or with nothing: test whether the "
            "length is 0 before you divide by it.",
        )
    if groups == {Group.SCALED}:
        return "", "Divide by the length first: the axis and the quaternion may have any length."
    if groups == {Group.GIMBAL_LOCK} and parameters.conversion == "quaternion_to_rpy":
        return (
            "",
            "The usual formulas divide 0 by 0 there: where abs(sin_pitch) > 0.9999999, answer "
            "with the pitch asin(2 (w y - z x)), which has a sign, roll 0 and yaw "
            f"2 * {MATH}atan2(z, w).",
        )
    return "", "Work the first wrong case out by hand and compare term by term."


def _missing(
    recording: Recording,
    parameters: Answers,
    judged: list[Case],
    missing: list[Case],
    evidence: Evidence,
) -> Finding:
    conversion = CONVERSIONS[parameters.conversion]
    observed = (
        f"{len(missing)} of {counted(len(judged), 'case')} without an answer, the first: case "
        f"{missing[0].number}, {conversion.shown(missing[0].row)}"
    )
    received = recording.on(parameters.topic)
    lost = published(received) - len(received)
    cause = why_ended(recording, observed) or why_unsubscribed(
        recording, parameters.stimulus, observed, missing[-1].asked_ns
    )
    if cause is None and len(missing) <= lost:
        cause = Finding.undecided(f"{observed}; {counted(lost, 'answer')} got lost on the way")
    if cause is None and any(_starved(recording, case) for case in missing):
        cause = Finding.undecided(f"{observed}, but the machine took the time from the process")
    cause = cause or why_raised(recording, observed, missing[0].asked_ns)
    return cause or Finding(
        observed,
        "Publish once in every call of the callback. Look for an exception that is caught, and "
        "for a condition that leaves cases out.",
        evidence,
    )


def _starved(recording: Recording, case: Case) -> bool:
    left_s = (recording.stop_ns - case.asked_ns) / NS
    return left_s - recording.stolen_s(case.asked_ns, recording.stop_ns) < _TIME_TO_ANSWER_S


def _too_few(
    recording: Recording, parameters: Answers, found: Sequence[Case], judged: list[Case]
) -> Finding:
    seen = f"only {counted(len(judged), 'case')} of {parameters.at_least} could be sent"
    cause = why_ended(recording, seen) or why_unsubscribed(recording, parameters.stimulus, seen)
    if cause is not None:
        return cause
    if any(case.behind_s is not None for case in found) or _is_slow(recording, found):
        first = found[0]
        sent = Moment(f"case {first.number} is sent", recording.since_launch_s(first.asked_ns))
        return Finding(
            f"{seen}, because the answers come late",
            f"A callback must return soon: no {SLEEP} and no loop that waits.",
            Evidence(moments=(sent,)),
        )
    return Finding.undecided(seen)


def _is_slow(recording: Recording, found: Sequence[Case]) -> bool:
    """Whether the node is slow by itself: the next question follows the answer."""
    answered = [case for case in found if case.answers]
    if len(answered) < 2:
        return False
    begin_ns, end_ns = answered[0].asked_ns, answered[-1].asked_ns
    own_s = (end_ns - begin_ns) / NS - recording.stolen_s(begin_ns, end_ns)
    return own_s / (len(answered) - 1) > _SLOW_S
