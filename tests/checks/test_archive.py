"""archive.clean, archive.file, archive.bag and package.manifest."""

import pytest

from grader.findings.finding import Status
from grader.recording.submission import BagRecord, BagTopic
from tests.checks.builder import failing, judge, package, submission

TWIST = "geometry_msgs/msg/Twist"
BAG = BagRecord("bags/run1", None, 12.5, (BagTopic("/cmd_vel", TWIST, 40),))
WITH_BAG = submission(bags=(BAG,))


def test_sources_alone_are_clean():
    assert judge("archive.clean", submission()).status is Status.PASSED


def test_each_leftover_is_named_with_what_keeps_it_out():
    found = failing("archive.clean", submission(leftovers=("ws/build", "ws/src/a/__pycache__")))
    assert "it holds `ws/build` and `ws/src/a/__pycache__`" in found
    assert "`__pycache__` and `build` into `.gitignore`" in found


README = ("src/bot/README.md", ("Bot", "How to use it", "Design decisions"))


@pytest.mark.parametrize("path", ["README.md", "readme*", "src/bot/README.md", "*/README.??"])
def test_a_file_is_found_by_its_name_or_its_path(path):
    subject = submission(files=("src/bot/README.md",), headings=(README,))
    assert judge("archive.file", subject, path=path).status is Status.PASSED


def test_a_missing_file_fails():
    assert "there is no such file" in failing("archive.file", submission(), path="README*")


def test_headings_may_say_more_than_the_expected_words():
    subject = submission(files=("src/bot/README.md",), headings=(README,))
    finding = judge("archive.file", subject, path="README.md", headings=["use", "design"])
    assert finding.status is Status.PASSED


def test_a_missing_heading_is_told_beside_those_that_are_there():
    subject = submission(files=("src/bot/README.md",), headings=(README,))
    found = failing("archive.file", subject, path="README.md", headings=["use", "Tests"])
    assert '`src/bot/README.md` lacks "Tests"; its headings: "Bot", "How to use it"' in found


def test_one_text_must_have_all_headings():
    other = ("README.md", ("Tests",))
    subject = submission(files=("README.md", "src/bot/README.md"), headings=(other, README))
    failing("archive.file", subject, path="README.md", headings=["Tests", "Design"])


def test_a_bag_with_the_topics_passes():
    finding = judge(
        "archive.bag", submission(bags=(BAG,)), topics={"/cmd_vel": TWIST}, lasts="10 s"
    )
    assert finding.status is Status.PASSED
    assert "`bags/run1` has 40 messages in 12.5 s" in finding.observed


def test_one_good_bag_among_broken_ones_is_enough():
    broken = BagRecord("bags/run0", "it cannot be read: not a database")
    assert judge("archive.bag", submission(bags=(broken, BAG))).status is Status.PASSED
    assert "not a database" in failing("archive.bag", submission(bags=(broken,)))


@pytest.mark.parametrize(
    ("bag", "parameters", "words"),
    [
        (
            BAG,
            {"topics": {"/odom": "nav_msgs/msg/Odometry"}},
            "no message on `/odom`; it has `/cmd",
        ),
        (BAG, {"topics": {"/cmd_vel": "std_msgs/msg/String"}}, f"has as `{TWIST}` on `/cmd_vel`"),
        (BAG, {"lasts": "20 s"}, "lasts 12.5 s"),
        (BagRecord("b", None, 0.0, (BagTopic("/cmd_vel", TWIST, 0),)), {}, "has no message"),
    ],
)
def test_a_bag_that_lacks_something_fails(bag, parameters, words):
    assert words in failing("archive.bag", submission(bags=(bag,)), **parameters)


def test_no_bag_at_all_fails():
    assert "there is no bag" in failing("archive.bag", submission(bags=()))


def test_bags_that_were_not_read_are_no_fault_of_the_student():
    finding = judge("archive.bag", submission())
    assert finding.status is Status.ERROR
    assert "grade again" in finding.observed


FILLED = {
    "description": "Publishes a Twist",
    "maintainers": ("Ada <ada@example.org>",),
    "licenses": ("Apache-2.0",),
}


def test_a_filled_manifest_passes():
    subject = submission(package(**FILLED))
    assert judge("package.manifest", subject, package="bot_publisher").status is Status.PASSED


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"licenses": ("TODO: License declaration",)}, "<license> is `TODO: License declaration`"),
        ({"description": "TODO: Package description"}, "<description> is `TODO"),
        ({"description": ""}, "<description> is empty"),
        ({"maintainers": ("root <root@todo.todo>",)}, "<maintainer> is `root <root@todo.todo>`"),
    ],
)
def test_a_placeholder_of_ros2_pkg_create_fails(changes, words):
    subject = submission(package(**{**FILLED, **changes}))
    assert words in failing("package.manifest", subject, package="bot_publisher")


def test_another_licence_than_the_expected_one_fails():
    subject = submission(package(**FILLED))
    found = failing("package.manifest", subject, package="bot_publisher", license="MIT")
    assert "the licence is `Apache-2.0`, not `MIT`" in found
