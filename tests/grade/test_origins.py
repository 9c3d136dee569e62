"""Where the student's program creates what a finding is about."""

from __future__ import annotations

from typing import Any

import pytest

from grader.checks.executor.timer import Timer
from grader.checks.messages.messages import Count
from grader.checks.motion.drive import KeepsDriving
from grader.checks.qos.qos import Depth
from grader.checks.timing.timing import Period
from grader.checks.topic.topic import Topic
from grader.findings.finding import Evidence, Finding
from grader.grade.origins import with_origins
from grader.recording.model import Recording
from grader.recording.submission import PackageRecord, SourceError
from grader.submission.read.cpp import source_file
from grader.submission.read.cpp_contents import outline
from tests.checks.builder import declared
from tests.grade.sample import make_recording, make_submission
from tests.report.gallery import ahead_until

NODE = "bot_publisher/node.py"
INSTALLED = f"/ws/install/lib/python3.12/site-packages/{NODE}"
FAILED = Finding.failed("right", "wrong")


def run(**changes: Any) -> Recording:
    """A run whose node creates a node, two publishers, a subscription and a timer."""
    at = {"node": "/bot", "file": INSTALLED}
    things = (
        declared("node", line=5, **at),
        declared("publisher", topic="/cmd_vel", line=11, **at),
        declared("publisher", topic="/status", line=12, **at),
        declared("subscription", topic="/cmd_vel", line=13, **at),
        declared("published", topic="/cmd_vel", number=1, line=21, **at),
        declared("published", topic="/cmd_vel", number=2, line=21, **at),
        declared("timer", period_s=0.3, callback="Bot.tick", line=14, **at),
    )
    package = PackageRecord(
        "bot_publisher", "src/bot_publisher", files=((NODE, f"src/bot_publisher/{NODE}"),)
    )
    submission = make_submission(packages=(package,))
    return make_recording(submission=submission, **({"declarations": things} | changes))


def lines(finding: Finding, parameters: Any, recording: Recording) -> list[int | None]:
    found = with_origins(finding, parameters, recording).evidence.origins
    assert all(place.file == f"src/bot_publisher/{NODE}" for place in found)
    return [place.line for place in found]


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        (Depth(topic="/cmd_vel", kind="publisher", depth=10), [11]),
        (Depth(topic="/cmd_vel", kind="subscription", depth=10), [13]),
        (Period(topic="/cmd_vel", period="300 ms"), [14, 11]),
        (Timer(topic="/cmd_vel"), [14, 11]),
        (Topic(topic="/cmd_vel"), [11, 13]),
        (Topic(topic="/other"), []),
        (Count(topic="/cmd_vel", at_least=1), [21, 13]),
        (KeepsDriving(distance="1 m"), []),
    ],
)
def test_what_a_check_is_about_is_shown_where_it_is_created(parameters, expected):
    assert lines(FAILED, parameters, run()) == expected


def test_where_nothing_was_published_the_timer_and_the_publisher_are_shown():
    silent = run(declarations=tuple(one for one in run().declarations if one.kind != "published"))
    assert lines(FAILED, Count(topic="/cmd_vel", at_least=1), silent) == [14, 13, 11]


def test_a_check_of_the_robot_shows_where_it_is_commanded():
    assert lines(FAILED, KeepsDriving(distance="1 m"), run(scenes=ahead_until(0.2).scenes)) == [21]


def test_a_wrong_name_that_was_observed_is_shown_too():
    seen = Finding.failed("a publisher on `/state`", "publishes on `/status` instead")
    parameters = Topic(topic="/state")
    assert lines(seen, parameters, run()) == [12]


def test_a_place_of_the_finding_itself_stands_alone():
    place = SourceError("src/bot_publisher/setup.py", 3, "here")
    own = Finding.failed("right", "wrong", "", Evidence(places=(place,)))
    assert with_origins(own, Topic(topic="/cmd_vel"), run()) is own


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"file": 7, "line": 1},
        {"file": INSTALLED, "line": "1"},
        {"file": "/etc/passwd", "line": 1},
    ],
)
def test_what_a_process_declares_of_itself_is_read_as_hostile(data):
    told = (declared("publisher", topic="/cmd_vel", node="/bot", **data),)
    recording = run(declarations=told)
    assert lines(FAILED, Topic(topic="/cmd_vel"), recording) == []


def test_they_do_not_make_two_mistakes_one():
    parameters = Topic(topic="/cmd_vel")
    found = with_origins(FAILED, parameters, run())
    assert found.evidence.origins
    # The same places are the same mistake.
    assert found.evidence.places == ()


CPP_CODE = """\
Bot::Bot() : Node("bot") {
  publisher_ = this->create_publisher<Twist>("cmd_vel", 10);
  status_ = create_publisher<String>(topic_, 10);
  subscription_ = create_subscription<Odometry>("/odom", 10, [](auto) {});
  // create_wall_timer(1s, other);
  timer_ = rclcpp::create_timer(this, get_clock(), 500ms, [this] { tick(); });
}
"""


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        (Depth(topic="/cmd_vel", kind="publisher", depth=10), [2]),
        (Depth(topic="/status", kind="publisher", depth=10), [3]),
        (Depth(topic="/odom", kind="subscription", depth=10), [4]),
        (Timer(topic="/cmd_vel"), [6, 2]),
    ],
)
def test_what_cpp_creates_is_found_in_its_source(parameters: Any, expected: list[int]) -> None:
    path = "src/bot_publisher/src/bot.cpp"
    code = source_file(path, outline(CPP_CODE.encode()))
    package = PackageRecord("bot_publisher", "src/bot_publisher", sources=(code,))
    things = (
        declared("publisher", node="/bot", topic="/cmd_vel"),
        declared("publisher", node="/bot", topic="/status"),
        declared("subscription", node="/bot", topic="/odom"),
        declared("timer", period_s=0.5),
    )
    submission = make_submission(packages=(package,))
    recording = make_recording(submission=submission, declarations=things)
    found = with_origins(FAILED, parameters, recording).evidence.origins
    assert [(one.file, one.line) for one in found] == [(path, line) for line in expected]


def test_of_two_calls_in_cpp_that_may_be_meant_none_is_shown() -> None:
    code = source_file(
        "a.cpp", outline(b"void f() { create_wall_timer(a); create_wall_timer(b); }")
    )
    package = PackageRecord("bot_publisher", "src/bot_publisher", sources=(code,))
    recording = make_recording(
        submission=make_submission(packages=(package,)),
        declarations=(declared("timer", period_s=0.5),),
    )
    assert with_origins(FAILED, Timer(topic="/cmd_vel"), recording).evidence.origins == ()
