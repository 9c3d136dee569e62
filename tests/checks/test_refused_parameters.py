"""Parameters of checks that make no sense: their author reads why before any run."""

from __future__ import annotations

from typing import Any

import pytest

from tests.checks.builder import judge, recording

TOPIC = {"topic": "/cmd_vel"}
COUNTED = {**TOPIC, "field": "data"}
FOLLOWING = {**TOPIC, "source": "/odom", "tolerance": 0.1}
ANSWERED = {**TOPIC, "stimulus": "/chatter"}
PEER = {**TOPIC, "kind": "publisher"}


@pytest.mark.parametrize(
    ("check", "parameters", "words"),
    [
        ("messages.count", TOPIC, "say how many"),
        ("messages.count", {**TOPIC, "exactly": 1, "at_most": 2}, "'exactly' cannot be used with"),
        (
            "messages.count",
            {**TOPIC, "at_least": 3, "at_most": 2},
            r"at_least \(3\) is more than at_most \(2\)",
        ),
        ("messages.sequence", COUNTED, "either 'values' or 'step'"),
        ("messages.sequence", {**COUNTED, "values": [1], "step": 1}, "either 'values' or 'step'"),
        ("messages.sequence", {**COUNTED, "values": [1], "start": 1}, "'start' needs 'step'"),
        ("messages.follows", {**FOLLOWING, "fields": {"x": "sine(x)"}}, "is not a field"),
        ("timing.period", {**TOPIC, "period": "300"}, "has no unit"),
        ("timing.period", {**TOPIC, "period": "0.3 m"}, "unit of length"),
        ("timing.period", {**TOPIC, "period": "1 s", "tolerance": "5 m"}, "neither a share such"),
        ("timing.period", {**TOPIC, "period": "1 s", "tolerance": "-5 %"}, "negative"),
        ("timing.period", {**TOPIC, "period": "1 s", "spread": "wide"}, "neither a share"),
        ("timing.rate", TOPIC, "give a bound"),
        ("timing.rate", {**TOPIC, "at_least": "9 Hz", "at_most": "1 Hz"}, "more than at_most"),
        ("timing.latency", ANSWERED, "median, most or both"),
        ("timing.latency", {**ANSWERED, "most": "3 s"}, "'most' is more than 'within'"),
        ("executor.responsive", {"within": "0 s"}, "too small"),
        ("log.follows", {"topic": "/scan", "fields": ["ranges 0"]}, "'ranges 0' is not a field"),
        ("log.contains", {}, "'text', 'pattern' or 'number'"),
        ("log.contains", {"number": "> x"}, "asks nothing of a number"),
        ("log.contains", {"number": "2 .. 1"}, "asks nothing of a number"),
        ("log.contains", {"pattern": "("}, "is not a regular expression"),
        ("log.contains", {"text": "x", "at_least": 2, "at_most": 1}, "more than at_most"),
        ("qos.offered", TOPIC, "name a policy: reliability, durability"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(
    check: str, parameters: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        judge(check, recording(), **parameters)
