"""What the camera saw is made again from the recording, bit by bit, and small in the report."""

from base64 import b64decode
from dataclasses import replace

import pytest

from grader.measure.pictures import camera_of, picture_at
from grader.recording.mcap_reader import read_recording
from grader.recording.mcap_writer import write_recording
from grader.recording.model import NS
from grader.report.html.film import make_film
from sim.camera import Camera
from sim.description import SimulatorOptions
from sim.motion import Pose
from sim.world import parse_world
from tests.checks.builder import drive, on_timer
from tests.report.gallery import ahead_until

WORLD = "boxes: [{centre: [2, 0], size: [0.3, 0.3], colour: red}]\nlight: 70 %"
CAMERA = {"camera": {"width": 80, "height": 60, "noise": "2 %"}}


@pytest.fixture(scope="module")
def run():
    law = on_timer(0.1, lambda pose: (0.2, 0.3))
    return drive(law, world=WORLD, options=CAMERA, seconds=5.0)


def test_pictures_are_made_again_bit_by_bit(run):
    camera = camera_of(run.scene)
    options = SimulatorOptions.model_validate(CAMERA).camera
    taken = Camera(parse_world(WORLD), options, (1, 0))
    for step in run.truth[::97]:
        pose = Pose(step.x_m, step.y_m, step.yaw_rad)
        picture = taken.picture(pose, step.time_ns - run.scene.began_ns)
        assert picture_at(camera, run.scene, step).tobytes() == picture.tobytes()


def test_a_film_has_pictures_at_equal_times_and_is_small(run):
    film = make_film(run)
    assert (film["width"], film["height"]) == (80, 60)
    assert film["count"] == 50
    assert film["every"] == pytest.approx(0.1)
    assert b64decode(film["png"]).startswith(b"\x89PNG")
    assert len(film["png"]) < 20_000


def test_a_long_run_has_no_more_pictures_than_a_short_one(run):
    longer = replace(run, truth=run.truth * 4)
    assert make_film(longer)["count"] <= 60


def test_a_run_without_a_camera_has_none():
    assert make_film(ahead_until(0.2)) is None


def test_what_pictures_are_made_of_is_in_the_recording(run, tmp_path):
    file = tmp_path / "run.mcap"
    write_recording(file, run, (), {})
    again = read_recording(file)
    assert again.scene == run.scene
    [first, *_] = run.truth
    one, other = camera_of(again.scene), camera_of(run.scene)
    assert picture_at(one, again.scene, first).tobytes() == (
        picture_at(other, run.scene, first).tobytes()
    )
    assert first.time_ns - run.scene.began_ns == NS // 100
