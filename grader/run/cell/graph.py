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
_PREFIX_BYTES = 12
"""Bytes of an endpoint's id that are its participant's, so the same for all of one process."""
_Item = TypeVar("_Item")
_ServicesOfNode = Callable[[str, str], list[tuple[str, list[str]]]]
"""Name and namespace of a node -> its services, or clients, each with its types."""


def full_name(namespace: str, name: str) -> str:
    """Fully qualified node name."""
    return f"{namespace.rstrip('/')}/{name}"


def participant_of(gid: bytes) -> str:
    """The id of the participant that an endpoint belongs to."""
    return gid[:_PREFIX_BYTES].hex()


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


def _note_vanished(known: dict[Any, Any], present: Collection[Any], now_ns: int) -> None:
    """Date the disappearance of what is known, and not among the keys that are present."""
    for key, item in known.items():
        if item.vanished_ns is None and key not in present:
            known[key] = dataclasses.replace(item, vanished_ns=now_ns)


class GraphObserver:
    """Polls the graph and dates every appearance and disappearance.

    Args:
        private: In a private network the participants that are here now are the cell's, and
            those that come later are those of :attr:`newcomers`. Process ids tell nothing there.

    Attributes:
        newcomers: Whose the programs are that are being started.
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
        self.forbidden_names = False
        self.changed_ns = 0
        if private:
            for topic, _ in node.get_topic_names_and_types():
                for info in node.get_publishers_info_by_topic(topic):
                    self._owners[participant_of(bytes(info.endpoint_gid))] = Owner.PROBE

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
        for topic, _ in self._ask(self._node.get_topic_names_and_types):
            for kind in Kind:
                for info in self._ask(partial(self._infos, kind, topic)):
                    if info["node_name"] == _UNKNOWN_NAME:
                        continue
                    nodes.add(self._see_node(info, now_ns))
                    if topic not in _INFRASTRUCTURE:
                        gids.add(self._see_endpoint(kind, topic, info, now_ns))
        _note_vanished(self._nodes, nodes, now_ns)
        _note_vanished(self._endpoints, gids, now_ns)
        get_services = self._node.get_service_names_and_types_by_node
        self._see_services(self._services, get_services, now_ns)
        get_clients = self._node.get_client_names_and_types_by_node
        self._see_services(self._clients, get_clients, now_ns)

    def _ask(self, question: Callable[[], Iterable[_Item]]) -> Iterable[_Item]:
        """The answer of the graph to a question; empty where ROS does not allow a name in it."""
        try:
            return question()
        except (NameValidationException, UnicodeDecodeError):
            self.forbidden_names = True
            return ()

    def _infos(self, kind: Kind, topic: str) -> list[dict[str, Any]]:
        """What rclpy makes a TopicEndpointInfo of: to make one takes long, so only new ones are."""
        validate_full_topic_name(topic)
        get_infos = getattr(rclpy_implementation, f"rclpy_get_{kind.value}s_info_by_topic")
        with self._node.handle:
            infos: list[dict[str, Any]] = get_infos(self._node.handle, topic, False)
        return infos

    def _services_of(
        self, get_services: _ServicesOfNode, base: str, namespace: str
    ) -> list[tuple[str, list[str]]]:
        validate_node_name(base)
        validate_namespace(namespace)
        try:
            return get_services(base, namespace)
        except NodeNameNonExistentError:
            return []

    def _see_node(self, info: dict[str, Any], now_ns: int) -> tuple[str, str]:
        gid = bytes(info["endpoint_gid"])
        name = full_name(info["node_namespace"], info["node_name"])
        key = (name, participant_of(gid))
        known = self._nodes.get(key)
        if known is None or known.vanished_ns is not None:
            self._nodes[key] = Node(name, self.owner(gid), now_ns)
            self.changed_ns = now_ns
        return key

    def _see_endpoint(self, kind: Kind, topic: str, fields: dict[str, Any], now_ns: int) -> str:
        gid = bytes(fields["endpoint_gid"])
        key = gid.hex()
        if key not in self._endpoints:
            info = TopicEndpointInfo(**fields)
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
        self,
        known: dict[tuple[str, str, str], Service],
        get_services: _ServicesOfNode,
        now_ns: int,
    ) -> None:
        """Note the services, or clients, of the student's nodes: name, type and node of each."""
        present: set[tuple[str, str, str]] = set()
        nodes = [node for node in self._nodes.values() if node.vanished_ns is None]
        for node in {node.name for node in nodes if node.owner is Owner.STUDENT}:
            namespace, _, base = node.rpartition("/")
            services = self._ask(partial(self._services_of, get_services, base, namespace or "/"))
            present |= {(service, type, node) for service, types in services for type in types}
        for key in present:
            service = known.get(key)
            if service is None:
                known[key] = Service(*key, appeared_ns=now_ns)
            elif service.vanished_ns is not None:
                known[key] = Service(*key, appeared_ns=service.appeared_ns)
            else:
                continue
            self.changed_ns = now_ns
        _note_vanished(known, present, now_ns)

    def owner(self, gid: bytes) -> Owner:
        """Whose the participant of an endpoint is."""
        participant = participant_of(gid)
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
