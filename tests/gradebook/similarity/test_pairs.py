"""Copies are found in every disguise, and different right solutions are not taken for them.

The solutions are those of rosgrade's own assignments.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import pytest

from grader.assignment.changed_reference import apply
from grader.assignment.load import load_assignment
from grader.assignment.mutant_file import load_mutants
from grader.gradebook.similarity import (
    FEWEST,
    all_hashes,
    find_pairs,
    fingerprints,
    shared_passages,
)
from grader.machine.scratch import Scratch
from grader.submission.kept_source import read_kept_source
from tests.gradebook.similarity.copies import renamed

Files = Mapping[str, str]
LESSONS = ("bot_controller", "executors", "quaternion")


@cache
def solutions(lesson: str) -> tuple[dict[str, Files], frozenset[int]]:
    """The right solutions in unusual styles, and the hashes of the reference."""
    loaded = load_assignment(lesson)
    mutants = load_mutants(loaded.assignment, loaded.folder)
    found = {}
    with Scratch("similarity") as scratch:
        for variant in mutants.variants:
            apply(variant, mutants.reference, scratch / variant.id)
            found[variant.id] = read_kept_source(scratch / variant.id).files
    return found, frozenset(all_hashes(read_kept_source(mutants.reference).files))


def copy_of(files: Files) -> Files:
    return {
        path.replace("bot", "robot"): renamed(text) if path.endswith(".py") else text
        for path, text in files.items()
    }


@pytest.mark.parametrize("lesson", LESSONS)
def test_a_copy_that_was_renamed_and_reordered_is_found(lesson: str) -> None:
    solved, known = solutions(lesson)
    own = {name: fingerprints(files).keys() - known for name, files in solved.items()}
    special = [name for name in own if len(own[name]) >= FEWEST]
    assert len(special) >= 7
    copies = {f"{name} again": fingerprints(copy_of(solved[name])).keys() for name in special}
    pairs = find_pairs({**own, **{name: prints - known for name, prints in copies.items()}}, {})
    assert {(one.first, one.second) for one in pairs} == {
        (name, f"{name} again") for name in special
    }


@pytest.mark.parametrize("lesson", LESSONS)
def test_different_right_solutions_are_no_pairs(lesson: str) -> None:
    solved, known = solutions(lesson)
    own = {name: fingerprints(files).keys() - known for name, files in solved.items()}
    assert find_pairs(own, {}) == []


CPP = """\
void Node::scan(const Scan & scan)  // each scan
{
  double nearest = 10.0;
  for (size_t i = 0; i < scan.ranges.size(); i += 2) {
    if (scan.ranges[i] > 0.1 && scan.ranges[i] < nearest) nearest = scan.ranges[i];
  }
  Twist twist;
  twist.linear.x = nearest > 1.0 ? 0.2 : 0.05 * nearest;
  publisher_->publish(twist);
}
"""
CPP_COPY = """\
#include <limits>
void Robot::onScan(Scan const & s) {
    double d = 9.5;
    for (size_t k = 0; k < s.ranges.size(); k += 3)
    {
        /* the smallest */
        if (s.ranges[k] > 0.2 && s.ranges[k] < d)
        {
            d = s.ranges[k];
        }
    }
    Twist t;
    t.linear.x = d > 1.5 ? 0.22 : 0.1 * d;
    pub_->publish(t);
}
"""


def test_a_copy_in_cpp_is_found_and_its_lines_are_marked_on_both_sides() -> None:
    first, second = fingerprints({"a.cpp": CPP}), fingerprints({"src/b.cpp": CPP_COPY})
    [pair] = find_pairs({"ana": first.keys(), "ben": second.keys()}, {})
    assert (pair.first, pair.second) == ("ana", "ben") and pair.score > 0.8
    marks = shared_passages(first, second, pair.shared)
    assert [marks[0]["a.cpp", line] for line in (3, 4, 5, 8)] == [1] * 4
    assert [marks[1]["src/b.cpp", line] for line in (3, 4, 9, 13)] == [1] * 4
    assert ("src/b.cpp", 1) not in marks[1]


def test_a_team_is_no_pair_but_may_be_one_with_another() -> None:
    prints = {name: set(range(20)) for name in ("ana", "ben", "cai")}
    pairs = find_pairs(prints, {"ana": "red", "ben": "red"})
    assert [(one.first, one.second) for one in pairs] == [("ana", "cai"), ("ben", "cai")]


def test_what_more_than_a_quarter_of_the_class_has_does_not_count() -> None:
    lecture = set(range(100))
    prints = {f"{name}": lecture | {1000 + name} for name in range(11)}
    prints |= {f"other {name}": {2000 + name} for name in range(29)}
    assert find_pairs(prints, {}) == []
    few = {name: codes if int(name) < 10 else {0} for name, codes in list(prints.items())[:11]}
    few |= {name: codes for name, codes in prints.items() if name.startswith("other")}
    assert len(find_pairs(few, {})) == 45


def test_too_much_source_is_not_read_and_costs_no_time() -> None:
    huge = {"a.py": "x = 1\n" * 200_000, "b.py": "y = f(x) + g(x) * h(x) - i(x)\n"}
    assert {gram.file for grams in fingerprints(huge).values() for gram in grams} == {"b.py"}


def test_code_that_python_could_not_parse_is_compared_too() -> None:
    assert fingerprints({"a.py": "def f(:\n  x = 'open\n" + "y = f(x) + g(x)\n" * 5})
