"""A node on a domain of its own, given again what it was given in a recording.

For students at home: the node runs as they would run it, without a sandbox, and nothing is
judged. The player is a process of its own, as a cell is.
"""

from __future__ import annotations

import pickle
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import UsageError
from grader.recording.mcap_reader import read_inputs
from grader.recording.model import NS, Kind, Owner, Qos, Recording
from grader.ros import RosInstallation
from grader.run.environment import cell_environment, student_environment
from grader.run.order import ProcessCommand
from grader.run.runner import process_command
from grader.scratch import Scratch

if TYPE_CHECKING:
    from grader.assignment.model import Assignment

ORDER_FILE = "replay.pickle"
_ENDING_LIMIT_S = 20.0
_DEFAULT = Qos("reliable", "volatile")


@dataclass(frozen=True)
class Input:
    """A topic that is given, with the QoS that it was given with."""

    topic: str
    type: str
    reliability: str
    durability: str


@dataclass(frozen=True)
class ReplayOrder:
    """What is replayed."""

    recording: str
    commands: tuple[ProcessCommand, ...]
    environment: Mapping[str, str]
    scratch: str
    inputs: tuple[Input, ...]
    outputs: Mapping[str, str]
    type_support: tuple[str, ...]
    launched_ns: int
    matched_ns: int
    duration_s: float
    discovery_s: float
    shutdown_s: float


def make_order(
    file: Path,
    recording: Recording,
    assignment: Assignment,
    ros: RosInstallation,
    install: Path,
    scratch: Path,
    type_support: Sequence[Path] = (),
) -> ReplayOrder:
    """What to replay."""
    scenario = next((s for s in assignment.scenarios if s.id == recording.scenario), None)
    if scenario is None:
        raise UsageError(
            f"{file}: the assignment {assignment.id!r} has no scenario {recording.scenario!r}"
        )
    inputs = _inputs(file, recording)
    if not inputs:
        raise UsageError(
            f"{file}: nothing was published to the node in this run, so there is nothing to "
            "replay: run it with `ros2 run`"
        )
    began_ns = recording.matched_ns or recording.launched_ns
    return ReplayOrder(
        recording=str(file.resolve()),
        commands=tuple(
            process_command(ros, launch, assignment, install, dict(recording.values))
            for launch in scenario.launch
        ),
        environment=student_environment(ros, install, scratch),
        scratch=str(scratch),
        inputs=inputs,
        outputs={
            endpoint.topic: endpoint.type
            for endpoint in recording.student_endpoints(Kind.PUBLISHER)
        },
        type_support=tuple(map(str, type_support)),
        launched_ns=recording.launched_ns,
        matched_ns=began_ns,
        duration_s=(recording.stop_ns - began_ns) / NS,
        discovery_s=scenario.discovery,
        shutdown_s=scenario.shutdown,
    )


def play(order: ReplayOrder, ros: RosInstallation) -> int:
    """Replay, with everything that happens on standard output.

    Returns:
        0 when it was played to its end, 1 when the node ended or never listened, 130 when it
        was interrupted; nothing of it runs any more.
    """
    with Scratch("replay") as folder:
        (folder / ORDER_FILE).write_bytes(pickle.dumps(order))
        player = subprocess.Popen(
            [str(ros.python), "-m", "grader.run.replay_player", str(folder)],
            env=cell_environment(ros),
            # Its end tells the player to end; so does Ctrl-C, in here.
            stdin=subprocess.PIPE,
            start_new_session=True,
        )
        try:
            return player.wait()
        except KeyboardInterrupt:
            assert player.stdin is not None
            player.stdin.close()
            player.wait(_ENDING_LIMIT_S)
            return 130
        finally:
            if player.poll() is None:
                player.kill()
                player.wait()
            if player.stdin is not None:
                player.stdin.close()


def _inputs(file: Path, recording: Recording) -> tuple[Input, ...]:
    types = {message.topic: message.type for message in read_inputs(file, recording)}
    offered = {
        endpoint.topic: endpoint.qos
        for endpoint in recording.endpoints
        if endpoint.owner is Owner.PROBE and endpoint.kind is Kind.PUBLISHER
    }
    found = []
    for topic, interface in sorted(types.items()):
        qos = offered.get(topic, _DEFAULT)
        found.append(Input(topic, interface, qos.reliability, qos.durability))
    return tuple(found)
