"""Which failures of a class are the same mistake."""

import pytest

from grader.findings.finding import Finding
from grader.report.model.class_row import ClassRow
from grader.report.model.cluster import cause, clusters
from grader.review.model import ClassReview, Forgiven
from tests.grade.sample import Told
from tests.report.sample import judged


def result(observed, expected="a message on `/cmd_vel`", points=2.0):
    """A failure as a real mutant of a lesson has it."""
    failed = Finding.failed(expected, observed)
    return judged([Told("check", failed, points=points), Told("other")]).result


def why(observed):
    return cause(result(observed).checks[0])


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (
            "`/talker` answered 6 of 9 calls within 1 s while 11 messages were published: "
            "something blocks the executor",
            "`/node` answered 0 of 5 calls within 1 s while 1 message was published: something "
            "blocks the executor",
        ),
        (
            "1 interval of 10 differs from the median by more than 60 ms: messages are left out",
            "3 intervals of 9 differ from the median by more than 0.1 s: messages are left out",
        ),
        (
            "the process `bot/bot_pub` ended 2.57 s after launch with IndexError: pop from empty "
            "list (bot/bot/node.py:26)",
            "the process `bot/bot_pub` ended 340 ms after launch with IndexError: pop from empty "
            "list (bot/bot/my_file.py:7)",
        ),
        (
            "`colcon build` failed: bot/setup.py:8: NameError: name 'packagename' is not defined",
            "`colcon build` failed: src/bot/setup.py:12: NameError: name 'pkg' is not defined",
        ),
        ("one on `/cmdvel` instead", "one on `/robot/cmd_velocity` instead"),
        (
            "stopped early, with a wall still 45 cm ahead",
            "stopped early, with a wall still 1 m ahead",
        ),
    ],
)
def test_the_same_mistake_with_other_names_and_numbers_has_the_same_cause(one, other):
    assert why(one) == why(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("linear.x = 0.5 instead of 1.0", "angular.z = 0.5 instead of 1.0"),
        (
            "the publisher has the type `geometry_msgs/msg/Vector3`",
            "the publisher has the type `geometry_msgs/msg/TwistStamped`",
        ),
        ("no message on `/cmd_vel`", "no message on `/scan`"),
        ("`time.sleep` is called in a callback", "`input` is called in a callback"),
        ("ended with KeyError: 'x' (a.py:3)", "ended with IndexError: 'x' (a.py:3)"),
        ("setup.py: can't copy 'resource/bot'", "package.xml: can't copy 'resource/bot'"),
    ],
)
def test_different_mistakes_have_different_causes(one, other):
    assert why(one) != why(other)


def test_a_cause_reads_as_a_sentence():
    assert why("the median is 322.4 ms over 10 intervals (node.py:3)") == (
        "the median is … over … intervals (…)"
    )
    assert (
        why("`time.sleep` at bot/node.py:3, seen by `/talker`") == "`time.sleep` at …, seen by `…`"
    )


def test_a_cluster_names_students_points_and_what_forgiving_gives():
    rows = [
        ClassRow("ana", result=result("one on `/a` instead")),
        ClassRow("ben", result=result("one on `/b` instead")),
        ClassRow("cai", result=result("no publisher at all")),
        ClassRow("dee", missing=True),
    ]
    forgiven = Forgiven(check="check", cause="one on `…` instead", share=0.5, by="AB")
    first, second = clusters(rows, ClassReview(forgiven=(forgiven,)).shares)
    assert (tuple(first.lost), first.cause, first.title) == (
        ("ana", "ben"),
        "one on `…` instead",
        "Title of check",
    )
    assert (first.at_stake, first.forgiven) == (4.0, 0.5)
    assert first.gains(0.5) == {"ana": 1.0, "ben": 1.0}
    assert (tuple(second.lost), second.forgiven) == (("cai",), 0.0)
