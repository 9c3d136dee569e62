"""What a check needs of the assignment that uses it.

The model of a check's parameters lists its needs: ``needs = (Recorded("topic"),)`` says that each
scenario which the check judges records the topic that the parameter ``topic`` names. Validation
reads the list before any run, and so does the documentation of the check.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import ClassVar


class Act(str, Enum):
    """What a stimulus does to something that it names; the value is said before the name."""

    PUBLISH = "publishes on"
    CALL = "calls"
    SEND_GOAL = "sends a goal to"
    READ_PARAMETERS = "reads or sets the parameters of"
    SET_PARAMETERS = "sets parameters of"
    SERVE = "serves"
    JOIN = "is a join with the name"


@dataclass(frozen=True)
class Need:
    """Something that must be there for a check to judge anything.

    Names of parameters are keys below ``with``; a parameter that is None needs nothing.
    """

    words: ClassVar[str]
    """For the documentation; ``{name}`` stands for the name of a parameter."""

    def __str__(self) -> str:
        return self.words.format(**vars(self))


@dataclass(frozen=True)
class SimulatedRobot(Need):
    """A ``world`` in each scenario, or a simulator of the author's."""

    words = "a `world` with the simulated robot, or a `simulator`"
    about: str | None = None
    """Parameter that is about the robot, if one is."""
    unless: str | None = None
    """Parameter that stands for the robot where it is given."""
    commanded: bool = False
    """Whether the velocities that it is commanded count too, which a bag may not have."""


@dataclass(frozen=True)
class WithTurtles(Need):
    """Turtles in the ``world`` of each scenario."""

    words = "a `world` with `turtles`"


@dataclass(frozen=True)
class OfSimulator(Need):
    """What a simulator of the author's has to tell, where there is one."""

    words = "with a `simulator` its `{key}`"
    key: str
    """``contact``, the topic of what its robot touches, or ``map``, what stands around it."""
    about: str | None = None
    """Parameter that needs it, if one does where it is given."""
    value: str | None = None
    """The value with which that parameter needs it; by default any."""

    def applies_to(self, parameters: object) -> bool:
        """Whether a check with these parameters needs it."""
        given = getattr(parameters, self.about) if self.about else True
        return given is not None and self.value in (None, given)


@dataclass(frozen=True)
class Recorded(Need):
    """A topic that each scenario records."""

    words = "`{topic}` among the topics of `record`"
    topic: str = "topic"
    type: str | None = None
    """Parameter with its type, if the check expects one."""
    kind: str | None = None
    """Parameter with the student's end: messages to a subscription need not be recorded."""
    suffix: str = ""
    """Added to the parameter to get the name of the topic."""
    or_sent: bool = False
    """Whether a topic that a stimulus publishes on will do as well."""


@dataclass(frozen=True)
class SentOrOwn(Need):
    """A topic that the robot or a stimulus sends; or one that is recorded, of the student."""

    words = "`{topic}` from the simulated robot or a stimulus; with `{own}` among the topics of "
    words += "`record`"
    topic: str = "topic"
    own: str = "own"


@dataclass(frozen=True)
class OwnTransform(Need):
    """A transform that the simulated robot does not publish itself."""

    words = "no simulated robot that publishes the transform from `{parent}` to `{child}`"
    parent: str = "parent"
    child: str = "child"


@dataclass(frozen=True)
class Stimulated(Need):
    """A stimulus that does something to what a parameter names."""

    words = "a stimulus that {act.value} `{parameter}`"
    act: Act
    parameter: str
    suffix: str = ""
    """Added to the parameter to get the name."""
    fields: str | None = None
    """Parameter with fields of the requests or goals that are judged."""
    within: str | None = None
    """Parameter with how long an answer may take: the stimulus must wait as long."""
    having: str | None = None
    """Key that one of these stimuli must have, with a value as an example."""


PUBLISHED = Stimulated(Act.PUBLISH, "stimulus")
"""A topic that a stimulus publishes on."""


@dataclass(frozen=True)
class ParameterSet(Need):
    """A parameter that a stimulus sets to a value."""

    words = "a stimulus that sets the parameter `{name}` of `{node}` to `{value}`"
    node: str = "node"
    name: str = "name"
    value: str = "value"


@dataclass(frozen=True)
class ParametersGiven(Need):
    """Parameters that something is launched with."""

    words = "`parameters` in a `launch` of each scenario, with those of `{names}`, or a launch file"
    names: str = "names"


@dataclass(frozen=True)
class Submitted(Need):
    """A package of ``packages``, and perhaps one of its executables."""

    words = "`{package}` among `packages`"
    package: str = "package"
    executable: str | None = None


@dataclass(frozen=True)
class StudentTests(Submitted):
    """A package whose own tests are run after the build."""

    words = "`{package}` among `packages`; its tests are run with pytest after the build"


@dataclass(frozen=True)
class Bags(Need):
    """The bags of the submission, which are read for such a check only."""

    words = "bags, as `ros2 bag record` writes them"


@dataclass(frozen=True)
class RuffRules(Need):
    """Rules that ruff has: others are never broken."""

    words = "rules of ruff as `{rules}`"
    rules: str = "rules"


class Doubt(str, Enum):
    """What a busy machine may do to a run, so that a failure must happen twice to count."""

    STEERING_HELD_UP = "steering held up"
    """It holds up the node while the robot drives, which then goes another way."""
    ANSWER_MISSED = "answer missed"
    """It keeps a client and a server from discovering each other, or holds up an answer."""
