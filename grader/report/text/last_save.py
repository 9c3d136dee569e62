"""What a save changed, in one line, and the scores of an evening as a row of bars."""

from __future__ import annotations

from collections.abc import Sequence

from grader.findings.finding import Status
from grader.grade.model import CheckResult, total
from grader.report.model.result_model import CheckPart, Result
from grader.report.text.words import STATUS, cut, number
from grader.safe_text import one_line

_BARS = "▁▂▃▄▅▆▇█"
_MOST = 4
_LONGEST = 120


def what_changed(before: Result, after: Result) -> str:
    """``period: failed → passed, +1.5``; of many checks those with the most points."""
    changed = sorted(changed_checks(before, after), key=lambda pair: -abs(_gain(*pair)))
    lines = [f"{new.id}: {change(old, new)}" for old, new in changed[:_MOST]]
    known = {check.id for check in before.checks}
    new = sum(check.id not in known for check in after.checks)
    counts = {"more": len(changed) - len(lines), "new": new}
    lines += [f"{count} {what}" for what, count in counts.items() if count]
    return "; ".join(lines) or "no check changed"


def changed_checks(before: Result, after: Result) -> list[tuple[CheckPart, CheckPart]]:
    """The checks that ended differently: before, and after."""
    known = {check.id: check for check in before.checks}
    pairs = ((known[check.id], check) for check in after.checks if check.id in known)
    return [
        (old, new) for old, new in pairs if (old.status, old.points) != (new.status, new.points)
    ]


def change(old: CheckPart, new: CheckPart) -> str:
    """``failed → passed, +1.5``."""
    words = STATUS[new.status].word
    if old.status is not new.status:
        words = f"{STATUS[old.status].word} → {words}"
    gain = _gain(old, new)
    return words + (f", {'+' if gain > 0 else '−'}{number(abs(gain))}" if gain else "")


def early_line(check: CheckResult) -> str:
    """How a check that failed before ends now, while others still run."""
    if check.status is Status.PASSED:
        return f"{check.id} passes now"
    return f"{check.id} still fails: {cut(one_line(check.decisive.finding.observed), _LONGEST)}"


def failed_scenarios(result: Result) -> frozenset[str]:
    """The scenarios in which a check failed."""
    findings = (one for check in result.of(Status.FAILED) for one in check.findings)
    return frozenset(
        one.scenario for one in findings if one.scenario and one.status is Status.FAILED
    )


def bars(scores: Sequence[float | None], most: float) -> str:
    """A bar for each score, out of ``most`` points; a dot where there was no grade."""
    steps = len(_BARS) - 1
    return "".join(
        "·" if score is None else _BARS[round(steps * score / most) if most else 0]
        for score in scores
    )


def _gain(old: CheckPart, new: CheckPart) -> float:
    """Points gained; 0 where one of the two was not judged."""
    judged = Status.ERROR not in (old.status, new.status)
    return total((new.points, -old.points)) if judged else 0.0
