"""What a save changed, in one line, and the scores of an evening as a row of bars."""

from __future__ import annotations

from collections.abc import Sequence

from grader.findings.finding import Status
from grader.findings.words import counted
from grader.grade.model import CheckResult, total
from grader.report.model.result_model import CheckPart, Result
from grader.report.text.words import STATUS, cut, number
from grader.spec.safe_text import one_line

_BARS = "▁▂▃▄▅▆▇█"
_MOST = 4
_LONGEST = 120


def what_changed(before: Result, after: Result) -> str:
    """``“Every 300 ms”: failed → passed, +1.5``: the cause first, then what gave the most points.

    Checks that only wait for another one now, or no longer wait, are counted.
    """
    changed = changed_checks(before, after)
    waits = [pair for pair in changed if pair[1].status is Status.SKIPPED]
    waited = [pair for pair in changed if pair[0].status is Status.SKIPPED]
    waited = [pair for pair in waited if pair[1].status is Status.PASSED]
    shown = [pair for pair in changed if pair not in (*waits, *waited)]
    shown.sort(key=lambda pair: (pair[1].id != after.first_to_fix, -abs(_gain(*pair))))
    lines = [f"“{one_line(new.title)}”: {change(old, new)}" for old, new in shown[:_MOST]]
    lines += _together(waits, "now wait", "now waits")
    lines += _together(waited, "no longer wait", "no longer waits")
    known = {check.id for check in before.checks}
    new = sum(check.id not in known for check in after.checks)
    counts = {"more": len(shown[_MOST:]), "new": new}
    lines += [f"{count} {what}" for what, count in counts.items() if count]
    return "; ".join(lines) or "no check changed"


def _together(pairs: Sequence[tuple[CheckPart, CheckPart]], many: str, one: str) -> list[str]:
    """``15 checks now wait, −9.7``."""
    gain = total(_gain(*pair) for pair in pairs)
    words = f"{counted(len(pairs), 'check')} {one if len(pairs) == 1 else many}"
    return [words + _signed(gain)] if pairs else []


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
    return words + _signed(_gain(old, new))


def _signed(gain: float) -> str:
    return f", {'+' if gain > 0 else '−'}{number(abs(gain))}" if gain else ""


def early_line(check: CheckResult) -> str:
    """How a check that failed before ends now, while others still run."""
    if check.status is Status.PASSED:
        return f"“{one_line(check.title)}” passes now"
    seen = cut(one_line(check.decisive.finding.observed), _LONGEST)
    return f"“{one_line(check.title)}” still fails: {seen}"


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
