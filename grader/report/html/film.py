"""A film of what the robot's camera saw, small enough for a report.

It is made when the report is: of the true path, in the colours and the light of the run but without
noise, in one PNG with the pictures below each other, where they share most of their bytes.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Mapping
from typing import Any

import numpy as np

from grader.measure.pictures import camera_of, picture_at
from grader.recording.model import NS, Recording
from grader.recording.one_robot import each_robot
from sim.png import png

_WIDTH = 160
_MOST = 60
"""Pictures of one run."""


def make_film(recording: Recording) -> Mapping[str, Any] | None:
    """The film of a run, ready for JSON, or None without a camera.

    Of several robots it is that of the first, which the replay follows.
    """
    recording = next(each_robot(recording))
    scene, truth = recording.scene, recording.truth
    camera = camera_of(scene, noise=0.0) if scene is not None and truth else None
    if scene is None or camera is None:
        return None
    taken = camera.options
    width = min(_WIDTH, taken.width)
    height = max(1, round(width * taken.height / taken.width))
    camera = camera_of(scene, noise=0.0, width=width, height=height)
    assert camera is not None
    # No more than were taken.
    every = max(math.ceil(len(truth) / _MOST), round(100.0 / taken.rate))
    steps = truth[::every]
    pictures = np.concatenate([picture_at(camera, scene, step) for step in steps])
    return {
        "every": every * (truth[-1].time_ns - truth[0].time_ns) / NS / max(1, len(truth) - 1),
        "count": len(steps),
        "width": width,
        "height": height,
        "png": b64encode(png(pictures, level=9)).decode(),
    }
