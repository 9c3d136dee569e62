"""Which bag of a submission a scenario judges, or why there is none."""

from __future__ import annotations

from dataclasses import replace
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
    if submission.bags is not None:
        bag = _chosen(options, scenario, submission.bags, dict(submission.answers))
    elif submission.problem is not None:
        bag = mistaken("no_bag", f"nothing can be read: {submission.problem}")
    else:
        bag = Finding.ours("the bags were not read: grade again")
    return replace(bag, expected=expected) if isinstance(bag, Finding) else bag


def same_bags(bag: BagRecord, submission: SubmissionRecord) -> list[str]:
    """Paths of other bags with the same messages: it was handed in more than once."""
    others = (one for one in submission.bags or () if one.path != bag.path)
    return [one.path for one in others if _is_same(one, bag)]


def _chosen(
    options: BagOptions, scenario: str, bags: tuple[BagRecord, ...], answers: dict[str, str]
) -> BagRecord | Finding:
    candidates = [bag for bag in bags if options.name is None or _is_called(bag, options.name)]
    answer = answers.get(scenario)
    if answer is not None:
        there = codes(bag.path for bag in candidates) or "no such bag"
        candidates = [bag for bag in candidates if bag.path == answer.rstrip("/")]
        if not candidates:
            seen = f"{code(ANSWERS_FILE)} says {code(answer)}, and there is {there}"
            return Finding(seen, "Correct the file.", verdict=Verdict.ASKS)
    if not candidates:
        nothing = "there is no bag, a folder with `metadata.yaml` and an `.mcap` or `.db3` file"
        if bags:
            nothing = f"there is {codes(bag.path for bag in bags)}, and no other bag"
        return mistaken("no_bag", nothing)
    readable = [bag for bag in candidates if bag.problem is None]
    if not readable:
        return mistaken("broken_bag", f"{code(candidates[0].path)}: {candidates[0].problem}")
    first = readable[0]
    if all(_is_same(bag, first) for bag in readable[1:]):
        return first
    seen = f"there are {codes(bag.path for bag in readable)}, and only one of them can be judged"
    line = code(f"{scenario}: {first.path}")
    hint = f"Hand in one, or a file {code(ANSWERS_FILE)} too, with a line such as {line}."
    return Finding(seen, hint, verdict=Verdict.ASKS)


def _is_called(bag: BagRecord, name: str) -> bool:
    return fnmatchcase(bag.path.rpartition("/")[2], name)


def _is_same(one: BagRecord, other: BagRecord) -> bool:
    return (one.sha256, one.topics) == (other.sha256, other.topics) and bool(one.sha256)
