"""One of several robots: what is judged is its own, and the others are obstacles on its way."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.measure.motion.ground import ahead
from grader.recording.model import Recording
from grader.recording.one_robot import each_robot, of_robot
from grader.recording.simulated import Incident
from sim.shapes import obstacle_words
from tests.checks.builder import drive, failing, judge, on_timer


@pytest.fixture
def pair() -> Recording:
    """The robot tb1 drives along the x axis, 2 m behind tb2, which stands."""
    alone = drive(on_timer(0.1, lambda _: (0.2, 0.0)), world="{}", seconds=2.0, rest_s=None)
    stands = drive(
        on_timer(0.1, lambda _: (0.0, 0.0)), world="start: [2, 0, 0]", seconds=2.0, rest_s=None
    )
    scenes, truth, incidents = {}, [], []
    for name, run in (("tb1", alone), ("tb2", stands)):
        scenes[name] = run.scene
        truth += [replace(step, robot=name) for step in run.truth]
        incidents.append(Incident(run.truth[0].time_ns, "pushed", "a little", robot=name))
    truth.sort(key=lambda step: step.time_ns)
    return replace(alone, scenes=scenes, truth=tuple(truth), incidents=tuple(incidents))


def test_the_truth_and_the_incidents_of_one_robot_are_its_own(pair: Recording) -> None:
    one, other = of_robot(pair, "tb1"), of_robot(pair, "tb2")
    assert {step.robot for step in one.truth} == {"tb1"}
    assert [item.robot for item in other.incidents] == ["tb2"]
    assert (one.robot, other.robot) == ("tb1", "tb2")
    assert len(one.truth) + len(other.truth) == len(pair.truth)


def test_the_other_robot_is_an_obstacle_where_it_was(pair: Recording) -> None:
    one, other = of_robot(pair, "tb1"), of_robot(pair, "tb2")
    sight = ahead(one.scene, one.truth[-1])
    assert sight is not None and sight.name == "the robot tb2"
    assert sight.distance_m == pytest.approx(2.0 - 0.1 - one.truth[-1].x_m)
    assert other.scene is not None
    seen = other.scene.moving[0].pose_at(one.truth[77].time_ns - other.scene.began_ns)
    assert seen is not None and seen.x_m == pytest.approx(one.truth[77].x_m, abs=1e-3)


def test_a_check_of_motion_judges_the_one_it_is_asked_about(pair: Recording) -> None:
    one, other = of_robot(pair, "tb1"), of_robot(pair, "tb2")
    assert judge("motion.keeps_driving", one, distance="0.2 m").credit == 1.0
    assert "never moved" in failing("motion.keeps_driving", other, distance="0.2 m")


def test_a_recording_of_one_robot_is_not_changed(pair: Recording) -> None:
    alone = of_robot(pair, "tb1")
    assert [*each_robot(alone)] == [alone]
    assert [run.robot for run in each_robot(pair)] == ["tb1", "tb2"]
    assert pair.scene is None


def test_a_robot_is_named_in_words() -> None:
    assert obstacle_words("robots[tb2]") == "the robot tb2"
    assert obstacle_words("boxes[0]") == "a box"
