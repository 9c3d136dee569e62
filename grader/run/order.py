"""What a cell is told to do: one scenario, without points, checks or anything else.

Kept to the standard library, because a cell starts for every run.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from typing import Any

from grader.run.process.process_sandbox import ProcessSandbox

ORDER_FILE = "order.json"
RECORDING_FILE = "recording.mcap"
GO = b"go\n"
"""What a cell that is ready waits for on its standard input."""


@dataclass(frozen=True)
class ProcessCommand:
    """A process of the student to start.

    Attributes:
        name: ``package/executable``.
        argv: What to execute; the first entry is a path.
    """

    name: str
    argv: tuple[str, ...]


@dataclass(frozen=True)
class Topic:
    """A topic to record."""

    name: str
    type: str
    reliability: str
    durability: str
    depth: int
    ours: bool = False


@dataclass(frozen=True)
class RunLimits:
    """Bounds of one run; times in seconds.

    Attributes:
        settle_s: From the newest change of the student's graph until we stop to expect a
            matching endpoint.
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
        values: What stands for ``$name`` in it.
    """

    world: str
    values: dict[str, str]
    options: str
    seed: int


@dataclass(frozen=True)
class CellOrder:
    """One scenario for one cell.

    Attributes:
        scratch: Folder of the student: working directory, home and temporary files.
        submission: The submission's facts, as JSON, to go into the recording unread.
        simulator: The simulated robot, or None.
        process_sandbox: The sandbox of each process of the student, or None.
    """

    scenario: str
    seed: int
    commands: tuple[ProcessCommand, ...]
    environment: dict[str, str]
    prefixes: tuple[str, ...]
    topics: tuple[Topic, ...]
    stimuli: tuple[dict[str, Any], ...]
    until: Until
    limits: RunLimits
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
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, text: str) -> CellOrder:
        """Read what :meth:`to_json` wrote."""
        data = json.loads(text)
        data["commands"] = tuple(
            ProcessCommand(item["name"], tuple(item["argv"])) for item in data["commands"]
        )
        data["topics"] = tuple(Topic(**item) for item in data["topics"])
        data["stimuli"] = tuple(data["stimuli"])
        data["until"] = Until.from_dict(data["until"])
        if data["simulator"] is not None:
            data["simulator"] = SimulatorOrder(**data["simulator"])
        data["limits"] = RunLimits(**data["limits"])
        data["prefixes"] = tuple(data["prefixes"])
        data["type_support"] = tuple(data["type_support"])
        if data["process_sandbox"] is not None:
            data["process_sandbox"] = ProcessSandbox.from_dict(data["process_sandbox"])
        return cls(**data)
