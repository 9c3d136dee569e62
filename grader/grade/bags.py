"""Which bag of a submission a scenario judges, or why there is none."""

from __future__ import annotations

from fnmatch import fnmatchcase

from grader.assignment.bag import BagOptions
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Finding, Verdict
from grader.findings.words import code, codes
from grader.recording.submission import BagRecord, SubmissionRecord
from grader.submission.read.answers import FILE as ANSWERS_FILE


def chosen_bag(
    options: BagOptions, scenario: str, submission: SubmissionRecord
) -> BagRecord | Finding:
    """The bag that a scenario judges, or what is wrong with what was handed in.

    Of several that fit, ``rosgrade.yaml`` says which one is meant: ``square: bags/second``.
    """
    expected = f"a bag {code(options.name)}" if options.name else "a bag"
    if submission.bags is None and submission.problem is not None:
        cause = mistaken("no_bag", f"nothing can be read: {submission.problem}")
    elif submission.bags is None:
        cause = Finding.ours("the bags were not read: grade again")
    else:
        found = _chosen(options, scenario, submission.bags, dict(submission.answers))
        if isinstance(found, BagRecord):
            return found
        cause = found
    return Finding(cause.observed, cause.hint, verdict=cause.verdict, expected=expected)


def same_bags(bag: BagRecord, submission: SubmissionRecord) -> list[str]:
    """Paths of other bags with the same messages: it was handed in more than once."""
    every = submission.bags or ()
    return [one.path for one in every if one.path != bag.path and _is_same(one, bag)]


def _chosen(
    options: BagOptions, scenario: str, bags: tuple[BagRecord, ...], answers: dict[str, str]
) -> BagRecord | Finding:
    named = [one for one in bags if options.name is None or _is_called(one, options.name)]
    answer = answers.get(scenario)
    if answer is not None:
        meant = [one for one in named if one.path == answer.rstrip("/")]
        if not meant:
            there = codes(one.path for one in named) or "no such bag"
            seen = f"{code(ANSWERS_FILE)} says {code(answer)}, and there is {there}"
            return Finding(seen, "Correct the file.", verdict=Verdict.ASKS)
        named = meant
    if not named:
        nothing = "there is no bag, a folder with `metadata.yaml` and an `.mcap` or `.db3` file"
        if bags:
            nothing = f"there is {codes(one.path for one in bags)}, and no other bag"
        return mistaken("no_bag", nothing)
    read = [one for one in named if one.problem is None]
    if not read:
        return mistaken("broken_bag", f"{code(named[0].path)}: {named[0].problem}")
    others = [one for one in read[1:] if not _is_same(one, read[0])]
    if others:
        seen = f"there are {codes(one.path for one in read)}, and only one of them can be judged"
        line = code(f"{scenario}: {read[0].path}")
        hint = f"Hand in one, or a file {code(ANSWERS_FILE)} too, with a line such as {line}."
        return Finding(seen, hint, verdict=Verdict.ASKS)
    return read[0]


def _is_called(bag: BagRecord, name: str) -> bool:
    return fnmatchcase(bag.path.rpartition("/")[2], name)


def _is_same(one: BagRecord, other: BagRecord) -> bool:
    return (one.sha256, one.topics) == (other.sha256, other.topics) and bool(one.sha256)
