"""Pairing of answers with questions: late, twice, or not at all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from assignments.quaternion.checks.pairing import pair


def right_for(answers: list[int | None], questions: int) -> np.ndarray:
    """Which answers are right: each names the question that it would be right for, or None."""
    return np.array([[answer == question for answer in answers] for question in range(questions)])


def paired(asked, answers, *, optional=()):
    """Pair answers, each given as (time, question that it is right for)."""
    times = [time for time, _ in answers]
    right = right_for([question for _, question in answers], len(asked))
    flags = [index in optional for index in range(len(asked))]
    return pair(asked, times, right.reshape(len(asked), len(answers)), flags)


class TestInStep:
    def test_each_answer_comes_before_the_next_question(self):
        assert paired([0, 10, 20], [(1, 0), (11, 1), (21, 2)]) == (0, 1, 2)

    def test_wrong_answers_belong_to_the_newest_question(self):
        assert paired([0, 10, 20], [(1, None), (11, None), (21, None)]) == (0, 1, 2)

    def test_no_answers_or_no_questions(self):
        assert paired([0, 10], []) == ()
        assert pair([], [1, 2], np.zeros((0, 2), dtype=bool), []) == (None, None)

    def test_an_answer_before_the_first_question_answers_none(self):
        assert paired([10, 20], [(1, None), (11, 0), (21, 1)]) == (None, 0, 1)


class TestMissing:
    def test_a_missing_answer_shifts_nothing(self):
        assert paired([0, 10, 20, 30], [(1, 0), (21, 2), (31, 3)]) == (0, 2, 3)

    def test_a_missing_answer_among_wrong_ones_shifts_nothing(self):
        assert paired([0, 10, 20, 30], [(1, None), (21, None), (31, None)]) == (0, 2, 3)

    def test_a_missing_answer_among_late_ones(self):
        answers = [(25, 0), (26, 2), (35, 3)]
        assert paired([0, 10, 20, 30], answers) == (0, 2, 3)

    def test_an_optional_question_stays_open(self):
        assert paired([0, 10, 20], [(1, 0), (21, 2)], optional={1}) == (0, 2)


class TestLate:
    def test_all_answers_come_after_the_last_question(self):
        assert paired([0, 1, 2], [(50, 0), (51, 1), (52, 2)]) == (0, 1, 2)

    def test_each_answer_comes_after_the_next_question(self):
        assert paired([0, 10, 20], [(11, 0), (21, 1), (31, 2)]) == (0, 1, 2)

    def test_an_answer_never_belongs_to_a_later_question(self):
        assert paired([0, 10], [(1, 1)]) == (0,)


class TestTwice:
    def test_a_second_answer_in_time_is_seen(self):
        assert paired([0, 10], [(1, 0), (2, 0), (11, 1), (12, 1)]) == (0, 0, 1, 1)

    def test_the_second_comes_after_the_next_question(self):
        assert paired([0, 10], [(1, 0), (11, 0), (12, 1), (13, 1)]) == (0, 0, 1, 1)

    def test_a_right_and_a_wrong_one(self):
        assert paired([0, 10], [(1, 0), (2, None), (11, 1)]) == (0, 0, 1)


@given(st.data(), st.booleans())
def test_right_answers_in_order_are_always_found(data, doubled):
    """Some missing or some doubled, and late: every answer goes to where it is right."""
    count = data.draw(st.integers(1, 12))
    asked = [100 * index for index in range(count)]
    times, truth = [], []
    clock = 0
    for index in range(count):
        for _ in range(data.draw(st.integers(1, 3) if doubled else st.integers(0, 1))):
            clock = max(clock, asked[index]) + data.draw(st.integers(1, 150))
            times.append(clock)
            truth.append(index)
    found = pair(asked, times, right_for(truth, count).reshape(count, len(times)), [False] * count)
    assert found == tuple(truth)


def test_a_wrong_answer_that_would_be_right_for_the_question_before():
    assert paired([0, 10, 20], [(1, 0), (11, 0), (21, 2)]) == (0, 1, 2)


@given(st.lists(st.integers(0, 3), min_size=1, max_size=8), st.integers(1, 8))
def test_pairs_are_causal_and_in_order(delays, count):
    asked = [10 * index for index in range(count)]
    times = sorted(5 + 10 * delay for delay in delays)
    found = pair(asked, times, np.zeros((count, len(times)), dtype=bool), [False] * count)
    assert list(found) == sorted(found)
    assert all(asked[question] <= time for question, time in zip(found, times, strict=True))


@pytest.mark.parametrize("count", [2000])
def test_a_flood_of_answers_is_paired_in_order(count):
    asked = [100 * index for index in range(50)]
    times = [3 * index + 1 for index in range(count)]
    right = np.zeros((50, count), dtype=bool)
    found = pair(asked, times, right, [False] * 50)
    assert found[-1] == 49
    assert list(found) == sorted(found)


def test_the_answer_before_sent_again_for_an_optional_question_is_no_second_copy():
    assert paired([0, 10, 20], [(1, 0), (11, 0), (21, 2)], optional={1}) == (0, 1, 2)
    assert paired([0, 10, 20], [(11, 0), (21, 2)], optional={1}) == (0, 2)


def test_a_node_that_says_everything_twice_may_be_late_with_a_copy():
    answers = [(1, 0), (11, 0), (21, 2), (22, 2), (31, 3), (32, 3)]
    assert paired([0, 10, 20, 30], answers, optional={1}) == (0, 0, 2, 2, 3, 3)
    answers = [(1, 0), (2, 0), (11, 1), (12, 1), (21, 2), (22, 2), (31, 3), (41, 3)]
    assert paired([0, 10, 20, 30, 40], answers) == (0, 0, 1, 1, 2, 2, 3, 3)
