"""The layout shows what a recording holds, and nothing that it does not hold."""

from __future__ import annotations

import json

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from grader.report.formats.foxglove import render_layout
from tests.recording.written import write_robot_run


def leaves(layout):
    if isinstance(layout, str):
        return [layout]
    assert layout["direction"] in ("row", "column")
    assert 0 < layout["splitPercentage"] < 100
    return leaves(layout["first"]) + leaves(layout["second"])


@pytest.fixture
def run(tmp_path):
    return write_robot_run(tmp_path / "run.mcap")


def test_every_path_leads_to_a_number_in_the_file(run, tmp_path):
    layout = json.loads(render_layout([run]))
    with (tmp_path / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        first = {}
        for schema, channel, message in reader.iter_messages():
            value = DecoderFactory().decoder_for("cdr", schema)(message.data)
            first.setdefault(channel.topic, value)
    paths = [
        path["value"]
        for panel in layout["configById"].values()
        for path in [*panel.get("paths", ()), *filter(None, [panel.get("xAxisPath")])]
    ]
    assert "/cmd_vel.linear.x" in paths
    for path in paths:
        topic, *fields = path.split(".")
        value = first[topic]
        for field in fields:
            value = getattr(value, field)
        assert isinstance(value, float)


def test_every_panel_has_its_place(run):
    layout = json.loads(render_layout([run]))
    placed = leaves(layout["layout"])
    assert sorted(placed) == sorted(layout["configById"])
    assert len(placed) == len(set(placed))
    assert {name.partition("!")[0] for name in placed} <= {"Plot", "RawMessages", "3D"}


def test_without_a_recording_there_is_still_a_layout():
    assert leaves(json.loads(render_layout([]))["layout"]) == ["RawMessages!launched"]
