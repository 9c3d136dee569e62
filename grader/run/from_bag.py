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
from grader.measure.motion.track import is_at_rest
from grader.recording.bag import BagChannel, BagMessage, KeptBag
from grader.recording.cdr import decoder
from grader.recording.interface import concatenated_definition, definition_finder
from grader.recording.mcap_writer import RawMessage, write_recording
from grader.recording.model import (
    BAG,
    BAG_NOTES,
    BAG_RECEIVED,
    BAG_RENAMED,
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
from grader.run.bag_clocks import clocks_set_back, other_clocks
from grader.spec.unit import format_duration
from sim.robot import robot_model

if TYPE_CHECKING:
    from grader.assignment.model import Scenario

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
        messages = self._messages()
        # A static transform is published long before a bag begins, and recorded when it does.
        latencies_ns = [message.recorded_ns - message.published_ns for message in messages]
        self._latency_ns = round(statistics.median(latencies_ns)) if messages else 0
        first_ns = min((message.recorded_ns for message in messages), default=0)
        self.begin_ns = first_ns - self._latency_ns
        self.end_ns = max((message.published_ns for message in messages), default=self.begin_ns)
        limit_ns = self.begin_ns + round(order.scenario.timeout * NS)
        self.is_cut = self.end_ns > limit_ns
        if self.is_cut:
            lasts = format_duration((self.end_ns - self.begin_ns) / NS)
            first = format_duration(order.scenario.timeout)
            self._notes.append(f"only the first {first} of the {lasts} in it are judged")
            self.end_ns = limit_ns
        self.raw = self._numbered(
            [message for message in messages if message.published_ns <= self.end_ns]
        )

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
        odometry: list[Timed] = []
        commands: list[Timed] = []
        if scenario.has_robot:
            odometry = self._values(scenario.topics.odometry.topic)
            commands = self._values(scenario.topics.command.topic)
        truth = motion(odometry, commands, scenario.robot.pose)
        self._notes += self._faults_of_recording(odometry)
        if truth and not is_at_rest(truth[0]):
            self._notes.append("the robot drives already when it begins")
        environment = {
            "assignment": order.assignment,
            "ros_distro": order.bag.distro or "unknown",
            BAG: order.bag.path,
            BAG_RENAMED: " ".join(f"{own}:={name}" for own, name in self._rename.items()),
        }
        if self._notes:
            environment[BAG_NOTES] = "\n".join(self._notes)
        if not order.kept.has_published:
            environment[BAG_RECEIVED] = "true"
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
            values={name: float(value.number) for name, value in scenario.values.items()},
            environment=environment,
        )

    def _messages(self) -> list[BagMessage]:
        """The messages on topics that are recorded, each once, in the order of their times."""
        messages: dict[tuple[str, int, int, bytes], BagMessage] = {}
        copies: Counter[str] = Counter()
        for message in self._order.kept.messages():
            channel = self._renamed(message.channel)
            if self._is_read(channel):
                key = (channel.name, message.recorded_ns, message.published_ns, message.cdr)
                if key in messages:
                    copies[channel.name] += 1
                messages[key] = replace(message, channel=channel)
        for topic, number in copies.items():
            self._notes.append(
                f"{counted(number, 'message')} on {code(topic)} are in it more than once, and "
                "count once"
            )
        return sorted(messages.values(), key=lambda one: (one.published_ns, one.recorded_ns))

    def _is_read(self, channel: BagChannel) -> bool:
        """Whether a topic is recorded, with this type and, where that is known, its definition."""
        if self._types.get(channel.name) != channel.type:
            return False
        known_hashes = {channel.hash, self._hashes_here[channel.type]} - {""}
        return len(known_hashes) <= 1

    def _renamed(self, channel: BagChannel) -> BagChannel:
        """A topic by the name that the assignment has for it."""
        new_name = self._rename.get(channel.name)
        if new_name is not None:
            return replace(channel, name=new_name)
        # What is renamed onto a topic comes in place of the one that has the name itself.
        return replace(channel, name="") if channel.name in self._rename.values() else channel

    def _numbered(self, messages: Sequence[BagMessage]) -> list[RawMessage]:
        numbers: Counter[str] = Counter()
        numbered = []
        for one in messages:
            numbers[one.channel.name] += 1
            numbered.append(
                RawMessage(
                    topic=one.channel.name,
                    type=one.channel.type,
                    cdr=one.cdr,
                    stamp_ns=one.published_ns,
                    received_ns=max(0, one.recorded_ns - self._latency_ns),
                    sequence=numbers[one.channel.name],
                )
            )
        return numbered

    def _endpoints(self) -> Iterator[Endpoint]:
        """The publishers, as the student's, and the subscription that stands for the reader."""
        for topic, type in self._types.items():
            read = BagChannel(topic, type, self._hashes_here[type])
            yield self._endpoint(Kind.SUBSCRIPTION, Owner.PROBE, read, Qos())
        filled = {(one.name, one.type) for one in self._order.bag.topics if one.messages}
        channels = (one for one in self._order.kept.channels if (one.name, one.type) in filled)
        for channel in map(self._renamed, channels):
            if channel.name in self._types:
                # That nothing is said of its publishers does not mean that it had none.
                for qos in channel.publishers or (Qos(),):
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
    def _hashes_here(self) -> dict[str, str]:
        return {type: self._hash_here(type) for type in self._types.values()}

    def _hash_here(self, type: str) -> str:
        """The hash of a definition here, which ROS installs beside it; nothing without it."""
        for prefix in self._order.prefixes:
            with suppress(OSError, ValueError, KeyError, TypeError):
                description = json.loads((prefix / "share" / f"{type}.json").read_text("utf-8"))
                hashes = {
                    one["type_name"]: one["hash_string"] for one in description["type_hashes"]
                }
                return str(hashes[type])
        return ""

    @cached_property
    def _decoders(self) -> dict[str, Callable[[bytes], dict[str, Any]]]:
        return {type: decoder(type, text) for type, text in self.definitions.items()}

    def _values(self, topic: str) -> list[Timed]:
        """The messages on a topic that can be read, with their times."""
        values: list[Timed] = []
        for message in self.raw:
            if message.topic == topic:
                # Other bytes than its type has: they are counted when the recording is read.
                with suppress(Exception):
                    values.append((message.stamp_ns, self._decoders[message.type](message.cdr)))
        return values

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
        yield from clocks_set_back(self.raw)
        yield from other_clocks(self.raw, self._stamp_ns)
        fastest = robot_model(self._scenario.robot).limits.speed_m_s
        jumped = jump(odometry, fastest)
        if jumped is not None:
            at_ns, way_m = jumped
            after = format_duration(round((at_ns - self.begin_ns) / NS, 2))
            yield f"the odometry jumps by {metres(way_m)} {after} after its beginning"

    def _stamp_ns(self, message: RawMessage) -> int | None:
        """The stamp in the header of a message, or None where it has none."""
        with suppress(Exception):
            stamp: Mapping[str, int] = self._decoders[message.type](message.cdr)["header"]["stamp"]
            return stamp["sec"] * NS + stamp["nanosec"]
        return None
