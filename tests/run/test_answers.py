"""Questions and answers, of nodes that answer twice, late or not at all. No ROS runs."""

from __future__ import annotations

from collections import deque

import pytest

from grader.run.stimuli.answers import Answers

WITHIN_S = 1.0
STEP_S = 0.001


class Node:
    """A node with a queue of 10, that takes its time for each question."""

    def __init__(self, takes_s: float, copies: int, silent: frozenset[int] = frozenset()) -> None:
        self.takes_s, self.copies, self.silent = takes_s, copies, silent
        self.queue: deque[int] = deque(maxlen=10)
        self.free_s = 0.0
        self.lost = 0
        self.answered: list[int] = []
        self._coming: list[tuple[float, bytes]] = []

    def take(self, question: int) -> None:
        self.lost += len(self.queue) == self.queue.maxlen
        self.queue.append(question)

    def step(self, now_s: float) -> list[bytes]:
        """What it says at this time."""
        if self.queue and now_s >= self.free_s:
            question = self.queue.popleft()
            self.free_s = now_s + self.takes_s
            if question not in self.silent:
                self.answered.append(question)
                # The copies come one after another, the first of them when the work is done.
                self._coming += [
                    (self.free_s + 0.002 * number, b"%d" % question)
                    for number in range(self.copies)
                ]
        said = [answer for due_s, answer in self._coming if due_s <= now_s]
        self._coming = [one for one in self._coming if one[0] > now_s]
        return said


def play(node: Node, questions: int) -> float:
    """Ask all questions; returns when the last answer was waited for."""
    answers = Answers(WITHIN_S)
    sent, now_s, asked_s = 0, 0.0, 0.0
    while True:
        for answer in node.step(now_s):
            answers.hear(answer, now_s - asked_s)
        if sent == questions and answers.is_over(now_s - asked_s):
            return now_s
        if sent < questions and answers.may_go_on(now_s - asked_s):
            answers.ask()
            node.take(sent)
            sent, asked_s = sent + 1, now_s
        now_s += STEP_S


@pytest.mark.parametrize("takes_s", [0.001, 0.03, 0.2])
@pytest.mark.parametrize("copies", [1, 2, 3])
def test_no_question_is_lost_and_the_last_answer_is_heard(takes_s: float, copies: int) -> None:
    node = Node(takes_s, copies)
    end_s = play(node, 60)
    assert node.lost == 0
    assert node.answered == list(range(60))
    assert not node.queue
    # Each question waits for its own answer and for nothing else, but for the copies of the last.
    assert end_s <= 60 * (takes_s + 0.01) + 0.1


def test_who_never_answers_gets_every_question_when_its_time_has_passed() -> None:
    node = Node(0.01, 1, frozenset(range(5)))
    assert play(node, 5) == pytest.approx(5 * WITHIN_S, abs=0.02)
    assert node.lost == 0


def test_a_question_without_an_answer_does_not_cut_off_the_last_one() -> None:
    node = Node(0.3, 2, frozenset({3}))
    play(node, 6)
    assert node.answered == [0, 1, 2, 4, 5]


def test_a_late_answer_is_not_taken_for_the_last_one() -> None:
    # The first takes longer than is waited for, so each answer comes when the next is expected.
    node = Node(0.3, 1)
    node.free_s = 1.0
    play(node, 5)
    assert node.answered == list(range(5))
    assert node.lost == 0


def test_the_same_answer_to_different_questions_counts_a_moment_later() -> None:
    answers = Answers(WITHIN_S)
    for _ in range(3):
        assert answers.may_go_on(0.0) or answers.may_go_on(0.06)
        answers.ask()
        assert not answers.may_go_on(0.001)
        answers.hear(b"same", 0.002)
    assert not answers.may_go_on(0.01)
    assert answers.may_go_on(0.06)
    assert answers.is_over(0.06)
