"""The order for a cell: one scenario to run, without points and checks."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from grader.run.process.process_sandbox import ProcessSandbox
from grader.spec.names import NO_NAMES, Names

if TYPE_CHECKING:
    from grader.assignment.model import AuthorSimulator
    from grader.assignment.stimuli.stimulus_model import StimulusModel

ORDER_FILE = "order.pickle"
RECORDING_FILE = "recording.mcap"
GO = b"go\n"
"""The line on standard input that a ready cell waits for."""


@dataclass(frozen=True)
class ProcessCommand:
    """A process of the student to start; its name is ``package/executable``.

    Attributes:
        after_s: When, in seconds since the start of the run.
        is_launch_file: It starts others, as ``ros2 launch`` does.
    """

    name: str
    argv: tuple[str, ...]
    after_s: float = 0.0
    is_launch_file: bool = False


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
        settle_s: How long after the graph's newest change a matching endpoint is still expected.
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
class UntilOrder:
    """When to end early, as ``until`` in the YAML says; None where not asked for."""

    messages: int | None = None
    quiet_s: float | None = None
    elapsed_s: float | None = None
    at_rest_s: float | None = None
    travelled_m: float | None = None
    stimuli_done: bool = False
    any: tuple[UntilOrder, ...] = ()


@dataclass(frozen=True)
class SimulatorOrder:
    """The simulated robots or turtles of a scenario; ``values`` stand for ``$name`` in its world.

    Attributes:
        robots: Name -> its own options, as JSON; empty for one robot without a name.
    """

    world: str
    values: dict[str, str]
    options: str
    seed: int
    robots: dict[str, str] = field(default_factory=dict)
    has_turtles: bool = False


@dataclass(frozen=True)
class AuthorSimulatorOrder:
    """A simulator of the author's, which is one of the companions.

    Attributes:
        name: That of its command.
        map: File of what stands in its world, or None; ``values`` stand for ``$name`` in it.
    """

    name: str
    options: AuthorSimulator
    map: str | None
    values: dict[str, str]


@dataclass(frozen=True)
class CellOrder:
    """One scenario for one cell.

    Attributes:
        companions: Programs of the author's, and the environment variables that they have.
        student_environment: Environment variables of the student's processes.
        scratch: Folder of the student: working directory, home and temporary files.
        stimuli: With their values.
        submission: Its record as JSON, to go into the recording unread.
        environment: What the recording says of the place of the run, as ``Recording.environment``.
        simulator: The simulated robot, or None.
        author_simulator: What watches a simulator of the author's, or None.
        hidden: Packages of the author's that students do not see in a sandbox.
        compiled_tracer: The library that compiled programs are started with, or None.
        mutation: Folder with mistakes that selftest imposes on right programs, or None.
        process_sandbox: The sandbox of each process of the student, or None.
        pauses: Whether the executors pause before the processes are stopped.
        names: Wrong names that the commands put right.
    """

    scenario: str
    seed: int
    commands: tuple[ProcessCommand, ...]
    student_environment: dict[str, str]
    prefixes: tuple[str, ...]
    topics: tuple[Topic, ...]
    stimuli: tuple[StimulusModel, ...]
    until: UntilOrder
    limits: RunLimits
    scratch: str
    submission: str
    companions: tuple[ProcessCommand, ...] = ()
    companion_environment: dict[str, str] = field(default_factory=dict)
    simulator: SimulatorOrder | None = None
    author_simulator: AuthorSimulatorOrder | None = None
    hidden: frozenset[str] = frozenset()
    values: dict[str, float] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    type_support: tuple[str, ...] = ()
    compiled_tracer: str | None = None
    mutation: str | None = None
    process_sandbox: ProcessSandbox | None = None
    tells_output: bool = False
    pauses: bool = False
    names: Names = NO_NAMES

    def to_bytes(self) -> bytes:
        """For the cell's folder; written before anything of a student's runs in the cell."""
        return pickle.dumps(self)

    @classmethod
    def from_bytes(cls, data: bytes) -> CellOrder:
        """Read what :meth:`to_bytes` wrote; never call it with what a student could write."""
        order = pickle.loads(data)
        assert isinstance(order, cls)
        return order
