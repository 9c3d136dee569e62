"""Two definitions under one name, as the type hashes of the endpoints tell."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.recording.model import Kind
from tests.checks.builder import endpoint, reader, recording

OURS, OTHER = "RIHS01_aa", "RIHS01_bb"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"type_hash": OURS}, False),
        ({"type_hash": OTHER}, True),
        ({"type_hash": ""}, False),
        ({"type_hash": OTHER, "type": "std_msgs/msg/String"}, False),
        ({"type_hash": OTHER, "kind": Kind.SUBSCRIPTION}, False),
        ({"type_hash": OTHER, "topic": "/elsewhere"}, False),
    ],
)
def test_a_publisher_with_the_same_name_of_type_and_another_hash(changes, expected) -> None:
    ends = (replace(endpoint(), **changes), replace(reader(), type_hash=OURS))
    assert recording(endpoints=ends).misdefined("/cmd_vel") is expected


def test_without_a_subscription_of_the_probe_nothing_is_compared() -> None:
    assert not recording(endpoints=(replace(endpoint(), type_hash=OTHER),)).misdefined("/cmd_vel")
