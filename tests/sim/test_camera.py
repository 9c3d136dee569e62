"""Pictures of known scenes, against the pinhole model written another way."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from grader.errors import AssignmentError
from grader.spec.source import parse_source
from sim.camera import Camera, Picture
from sim.description import BASE_Z_M, SimulatorOptions
from sim.motion import ORIGIN, Pose
from sim.png import png
from sim.shapes import FloorLine
from sim.world import World, parse_world

# In the middle of the robot, so that what is ahead is in the middle of the picture.
MIDDLE = {"position": [0.0, 0.0, 0.1]}
FLOOR = (205, 205, 205)
NUMBER = st.floats(-2.0, 2.0).map(lambda x: round(x, 3))
POSE = st.builds(Pose, NUMBER, NUMBER, st.floats(-math.pi, math.pi))


def camera(world: str | World = "{}", seed: int = 0, **options: object) -> Camera:
    read = SimulatorOptions.model_validate({"camera": {**MIDDLE, **options}}).camera
    assert read is not None
    return Camera(parse_world(world) if isinstance(world, str) else world, read, (seed, 0))


def is_red(picture: Picture) -> np.ndarray:
    return (picture[..., 0] > 100) & (picture[..., 1:].max(axis=2) < 50)


def test_a_red_box_ahead_is_red_in_the_middle_of_the_picture() -> None:
    picture = camera("boxes: [{centre: [1, 0], size: [0.2, 0.2], colour: red}]").picture(ORIGIN, 0)
    assert picture.shape == (240, 320, 3)
    assert picture.dtype == np.uint8
    red = is_red(picture)
    assert red[120, 160]
    columns = np.flatnonzero(red.any(axis=0))
    assert columns[0] + columns[-1] == 319
    # Its near side is 0.2 m wide at 0.9 m.
    focal = 160 / math.tan(1.02974 / 2)
    assert len(columns) == pytest.approx(0.2 / 0.9 * focal, abs=1.0)


def test_what_is_to_the_left_is_in_the_left_half_and_what_is_high_is_up() -> None:
    scene = """
boxes: [{centre: [1, 0.3], size: [0.1, 0.1], colour: red, height: 5 cm}]
circles: [{centre: [1, -0.3], radius: 0.05, colour: blue}]
"""
    picture = camera(scene).picture(ORIGIN, 0)
    rows, columns = np.nonzero(is_red(picture))
    assert columns.max() < 160
    # It is lower than the camera.
    assert rows.min() > 119.5
    rows, columns = np.nonzero((picture[..., 2] > 200) & (picture[..., 0] < 50))
    assert columns.min() > 160
    assert rows.min() < 119.5 < rows.max()
    assert (picture[0] == (176, 208, 232)).all()
    assert (picture[-1] == FLOOR).all()


def test_the_nearer_of_two_things_hides_the_other() -> None:
    far, near = "{centre: [2, 0], size: [1, 1], colour: blue}", "{centre: [1, 0], radius: 0.05}"
    picture = camera(f"boxes: [{far}]\ncircles: [{near}]").picture(ORIGIN, 0)
    assert (picture[110, 160, 0] == picture[110, 160]).all()
    assert picture[110, 120, 2] > picture[110, 120, 0]


def test_a_line_on_the_floor_is_where_the_pinhole_has_it() -> None:
    """Written as similar triangles: a point d ahead is (height / d) below the horizon."""
    line = "lines: [{points: [[0.5, -1], [0.5, 1]], width: 4 cm, colour: [1, 2, 3]}]"
    picture = camera(line).picture(ORIGIN, 0)
    rows = np.flatnonzero((picture[:, 160] == (1, 2, 3)).all(axis=1))
    focal = 160 / math.tan(1.02974 / 2)
    height_m = 0.1 + BASE_Z_M
    assert rows[0] == pytest.approx(119.5 + focal * height_m / 0.52, abs=1.0)
    assert rows[-1] == pytest.approx(119.5 + focal * height_m / 0.48, abs=1.0)


def test_looking_down_lifts_the_floor() -> None:
    level, down = camera().picture(ORIGIN, 0), camera(pitch="20 deg").picture(ORIGIN, 0)
    assert (down == FLOOR).sum() > (level == FLOOR).sum()
    assert (camera(pitch="60 deg").picture(ORIGIN, 0) == FLOOR).all()


def test_colours_and_light_are_those_of_the_world() -> None:
    assert (camera("floor: [10, 20, 30]").picture(ORIGIN, 0)[-1] == (10, 20, 30)).all()
    dark = camera("floor: [10, 20, 30]\nlight: 50 %").picture(ORIGIN, 0)
    assert (dark[-1] == (5, 10, 15)).all()
    assert camera("light: 200 %").picture(ORIGIN, 0).max() == 255


def test_what_moves_is_seen_where_it_is_then() -> None:
    path = "[{at: 0 s, pose: [1, 0.3]}, {at: 2 s, pose: [1, -0.3]}]"
    eye = camera(f"moving: [{{circle: {{radius: 5 cm, colour: red}}, path: {path}}}]")
    middles = [np.nonzero(is_red(eye.picture(ORIGIN, time_ns)))[1].mean() for time_ns in (0, 10**9)]
    assert middles[0] < 100
    assert middles[1] == pytest.approx(159.5, abs=1.0)


def test_from_inside_of_a_thing_and_close_to_a_wall_a_picture_is_made() -> None:
    for scene in (
        "circles: [{centre: [0, 0], radius: 1}]",
        "boxes: [{centre: [0, 0], size: [1, 1], height: 5 cm}]",
        "segments: [[0.001, -1, 0.001, 1]]",
        "lines: [{points: [[-1, 0], [1, 0], [1, 0]]}]",
    ):
        assert camera(scene).picture(ORIGIN, 0).shape == (240, 320, 3)


SCENE = parse_world(
    """
bounds: [-3, -3, 3, 3]
boxes: [{centre: [1, 0.2], size: [0.3, 0.2], yaw: 20 deg, colour: red, height: 8 cm}]
circles: [{centre: [0.8, -0.4], radius: 0.1, colour: green}]
polygons: [{points: [[-1, -1], [-1.5, -1], [-1.2, -1.4], [-1.2, -1.1]], height: 5 cm}]
lines: [{points: [[-2, 0], [0, 0.5], [2, 0]], colour: black}]
"""
)


@given(POSE, st.integers(0, 2**31), st.integers(0, 3000))
@settings(max_examples=30, deadline=None)
def test_the_same_seed_gives_the_same_picture_bit_for_bit(
    pose: Pose, seed: int, moment: int
) -> None:
    one, other = (camera(SCENE, seed, noise=0.01, width=64, height=48) for _ in range(2))
    other.picture(ORIGIN, 0)  # what was taken before changes nothing
    time_ns = moment * 10_000_000
    picture = one.picture(pose, time_ns)
    assert picture.tobytes() == other.picture(pose, time_ns).tobytes()
    assert (
        picture.tobytes()
        != camera(SCENE, seed + 1, noise=0.01, width=64, height=48).picture(pose, time_ns).tobytes()
    )


@given(POSE, st.floats(-0.3, 1.0), st.floats(0.25, 1.0), st.floats(-0.5, 0.5))
@settings(max_examples=60, deadline=None)
def test_the_matrix_of_camera_info_projects_a_spot_on_the_floor_to_where_the_picture_has_it(
    pose: Pose, pitch: float, ahead_m: float, aside_m: float
) -> None:
    """Against rotations in the complex plane, one after the other."""
    turned = complex(ahead_m, aside_m) * complex(math.cos(pose.yaw_rad), math.sin(pose.yaw_rad))
    x, y = pose.x_m + turned.real, pose.y_m + turned.imag
    spot = FloorLine(((x - 0.05, y), (x + 0.05, y)), 0.1, (255, 0, 0))
    eye = camera(World(lines=(spot,)), pitch=f"{pitch} rad")
    looked = complex(ahead_m, -(0.1 + BASE_Z_M)) * complex(math.cos(pitch), math.sin(pitch))
    assume(looked.real > 0.1)
    u = eye.centre_px[0] - eye.focal_px * aside_m / looked.real
    v = eye.centre_px[1] - eye.focal_px * looked.imag / looked.real
    assume(5 < u < 314 and 5 < v < 234)
    assert is_red(eye.picture(pose, 0))[round(v), round(u)]
    place, turn = eye.eye(pose)
    assert eye.pixel(turn @ (np.array([x, y, 0.0]) - place)) == pytest.approx((u, v), abs=1e-6)


def test_noise_has_the_deviation_that_was_asked_for_and_no_colour() -> None:
    eye = camera("floor: [100, 120, 140]", noise=0.02)
    floor = eye.picture(ORIGIN, 0)[150:].astype(float) - (100, 120, 140)
    assert floor.std() == pytest.approx(0.02 * 255, rel=0.05)
    assert (floor[..., 0] == floor[..., 2]).all()
    later = eye.picture(ORIGIN, 100_000_000)[150:].astype(float) - (100, 120, 140)
    assert abs(np.corrcoef(floor[..., 0].ravel(), later[..., 0].ravel())[0, 1]) < 0.05


def test_a_logical_camera_says_what_is_in_view_and_where() -> None:
    scene = """
boxes:
  - {centre: [1, 0.3], size: [0.2, 0.1], yaw: 30 deg, colour: red, height: 0.2}
  - {centre: [-1, 0], size: [0.2, 0.2]}
circles:
  - {centre: [2, 0], radius: 0.1}
  - {centre: [2.5, 0], radius: 0.1}
  - {centre: [6, 0.5], radius: 0.1}
"""
    eye = camera(scene, objects={})
    seen = eye.objects(Pose(0.0, 0.0, 0.1), 0)
    # The second box is behind, the second pillar hidden by the first, the third too far away.
    assert [(one.kind, one.number) for one in seen] == [("box", 0), ("pillar", 0)]
    box = seen[0]
    cos, sin = math.cos(0.1), math.sin(0.1)
    assert box.place_m == pytest.approx((cos + 0.3 * sin, 0.3 * cos - sin, 0.1 - 0.1 - BASE_Z_M))
    assert box.yaw_rad == pytest.approx(math.radians(30) - 0.1)
    assert box.size_m == pytest.approx((0.2, 0.1, 0.2))
    assert box.colour == (255, 0, 0)
    noisy = camera(scene, objects={"noise": "1 cm"})
    found = noisy.objects(Pose(0.0, 0.0, 0.1), 0)
    assert found[0].place_m != box.place_m
    assert found[0].place_m == pytest.approx(box.place_m, abs=0.06)
    assert found == noisy.objects(Pose(0.0, 0.0, 0.1), 0)
    assert camera(scene).objects(ORIGIN, 0) == []


def test_a_png_holds_the_picture_without_loss() -> None:
    picture = camera(SCENE, noise=0.05).picture(ORIGIN, 0)
    data = png(picture)
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    chunks, at = {}, 8
    while at < len(data):
        (size,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        (check,) = struct.unpack(">I", data[at + 8 + size : at + 12 + size])
        assert check == zlib.crc32(kind + body)
        chunks[kind] = body
        at += 12 + size
    assert struct.unpack(">IIBBBBB", chunks[b"IHDR"]) == (320, 240, 8, 2, 0, 0, 0)
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(240, 961)
    assert (rows[:, 0] == 2).all()
    found = np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8)
    assert found.tobytes() == picture.tobytes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("camera:\n  width: 640", r"o.yaml:2: camera.width: must be at most 320, not 640"),
        ("camera: {rate: 30 Hz}", r"o.yaml:1: camera.rate: must be at most 10"),
        ("camera: {encoding: mono8}", r"camera.encoding: expected 'rgb8' or 'bgr8', not 'mono8'"),
        ("camera: {fov: 180 deg}", r"camera.fov: "),
        ("camera: {pitch: 90 deg}", r"camera.pitch: "),
        ("camera: {noise: 80 %}", r"camera.noise: "),
        ("camera: {topic: image}", r"camera.topic: 'image' is relative"),
    ],
)
def test_a_mistake_in_the_camera_is_reported_with_file_and_line(text: str, message: str) -> None:
    with pytest.raises(AssignmentError, match=message) as error:
        parse_source(text, Path("o.yaml")).read(SimulatorOptions)
    assert len(error.value.problems) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("light: 0 %", r"world.yaml:1: light: must be at least 0.1"),
        ("light: 300 %", r"light: must be at most 2"),
        (
            "floor: white\nlines:\n  - {points: [[0, 0], [1, 0]], colour: rde}",
            r"world.yaml:3: lines\[0\].colour: there is no colour 'rde'. Did you mean 'red'\?",
        ),
        (
            "floor: [1, 2, 256]",
            r"floor: expected a name such as 'red' or \[r, g, b\] from 0 to 255",
        ),
        ("floor: [1, 2]", r"floor: expected a name"),
        ("lines: [{points: [[0, 0]]}]", r"lines\[0\].points: "),
        ("circles: [{centre: [1, 0], radius: 0.1, height: 0}]", r"circles\[0\].height: 0 is too"),
    ],
)
def test_a_mistake_in_what_a_camera_sees_is_reported_with_file_and_line(
    text: str, message: str
) -> None:
    with pytest.raises(AssignmentError, match=message):
        parse_world(text)


def test_a_world_is_the_same_when_it_is_read_from_its_own_text() -> None:
    world = parse_world(
        "values: {x: 1, dark: 50 %}\nlight: $dark\nboxes: [{centre: [$x, 0], size: [1, 20 cm]}]",
        values={"x": 2},
    )
    again = parse_world(world.text)
    assert (again.light, again.text) == (0.5, world.text)
    assert [shape.capsules for shape in again.shapes] == [shape.capsules for shape in world.shapes]
