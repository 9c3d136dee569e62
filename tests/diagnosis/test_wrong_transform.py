"""Why a transform is not there, or of no use: each explanation answers for its mistake."""

from __future__ import annotations

from typing import Any

import pytest

from grader.diagnosis.wrong_transform import NoTransform, overwritten
from grader.recording.model import Recording
from tests.checks.builder import RELIABLE, declared, endpoint, judge
from tests.checks.test_tf import (
    CRASH,
    ODOM,
    PLACED,
    TF,
    TF_STATIC,
    TIMES,
    broadcasting,
    on,
    run,
    static_run,
    transform,
)
from tests.diagnosis.test_every_explanation import answers

LASER = ("base_link", "laser")
BROADCAST = {**ODOM, "rate": "20 Hz"}


@pytest.mark.parametrize(
    ("name", "subject"),
    [
        ("process_ended", run(**CRASH)),
        ("refused_by_tf2", run(qos=RELIABLE)),
        ("other_topic", run(moving=on(TF, (0.7, [transform(*LASER)])))),
        ("exchanged_frames", static_run(transform("laser", "base_link"))),
        ("other_frame", static_run(transform("/base_link", "laser"))),
        ("no_transform_at_all", run(endpoints=(endpoint(),))),
        ("other_frame", static_run(transform("base_link", "lasr"))),
        ("other_transforms_only", static_run(transform("map", "odom"))),
        ("no_quaternion", static_run(transform(*LASER, turn=(0.0, 0.0, 0.0, 0.0)))),
    ],
)
def test_a_static_transform_is_explained(name: str, subject: Recording) -> None:
    with answers() as found:
        judge("tf.static", subject, **PLACED)
    assert name in {entry.partition(".")[2] for entry in found}


def test_a_transform_that_later_ones_replaced_is_explained() -> None:
    # Asked directly by tf.static, for the transform is there.
    queue = {"topic": TF_STATIC, "history": "keep_last", "depth": 1}
    sent = on(TF_STATIC, (0.7, [transform(*LASER)]), (0.8, [transform("base_link", "camera")]))
    subject = run(static=sent, declarations=(declared("publisher", **queue),))
    assert overwritten(NoTransform(subject, TF_STATIC, *LASER)) is not None


def test_a_wrong_stamp_is_explained() -> None:
    parameters: dict[str, Any] = BROADCAST
    with answers() as found:
        judge("tf.broadcast", broadcasting(stamp=lambda _: TIMES[0]), **parameters)
    assert "BadTransform.wrong_stamp" in found
