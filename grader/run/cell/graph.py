"""The ROS graph as the probe sees it, with the owner of each node and endpoint."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Collection, Iterable
from functools import partial
from typing import Any, TypeVar

from rclpy.exceptions import NameValidationException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node as RclpyNode
from rclpy.node import NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.validate_full_topic_name import validate_full_topic_name
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_node_name import validate_node_name

from grader.recording.interaction import Service
from grader.recording.model import NS, Endpoint, Kind, Node, Owner, Qos

_INFRASTRUCTURE = ("/rosout", "/parameter_events")
_UNKNOWN_NAME = "_NODE_NAME_UNKNOWN_"
_INFINITE_NS = 2**63 - 1
_Found = TypeVar("_Found")
_OfNode = Callable[[str, str], list[tuple[str, list[str]]]]


def full_name(namespace: str, name: str) -> str:
    """Fully qualified node name."""
    return f"{namespace.rstrip('/')}/{name}"


def process_bits(gid: bytes) -> int:
    """The low 16 bits of the id of the process that an endpoint lives in.

    Fast DDS makes a participant's GUID prefix of vendor (2 bytes), host (2), process id (2,
    little endian), random (2) and participant number (4); measured with Fast DDS 2.14.5.
    """
    return int.from_bytes(gid[4:6], "little")


def qos_of(profile: Any) -> Qos:
    """QoS in the words of the model from a QoSProfile of rclpy."""
    history = profile.history.name.lower()
    known = history in ("keep_last", "keep_all")
    return Qos(
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        history=history if known else "unknown",
        depth=profile.depth if known else None,
        deadline_s=_seconds(profile.deadline),
        lifespan_s=_seconds(profile.lifespan),
        liveliness=profile.liveliness.name.lower(),
        liveliness_lease_s=_seconds(profile.liveliness_lease_duration),
    )


def _seconds(duration: Any) -> float | None:
    nanoseconds = duration.nanoseconds
    return None if nanoseconds <= 0 or nanoseconds >= _INFINITE_NS else nanoseconds / NS


def _note_vanished(known: dict[Any, Any], there: Collection[Any], now_ns: int) -> None:
    for key, one in known.items():
        if one.vanished_ns is None and key not in there:
            known[key] = dataclasses.replace(one, vanished_ns=now_ns)


class GraphObserver:
    """Polls the graph and dates every appearance and disappearance.

    Args:
        private: In a private network the participants that are here now are the cell's, and
            those that come later are the student's. Process ids tell nothing there.

    Attributes:
        forbidden_names: Whether a node or a topic has had a name that ROS does not allow. Every
            client library refuses such a name, also when it is asked about it.
        changed_ns: When something came up for the last time.
    """

    def __init__(
        self,
        node: RclpyNode,
        student_pids: Callable[[], Collection[int]],
        rescan: Callable[[], None],
        *,
        private: bool = False,
    ) -> None:
        self._node = node
        self._student_pids = student_pids
        self._rescan = rescan
        self._nodes: dict[tuple[str, str], Node] = {}
        self._endpoints: dict[str, Endpoint] = {}
        self._owners: dict[str, Owner] = {}
        self._services: dict[tuple[str, str, str], Service] = {}
        self._clients: dict[tuple[str, str, str], Service] = {}
        self._private = private
        self.newcomers = Owner.STUDENT
        """Whose the programs are that are being started."""
        self.forbidden_names = False
        self.changed_ns = 0
        for topic, _ in node.get_topic_names_and_types() if private else ():
            for info in node.get_publishers_info_by_topic(topic):
                self._owners[bytes(info.endpoint_gid)[:12].hex()] = Owner.PROBE

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Every node seen so far, in the order of appearance."""
        return tuple(self._nodes.values())

    @property
    def endpoints(self) -> tuple[Endpoint, ...]:
        """Every endpoint seen so far except those on /rosout and /parameter_events."""
        return tuple(self._endpoints.values())

    @property
    def services(self) -> tuple[Service, ...]:
        """Every service that a node of the student's has offered so far."""
        return tuple(self._services.values())

    @property
    def clients(self) -> tuple[Service, ...]:
        """Every service that a node of the student's has had a client of so far."""
        return tuple(self._clients.values())

    def poll(self) -> None:
        """Look at the graph once."""
        now_ns = time.time_ns()
        nodes: set[tuple[str, str]] = set()
        gids: set[str] = set()
        for topic, _ in self._found(self._node.get_topic_names_and_types):
            for kind in Kind:
                for info in self._found(partial(self._infos, kind, topic)):
                    if info["node_name"] == _UNKNOWN_NAME:
                        continue
                    nodes.add(self._see_node(info, now_ns))
                    if topic not in _INFRASTRUCTURE:
                        gids.add(self._see_endpoint(kind, topic, info, now_ns))
        _note_vanished(self._nodes, nodes, now_ns)
        _note_vanished(self._endpoints, gids, now_ns)
        of_node = self._node.get_service_names_and_types_by_node
        self._see_services(self._services, of_node, now_ns)
        of_node = self._node.get_client_names_and_types_by_node
        self._see_services(self._clients, of_node, now_ns)

    def _found(self, ask: Callable[[], Iterable[_Found]]) -> Iterable[_Found]:
        """The answer to a question about the graph; empty where ROS does not allow a name in it."""
        try:
            return ask()
        except (NameValidationException, UnicodeDecodeError):
            self.forbidden_names = True
            return ()

    def _infos(self, kind: Kind, topic: str) -> list[dict[str, Any]]:
        """What rclpy makes its TopicEndpointInfo of, which takes longest of all."""
        validate_full_topic_name(topic)
        ask = getattr(rclpy_implementation, f"rclpy_get_{kind.value}s_info_by_topic")
        with self._node.handle:
            found: list[dict[str, Any]] = ask(self._node.handle, topic, False)
        return found

    def _services_of(self, ask: _OfNode, base: str, namespace: str) -> list[tuple[str, list[str]]]:
        validate_node_name(base)
        validate_namespace(namespace)
        try:
            return ask(base, namespace)
        except NodeNameNonExistentError:
            return []

    def _see_node(self, info: dict[str, Any], now_ns: int) -> tuple[str, str]:
        gid = bytes(info["endpoint_gid"])
        key = (full_name(info["node_namespace"], info["node_name"]), gid[:12].hex())
        known = self._nodes.get(key)
        if known is None or known.vanished_ns is not None:
            self._nodes[key] = Node(key[0], self.owner(gid), now_ns)
            self.changed_ns = now_ns
        return key

    def _see_endpoint(self, kind: Kind, topic: str, found: dict[str, Any], now_ns: int) -> str:
        gid = bytes(found["endpoint_gid"])
        key = gid.hex()
        if key not in self._endpoints:
            info = TopicEndpointInfo(**found)
            self._endpoints[key] = Endpoint(
                kind=kind,
                topic=topic,
                type=info.topic_type,
                type_hash=str(info.topic_type_hash) if info.topic_type_hash.version > 0 else "",
                node=full_name(info.node_namespace, info.node_name),
                owner=self.owner(gid),
                qos=qos_of(info.qos_profile),
                gid=key,
                appeared_ns=now_ns,
            )
            self.changed_ns = now_ns
        elif self._endpoints[key].vanished_ns is not None:
            # A look at the graph may miss what is there, on a busy machine.
            self._endpoints[key] = dataclasses.replace(self._endpoints[key], vanished_ns=None)
            self.changed_ns = now_ns
        return key

    def _see_services(
        self, services: dict[tuple[str, str, str], Service], of_node: _OfNode, now_ns: int
    ) -> None:
        seen: set[tuple[str, str, str]] = set()
        there = [one for one in self._nodes.values() if one.vanished_ns is None]
        for name in {one.name for one in there if one.owner is Owner.STUDENT}:
            namespace, _, base = name.rpartition("/")
            found = self._found(partial(self._services_of, of_node, base, namespace or "/"))
            seen |= {(service, kind, name) for service, kinds in found for kind in kinds}
        for key in seen:
            known = services.get(key)
            if known is None or known.vanished_ns is not None:
                first_ns = known.appeared_ns if known is not None else now_ns
                services[key] = Service(*key, appeared_ns=first_ns)
                self.changed_ns = now_ns
        _note_vanished(services, seen, now_ns)

    def owner(self, gid: bytes) -> Owner:
        """Whose the participant of an endpoint is."""
        participant = gid[:12].hex()
        if participant not in self._owners:
            self._owners[participant] = self._find_owner(process_bits(gid))
        return self._owners[participant]

    def _find_owner(self, bits: int) -> Owner:
        if self._private:
            return self.newcomers
        if bits == os.getpid() & 0xFFFF:
            return Owner.PROBE
        if not self._is_student(bits):
            self._rescan()
        return self.newcomers if self._is_student(bits) else Owner.FOREIGN

    def _is_student(self, bits: int) -> bool:
        return any(pid & 0xFFFF == bits for pid in self._student_pids())
