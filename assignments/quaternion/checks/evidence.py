"""Questions and answers about rotations, as people read them and as they are drawn."""

from __future__ import annotations

import math

import numpy as np

from grader.findings.finding import Case as CaseError
from grader.findings.finding import Cases, Evidence, Moment, Table
from grader.recording.model import Recording

from .case import Answer, Case
from .common_mistakes import rpy_of
from .conversion import (
    CONVERSIONS,
    Group,
    answer_words,
    number,
    sine_of_pitch,
)

_ROWS = 12


def shown(answer: Answer) -> str:
    """An answer, with the length of a quaternion where it is not 1."""
    words = answer_words(answer.row)
    if answer.length is not None and answer.finite and abs(answer.length - 1.0) > 1e-3:
        words += f" (length {answer.length:.4g})"
    return words


def right_words(conversion: str, case: Case) -> str:
    """The right answer to a case, in the answer's own form."""
    if case.group is Group.ZERO:
        return "no rotation or no answer"
    if conversion == "quaternion_to_rpy":
        if case.group is Group.GIMBAL_LOCK:
            _, _, z, w = case.right
            pitch = math.copysign(0.5 * math.pi, sine_of_pitch(case.right))
            # With a roll of 0 the whole turn about the vertical axis is yaw.
            angles = answer_words((0.0, pitch, 2.0 * math.atan2(z, w)))
            return f"{angles}, or other angles of the same rotation"
        return answer_words(rpy_of(np.array([case.right]))[0].tolist())
    answer = case.answers[0].row if case.answers else case.right
    # Of the two signs the one that is nearer to the answer.
    product = sum(one * other for one, other in zip(answer, case.right, strict=True))
    sign = -1.0 if product < 0.0 else 1.0
    return answer_words([sign * value for value in case.right])


def _error_deg(case: Case) -> float | None:
    error_rad = case.answers[0].error_rad if case.answers else math.inf
    return math.degrees(error_rad) if math.isfinite(error_rad) else None


def evidence_of(
    recording: Recording, conversion: str, topic: str, tolerance_rad: float, judged: list[Case]
) -> Evidence:
    """Wrong answers in a table, and the error of each case."""
    question = CONVERSIONS[conversion].shown
    wrong = [case for case in judged if not case.good]
    rows = tuple(
        (
            str(case.number),
            question(case.row),
            right_words(conversion, case),
            shown(case.answers[0]) if case.answers else "no answer",
            "" if (error_deg := _error_deg(case)) is None else f"{number(error_deg)} deg",
        )
        for case in wrong[:_ROWS]
    )
    header = ("case", "asked", "expected", "answered", "error")
    title = f"Wrong answers on {topic}"
    return Evidence(
        moments=tuple(
            Moment(f"case {case.number} was sent", recording.since_launch_s(case.asked_ns))
            for case in wrong[:1]
        ),
        tables=(Table(title, header, rows),) if rows else (),
        cases=(
            Cases(
                title=f"Answers on {topic}",
                label="error of the rotation (deg)",
                limit=math.degrees(tolerance_rad),
                cases=tuple(
                    CaseError(
                        question(case.row),
                        case.group.words,
                        _error_deg(case),
                    )
                    for case in judged
                ),
            ),
        ),
    )
