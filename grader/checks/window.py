"""When a check looks at a run: windows of time, after or before something, or while it is so."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Parameters
from grader.checks.need import OfSimulator, Recorded, SimulatedRobot
from grader.findings.fields import unlike, words
from grader.findings.value import EXACT, value_at
from grader.findings.words import code
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth
from grader.spec.name import QualifiedNodeName, TopicName
from grader.spec.unit import format_duration

Interval = tuple[int, int]
"""Beginning and end in ns; the end is not in it."""

_STILL = 1e-3
_ROBOT: dict[str, Callable[[Truth], bool]] = {
    "touches": lambda step: step.contact is not None,
    "moves": lambda step: max(abs(step.linear_m_s), abs(step.angular_rad_s)) > _STILL,
    "rests": lambda step: max(abs(step.linear_m_s), abs(step.angular_rad_s)) <= _STILL,
}


class Phase(Parameters):
    """What happens in a run, or is so for a while: `message`, `lifecycle`, `robot` or `log`."""

    needs = (
        Recorded("message", or_sent=True),
        Recorded("node", suffix="/transition_event"),
        SimulatedRobot("robot"),
        OfSimulator("contact", "robot", "touches"),
    )

    message: TopicName | None = Field(
        None,
        description="Topic that is recorded or that a stimulus publishes on: from a message with "
        "these `fields` until one with others.",
    )
    fields: dict[str, Any] = Field(
        default_factory=dict, description="Fields of the message; by default any message."
    )
    lifecycle: Literal["unconfigured", "inactive", "active", "finalized"] | None = Field(
        None,
        description="State of a lifecycle `node`, by its topic `transition_event`, which the "
        "scenario records as `lifecycle_msgs/msg/TransitionEvent`.",
    )
    node: QualifiedNodeName | None = Field(None, description="The lifecycle node.")
    robot: Literal["touches", "moves", "rests"] | None = Field(
        None, description="What the simulated robot does; `touches` is a contact."
    )
    log: str | None = Field(None, min_length=1, description="From a line with this text on.")

    @model_validator(mode="after")
    def _one_thing(self) -> Phase:
        kinds = [self.message, self.lifecycle, self.robot, self.log]
        if sum(kind is not None for kind in kinds) != 1:
            raise ValueError("give one of: message, lifecycle, robot, log")
        if (self.node is None) != (self.lifecycle is None):
            raise ValueError("'lifecycle' and 'node' go together")
        if self.fields and self.message is None:
            raise ValueError("'fields' are those of a 'message'")
        return self

    @property
    def judges_bags(self) -> bool:
        """Whether a bag shows it: a bag has messages, and the motion of the robot."""
        return self.message is not None or self.robot in ("moves", "rests")

    def named_fields(self) -> Iterator[NamedFields]:
        """The fields of the message."""
        yield NamedFields(("fields",), self.message or "", self.fields)

    def _asked(self) -> str:
        if self.message is not None:
            return f"{code(self.message)} has {words(self.fields) if self.fields else 'a message'}"
        if self.log is not None:
            return f"“{self.log}” is written"
        if self.robot == "touches":
            return "the robot touches something"
        if self.robot is not None:
            return f"the robot {self.robot}"
        return f"{code(str(self.node))} is {self.lifecycle}"

    def intervals(self, recording: Recording) -> list[Interval]:
        """When it is so."""
        found: list[Interval] = []
        begin_ns = None
        for time_ns, is_so in [*self._samples(recording), (recording.stop_ns + 1, False)]:
            if is_so and begin_ns is None:
                begin_ns = time_ns
            elif not is_so and begin_ns is not None:
                found.append((begin_ns, time_ns))
                begin_ns = None
        return _not_empty(found)

    def _samples(self, recording: Recording) -> Iterator[tuple[int, bool]]:
        """Times with whether it is so from then on, oldest first."""
        if self.message is not None:
            for message in recording.carried(self.message):
                yield message.stamp_ns, not unlike(message.value, self.fields, EXACT)
        elif self.robot is not None:
            for step in recording.truth:
                yield step.time_ns, _ROBOT[self.robot](step)
        elif self.log is not None:
            for line in sorted(recording.log, key=lambda one: one.time_ns):
                if self.log.casefold() in line.text.casefold():
                    yield line.time_ns, True
        elif any(one.name == f"{self.node}/get_state" for one in recording.services):
            yield recording.launched_ns, self.lifecycle == "unconfigured"
            for event in recording.on(f"{self.node}/transition_event"):
                state = value_at(event.value, "goal_state.label")
                yield event.stamp_ns, state == self.lifecycle


@dataclass(frozen=True)
class Window:
    """When a check looks at a run.

    Attributes:
        while_: Several windows, one for each time that it is so.
        from_s: Seconds from the beginning of each window.
        to_s: The same, or None for the end of the run.
    """

    after: Phase | None = None
    before: Phase | None = None
    while_: Phase | None = None
    from_s: float = 0.0
    to_s: float | None = None

    @property
    def phases(self) -> dict[str, Phase]:
        """Its phases, by their keys in YAML."""
        found = {"after": self.after, "before": self.before, "while": self.while_}
        return {key: phase for key, phase in found.items() if phase is not None}

    def __str__(self) -> str:
        """Say it in words."""
        times = []
        if self.from_s:
            times.append(f"from {format_duration(self.from_s)}")
        if self.to_s is not None:
            times.append(f"to {format_duration(self.to_s)}")
        phases = [f"{key} {phase.asked_for}" for key, phase in self.phases.items()]
        return ", ".join([" ".join(times), *phases] if times else phases)

    def intervals(self, recording: Recording) -> list[Interval]:
        """Its times in a run, none of them empty."""
        end_ns = recording.stop_ns + 1
        found = [(recording.matched_ns or recording.launched_ns, end_ns)]
        if self.after is not None:
            found = [(begin_ns, end_ns) for begin_ns, _ in self.after.intervals(recording)[:1]]
        if self.before is not None:
            found = _cut_off(found, self.before.intervals(recording))
        if self.while_ is not None:
            during = self.while_.intervals(recording)
            found = [_common(one, other) for one in found for other in during]
        found = [self._part(one) for one in _not_empty(found)]
        if self.after is None and self.while_ is None and not self.from_s:
            # What was published before the first match belongs to the beginning.
            found = [(0, part_end_ns) for _, part_end_ns in found]
        return _not_empty(found)

    def _part(self, interval: Interval) -> Interval:
        """The part of an interval between ``from_s`` and ``to_s``."""
        begin_ns, end_ns = interval
        if self.to_s is not None:
            end_ns = min(end_ns, begin_ns + round(self.to_s * NS))
        return begin_ns + round(self.from_s * NS), end_ns


def _not_empty(intervals: Sequence[Interval]) -> list[Interval]:
    return [(begin_ns, end_ns) for begin_ns, end_ns in intervals if begin_ns < end_ns]


def _common(one: Interval, other: Interval) -> Interval:
    """The time that is in both; if there is none, it ends before it begins."""
    return max(one[0], other[0]), min(one[1], other[1])


def _cut_off(intervals: Sequence[Interval], others: Sequence[Interval]) -> list[Interval]:
    """Each interval until the first of the others that is not over when it begins."""
    found = []
    for begin_ns, end_ns in intervals:
        later_ns = (max(begin_ns, start) for start, stop in others if stop > begin_ns)
        found.append((begin_ns, min([*later_ns, end_ns])))
    return found
