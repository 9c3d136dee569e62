"""Which failures have to happen twice, because the machine may have had a part in the first."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from grader.checks.doubt import is_doubtful
from grader.checks.need import Doubt
from grader.recording.event import Breach, Disturbance
from grader.recording.model import NS, Call, Recording
from grader.recording.simulated import Truth
from tests.checks.builder import LAUNCH_NS, process, recording, taken

SERVICE = "/bot_publisher/list_parameters"


def waits(waited_s: float, every_s: float) -> tuple[Disturbance, ...]:
    return tuple(
        Disturbance(LAUNCH_NS + round(k * every_s * NS), 0, round(waited_s * NS))
        for k in range(1, round(20 / every_s))
    )


def driven(disturbance: tuple[Disturbance, ...]) -> Recording:
    truth = tuple(
        Truth(LAUNCH_NS + k * NS, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, None) for k in range(20)
    )
    return recording(truth=truth, disturbance=disturbance)


@pytest.mark.parametrize(
    ("disturbance", "doubtful"),
    [
        pytest.param(waits(0.3, 9.0), True, id="held up once for long"),
        pytest.param(waits(0.01, 0.2), False, id="many short waits"),
        pytest.param((), False, id="left alone"),
    ],
)
def test_where_a_held_up_robot_went_is_doubtful(
    disturbance: tuple[Disturbance, ...], doubtful: bool
) -> None:
    steering = Doubt.STEERING_HELD_UP
    assert is_doubtful(driven(disturbance), steering) is doubtful
    assert not is_doubtful(driven(disturbance), None)
    assert not is_doubtful(recording(disturbance=disturbance), steering)


@pytest.mark.parametrize(
    ("answers", "waited_s", "doubtful"),
    [
        pytest.param((None, None, None), 0.4, True, id="client and service may not have met"),
        pytest.param((None, None, None), 0.0, False, id="nothing kept them apart"),
        pytest.param((0.1, None, None), 0.4, False, id="they had met"),
        pytest.param((0.1, 0.1, 0.1), 0.4, False, id="everything was answered"),
        pytest.param((), 0.4, False, id="nothing was asked"),
    ],
)
def test_silence_on_a_busy_machine_is_doubtful(
    answers: tuple[float | None, ...], waited_s: float, doubtful: bool
) -> None:
    calls = tuple(
        Call(
            SERVICE,
            "rcl_interfaces/srv/ListParameters",
            LAUNCH_NS + NS + k * NS // 2,
            None if after_s is None else LAUNCH_NS + NS + k * NS // 2 + round(after_s * NS),
        )
        for k, after_s in enumerate(answers)
    )
    noise = taken(0.5, 4.4, waited_s=waited_s) if waited_s else ()
    run = recording(calls=calls, disturbance=noise)
    assert is_doubtful(run, Doubt.ANSWER_MISSED) is doubtful
    assert not is_doubtful(run, None)


@pytest.mark.parametrize(
    ("ended", "doubtful"),
    [
        ({"exit_code": -9}, True),
        ({"exit_code": -19}, True),
        ({"exit_code": -11}, False),
        ({"exit_code": 1}, False),
        ({"exit_code": -9, "stopped_by": "SIGKILL"}, False),
    ],
)
def test_a_signal_that_any_process_may_have_sent_must_come_twice(
    ended: dict[str, Any], doubtful: bool
) -> None:
    killed = recording(processes=(process(**{"exited_s": 1.2, "stopped_by": "itself", **ended}),))
    for doubt in (None, *Doubt):
        assert is_doubtful(killed, doubt) is doubtful
    memory = Breach(LAUNCH_NS + NS, "memory", "1056 MiB of memory", "1024 MiB")
    assert not is_doubtful(replace(killed, breaches=(memory,)), None)
