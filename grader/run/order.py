"""What a cell is told to do: one scenario, without points, checks or anything else.

Kept to the standard library, because a cell starts for every run.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from typing import Any

from grader.run.process.process_sandbox import ProcessSandbox
from grader.run.stimuli.orders import StimulusOrder, from_dict, to_dict

ORDER_FILE = "order.json"
RECORDING_FILE = "recording.mcap"
GO = b"go\n"
"""What a cell that is ready waits for on its standard input."""


@dataclass(frozen=True)
class Command:
    """A process of the student to start.

    Attributes:
        name: ``package/executable``.
        argv: What to execute; the first entry is a path.
    """

    name: str
    argv: tuple[str, ...]


@dataclass(frozen=True)
class Topic:
    """A topic to record.

    Attributes:
        name: Fully qualified.
        type: Interface name.
        reliability: Requested by the probe's first subscription.
        durability: Requested by the probe's first subscription.
        depth: Queue depth of the probe.
        ours: The simulator's own topic: recorded, but nothing waits for it.
    """

    name: str
    type: str
    reliability: str
    durability: str
    depth: int
    ours: bool = False


@dataclass(frozen=True)
class Limits:
    """Bounds of one run; times in seconds.

    Attributes:
        discovery_s: Until the first node.
        settle_s: From the newest change of the student's graph until we stop to expect a
            matching endpoint.
        timeout_s: From the first match to the end of the observation.
        shutdown_s: From SIGINT to SIGTERM.
        terminate_s: From SIGTERM to SIGKILL.
        messages: Messages kept per topic.
        message_bytes: Largest message kept.
        output_bytes: Output kept per stream, half of it from the end.
    """

    discovery_s: float
    timeout_s: float
    shutdown_s: float
    settle_s: float = 5.0
    terminate_s: float = 1.0
    messages: int = 20_000
    message_bytes: int = 4 * 2**20
    output_bytes: int = 512 * 2**10


@dataclass(frozen=True)
class Until:
    """When to end early; None where not asked for. See the YAML's ``until``."""

    messages: int | None = None
    quiet_s: float | None = None
    elapsed_s: float | None = None
    at_rest_s: float | None = None
    travelled_m: float | None = None
    stimuli_done: bool = False
    any: tuple[Until, ...] = ()

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Until:
        """Read what :func:`dataclasses.asdict` made."""
        return cls(**{**data, "any": tuple(cls.from_dict(item) for item in data["any"])})


@dataclass(frozen=True)
class SimulatorOrder:
    """The simulated robot of a scenario.

    Attributes:
        world: World file.
        values: What stands for ``$name`` in it.
        options: :class:`sim.description.SimulatorOptions` as JSON.
        seed: Of noise and drift.
    """

    world: str
    values: dict[str, str]
    options: str
    seed: int


@dataclass(frozen=True)
class CellOrder:
    """One scenario for one cell.

    Attributes:
        scenario: Its id.
        seed: For everything random.
        commands: Processes of the student.
        environment: Their variables.
        prefixes: ament prefixes, for message definitions.
        topics: What to record.
        stimuli: What to do besides observing.
        until: When to end early.
        limits: Bounds.
        scratch: Folder of the student: working directory, home and temporary files.
        submission: The submission's facts, as JSON, to go into the recording unread.
        simulator: The simulated robot, or None.
        values: Random values of the scenario, to go into the recording.
        facts: Environment facts to go into the recording.
        type_support: Install spaces of ours with interfaces that the probe needs.
        process_sandbox: The sandbox of each process of the student, or None.
        tells_output: Whether lines that the student prints are told as they come.
    """

    scenario: str
    seed: int
    commands: tuple[Command, ...]
    environment: dict[str, str]
    prefixes: tuple[str, ...]
    topics: tuple[Topic, ...]
    stimuli: tuple[StimulusOrder, ...]
    until: Until
    limits: Limits
    scratch: str
    submission: str
    simulator: SimulatorOrder | None = None
    values: dict[str, float] = field(default_factory=dict)
    facts: dict[str, str] = field(default_factory=dict)
    type_support: tuple[str, ...] = ()
    process_sandbox: ProcessSandbox | None = None
    tells_output: bool = False

    def to_json(self) -> str:
        """As one line."""
        stimuli = [to_dict(order) for order in self.stimuli]
        return json.dumps({**dataclasses.asdict(self), "stimuli": stimuli})

    @classmethod
    def from_json(cls, text: str) -> CellOrder:
        """Read what :meth:`to_json` wrote."""
        data = json.loads(text)
        data["commands"] = tuple(
            Command(item["name"], tuple(item["argv"])) for item in data["commands"]
        )
        data["topics"] = tuple(Topic(**item) for item in data["topics"])
        data["stimuli"] = tuple(from_dict(item) for item in data["stimuli"])
        data["until"] = Until.from_dict(data["until"])
        if data["simulator"] is not None:
            data["simulator"] = SimulatorOrder(**data["simulator"])
        data["limits"] = Limits(**data["limits"])
        data["prefixes"] = tuple(data["prefixes"])
        data["type_support"] = tuple(data["type_support"])
        if data["process_sandbox"] is not None:
            data["process_sandbox"] = ProcessSandbox.from_dict(data["process_sandbox"])
        return cls(**data)
