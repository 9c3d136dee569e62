"""From a bag of a real robot to a recording, as if its messages had been observed in a run.

A bag has messages and their publishers. There are no processes and no nodes in the recording, and
no delay of the machine. Where the robot is, its odometry says.
"""

from __future__ import annotations

import json
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.errors import GraderFault
from grader.findings.words import code, codes, counted, metres
from grader.recording.bag import BagChannel, BagMessage, KeptBag
from grader.recording.cdr import decoder
from grader.recording.interface import concatenated_definition, definition_finder
from grader.recording.mcap_writer import RawMessage, write_recording
from grader.recording.model import (
    BAG,
    BAG_NOTES,
    BAG_RECEIVED,
    NS,
    Ending,
    Endpoint,
    Kind,
    Owner,
    Qos,
    Recording,
)
from grader.recording.odometry import Timed, jump, motion, rejected
from grader.recording.simulated import Scene
from grader.recording.submission import BagRecord, SubmissionRecord
from grader.spec.unit import format_duration
from sim.robot import robot_model

if TYPE_CHECKING:
    from grader.assignment.model import Scenario

_SAME_CLOCK_S = 2.0
"""Stamps in headers that are farther from a bag's own times come from another clock."""
_MOST_SAMPLES = 50
_NODE = "unknown node"
"""A bag does not say who published."""


@dataclass(frozen=True)
class BagOrder:
    """A scenario that reads a bag.

    Attributes:
        prefixes: Install spaces with the definitions of messages.
        same: Other bags of the submission with the same messages.
    """

    assignment: str
    scenario: Scenario
    submission: SubmissionRecord
    bag: BagRecord
    kept: KeptBag
    prefixes: Sequence[Path]
    same: Sequence[str] = ()


def record_bag(order: BagOrder, file: Path) -> None:
    """Write the recording of a bag.

    Raises:
        GraderFault: A type has no definition here.
    """
    reading = _Reading(order)
    recording = reading.recording()
    file.parent.mkdir(parents=True, exist_ok=True)
    write_recording(file, recording, reading.raw, reading.definitions)


class _Reading:
    """A bag as a scenario reads it: its topics under the names that the assignment has."""

    def __init__(self, order: BagOrder) -> None:
        assert order.scenario.bag is not None
        self._order, self._scenario = order, order.scenario
        self._types = order.scenario.recorded_types
        self._rename = order.scenario.bag.rename
        self._find = definition_finder(order.prefixes)
        self._notes: list[str] = []
        every = self._messages()
        # A static transform is published long before a bag begins, and recorded when it does.
        late_ns = [one.recorded_ns - one.published_ns for one in every]
        self._late_ns = round(statistics.median(late_ns)) if every else 0
        self.begin_ns = min((one.recorded_ns for one in every), default=0) - self._late_ns
        self.end_ns = max((one.published_ns for one in every), default=self.begin_ns)
        limit_ns = self.begin_ns + round(order.scenario.timeout * NS)
        self.is_cut = self.end_ns > limit_ns
        if self.is_cut:
            lasts = format_duration((self.end_ns - self.begin_ns) / NS)
            first = format_duration(order.scenario.timeout)
            self._notes.append(f"only the first {first} of the {lasts} in it are judged")
            self.end_ns = limit_ns
        self.raw = self._numbered([one for one in every if one.published_ns <= self.end_ns])

    @cached_property
    def definitions(self) -> dict[str, str]:
        """The definition of each type that is recorded."""
        try:
            return {
                type: concatenated_definition(type, self._find) for type in {*self._types.values()}
            }
        except KeyError as error:
            raise GraderFault(f"no definition of {error.args[0]} was found") from error

    def recording(self) -> Recording:
        """What is in the bag, as what was observed."""
        order, scenario = self._order, self._scenario
        odometry, commands = (
            self._values(one.topic) if scenario.has_robot else []
            for one in (scenario.topics.odometry, scenario.topics.command)
        )
        truth = motion(odometry, commands, scenario.robot.pose)
        self._notes += self._faults_of_recording(odometry)
        values = {name: float(value.number) for name, value in scenario.values.items()}
        return Recording(
            scenario=scenario.id,
            seed=0,
            ending=Ending.TIMEOUT if self.is_cut else Ending.UNTIL,
            launched_ns=self.begin_ns,
            matched_ns=self.begin_ns,
            stop_ns=self.end_ns,
            end_ns=self.end_ns,
            submission=order.submission,
            endpoints=tuple(self._endpoints()),
            truth=truth,
            incidents=rejected(commands),
            scenes={"": self._scene()} if scenario.has_robot else {},
            values=values,
            environment={
                "assignment": order.assignment,
                "ros_distro": order.bag.distro or "unknown",
                BAG: order.bag.path,
                **({BAG_NOTES: "\n".join(self._notes)} if self._notes else {}),
                **({} if order.kept.has_published else {BAG_RECEIVED: "true"}),
            },
        )

    def _messages(self) -> list[BagMessage]:
        """The messages on topics that are recorded, each once, in the order of their times."""
        found: dict[tuple[str, int, int, bytes], BagMessage] = {}
        twice: Counter[str] = Counter()
        for one in self._order.kept.messages():
            channel = self._renamed(one.channel)
            if self._is_read(channel):
                key = (channel.name, one.recorded_ns, one.published_ns, one.cdr)
                twice[channel.name] += key in found
                found[key] = replace(one, channel=channel)
        for topic, number in twice.items():
            if number:
                seen = f"{counted(number, 'message')} on {code(topic)} are in it more than once"
                self._notes.append(f"{seen}, and count once")
        return sorted(found.values(), key=lambda one: (one.published_ns, one.recorded_ns))

    def _is_read(self, channel: BagChannel) -> bool:
        """Whether a topic is recorded, with this type and, where that is known, its definition."""
        own = self._own_hashes.get(channel.type, "")
        is_other = channel.hash and own and channel.hash != own
        return self._types.get(channel.name) == channel.type and not is_other

    def _renamed(self, channel: BagChannel) -> BagChannel:
        """A topic by the name that the assignment has for it."""
        own = channel.name
        # What is renamed onto a topic comes in place of the one that has the name itself.
        taken = own in self._rename.values() and own not in self._rename
        return replace(channel, name="" if taken else self._rename.get(own, own))

    def _numbered(self, messages: Sequence[BagMessage]) -> list[RawMessage]:
        numbers: Counter[str] = Counter()
        found = []
        for one in messages:
            numbers[one.channel.name] += 1
            found.append(
                RawMessage(
                    topic=one.channel.name,
                    type=one.channel.type,
                    cdr=one.cdr,
                    stamp_ns=one.published_ns,
                    received_ns=max(0, one.recorded_ns - self._late_ns),
                    sequence=numbers[one.channel.name],
                )
            )
        return found

    def _endpoints(self) -> Iterator[Endpoint]:
        """The publishers, as the student's, and the subscription that stands for the reader."""
        for topic, type in self._types.items():
            read = BagChannel(topic, type, self._own_hashes[type])
            yield self._endpoint(Kind.SUBSCRIPTION, Owner.PROBE, read, Qos())
        for channel in map(self._renamed, self._order.kept.channels):
            # That nothing is said of its publishers does not mean that it had none.
            for qos in (channel.publishers or (Qos(),)) if channel.name in self._types else ():
                yield self._endpoint(Kind.PUBLISHER, Owner.STUDENT, channel, qos)

    def _endpoint(self, kind: Kind, owner: Owner, channel: BagChannel, qos: Qos) -> Endpoint:
        return Endpoint(
            kind=kind,
            topic=channel.name,
            type=channel.type,
            node=_NODE,
            owner=owner,
            qos=qos,
            gid="",
            appeared_ns=self.begin_ns,
            type_hash=channel.hash,
        )

    @cached_property
    def _own_hashes(self) -> dict[str, str]:
        return {type: self._own_hash(type) for type in self._types.values()}

    def _own_hash(self, type: str) -> str:
        """The hash of a definition here, which ROS installs beside it; nothing without it."""
        for prefix in self._order.prefixes:
            with suppress(OSError, ValueError, KeyError, TypeError, StopIteration):
                written = json.loads((prefix / "share" / f"{type}.json").read_text("utf-8"))
                hashes = written["type_hashes"]
                return str(next(one["hash_string"] for one in hashes if one["type_name"] == type))
        return ""

    @cached_property
    def _decoders(self) -> dict[str, Callable[[bytes], dict[str, Any]]]:
        return {type: decoder(type, text) for type, text in self.definitions.items()}

    def _values(self, topic: str) -> list[Timed]:
        """The messages on a topic that can be read, with their times."""
        found: list[Timed] = []
        for one in (one for one in self.raw if one.topic == topic):
            # Other bytes than its type has: they are counted when the recording is read.
            with suppress(Exception):
                found.append((one.stamp_ns, self._decoders[one.type](one.cdr)))
        return found

    def _scene(self) -> Scene:
        """The robot as the author describes it; nothing is known of what stands around it."""
        options = self._scenario
        model = robot_model(options.robot)
        return Scene(
            radius_m=model.radius_m,
            max_linear_m_s=model.limits.speed_m_s,
            max_angular_rad_s=model.limits.angular_speed_rad_s,
            outlines={},
            moving=(),
            began_ns=self.begin_ns,
            command_topic=options.topics.command.topic,
            odometry_topic=options.topics.odometry.topic,
            scan_topic=options.topics.scan.topic,
            acceleration_m_s2=model.limits.acceleration_m_s2,
        )

    def _faults_of_recording(self, odometry: Sequence[Timed]) -> Iterator[str]:
        """What is conspicuous about how the bag was recorded, one part of a sentence each."""
        order = self._order
        if order.same:
            yield f"it was handed in more than once, as {codes(order.same)} too"
        if order.bag.lost:
            lost = counted(order.bag.lost, "message")
            yield f"it is cut: its metadata.yaml counts {lost} more than are in it"
        publishers: defaultdict[str, int] = defaultdict(int)
        for channel in map(self._renamed, order.kept.channels):
            if self._types.get(channel.name) == channel.type:
                publishers[channel.name] += len(channel.publishers)
        for topic, number in publishers.items():
            if number > 1:
                yield f"{number} publishers were on {code(topic)} while it was recorded"
        yield from self._clocks()
        fastest = robot_model(self._scenario.robot).limits.speed_m_s
        jumped = jump(odometry, fastest)
        if jumped is not None:
            at_ns, way_m = jumped
            after = format_duration(round((at_ns - self.begin_ns) / NS, 2))
            yield f"the odometry jumps by {metres(way_m)} {after} after its beginning"

    def _clocks(self) -> Iterator[str]:
        """Times that do not go together: of another computer, of a simulation, or set meanwhile."""
        before: dict[str, int] = {}
        told = set()
        for one in sorted(self.raw, key=lambda one: one.received_ns):
            back_ns = before.get(one.topic, one.stamp_ns) - one.stamp_ns
            if back_ns > NS and one.topic not in told:
                told.add(one.topic)
                back = format_duration(back_ns / NS)
                yield f"the clock of {code(one.topic)} jumps back by {back}"
            before[one.topic] = one.stamp_ns
        for topic in sorted({one.topic for one in self.raw}):
            messages = [one for one in self.raw if one.topic == topic]
            sampled = messages[:: max(1, len(messages) // _MOST_SAMPLES)]
            ages_s = [age for one in sampled if (age := self._age_s(one)) is not None]
            off_s = statistics.median(ages_s) if ages_s else 0.0
            if abs(off_s) > _SAME_CLOCK_S:
                off = format_duration(round(abs(off_s), 1))
                way = "behind" if off_s > 0.0 else "ahead of"
                yield (
                    f"the stamps in the headers of {code(topic)} are {off} {way} the times of the "
                    "bag: they come "
                    "from another clock, such as that of a simulation or of another computer"
                )

    def _age_s(self, message: RawMessage) -> float | None:
        """How much older the stamp in its header is than a message, or None without one."""
        with suppress(Exception):
            stamp: Mapping[str, int] = self._decoders[message.type](message.cdr)["header"]["stamp"]
            return (message.stamp_ns - stamp["sec"] * NS - stamp["nanosec"]) / NS
        return None
