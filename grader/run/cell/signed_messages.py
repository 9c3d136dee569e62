"""Messages with the id of their publisher, which rclpy does not tell: taken by rcl itself.

A name of a topic says nothing of who publishes on it, and neither does a message. The id is the
same as that of the endpoint in the graph, whose owner is known.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from sim.polled import PolledGroup, never

_DEPTH = 1000
_TAKEN, _NOTHING = 0, 401
_GID_BYTES = 16


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("a", "d", "r", "z", "state")]


class _Bytes(ctypes.Structure):
    """rcl_serialized_message_t."""

    _fields_ = [
        ("buffer", ctypes.POINTER(ctypes.c_uint8)),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    ]


class _Info(ctypes.Structure):
    """rmw_message_info_t of Jazzy."""

    _fields_ = [
        ("source_ns", ctypes.c_int64),
        ("received_ns", ctypes.c_int64),
        ("publication_number", ctypes.c_uint64),
        ("reception_number", ctypes.c_uint64),
        ("implementation", ctypes.c_char_p),
        ("gid", ctypes.c_uint8 * _GID_BYTES),
        ("is_local", ctypes.c_bool),
    ]


@dataclass(frozen=True)
class Signed:
    """A message, when it was published, and by what endpoint."""

    time_ns: int
    gid: bytes
    value: Any


class SignedMessages:
    """A subscription from which messages are taken when asked for."""

    def __init__(self, node: Node, topic: str, kind: Any) -> None:
        self._kind = kind
        # Best effort hears every publisher; a pose that is lost is made up for by the next.
        profile = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._subscription = node.create_subscription(
            kind,
            topic,
            never,
            profile,
            callback_group=PolledGroup(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )

    def take(self) -> Iterator[Signed]:
        """What has come since, oldest first."""
        rcl, rcutils = _library("rcl"), _library("rcutils")
        take = rcl.rcl_take_serialized_message
        take.argtypes = [ctypes.c_void_p] * 4
        rcutils.rcutils_get_default_allocator.restype = _Allocator
        data, info = _Bytes(allocator=rcutils.rcutils_get_default_allocator()), _Info()
        handle = self._subscription.handle
        try:
            for _ in range(_DEPTH):
                with handle:
                    done = take(
                        handle.pointer, ctypes.addressof(data), ctypes.addressof(info), None
                    )
                if done == _NOTHING:
                    return
                if done != _TAKEN:
                    raise RuntimeError(f"rcl_take_serialized_message returned {done}")
                content = ctypes.string_at(data.buffer, data.length)
                try:
                    value = deserialize_message(content, self._kind)
                except Exception:  # a payload that is no such message
                    continue
                yield Signed(info.source_ns, bytes(info.gid), value)
        finally:
            rcutils.rcutils_uint8_array_fini(ctypes.byref(data))


@cache
def _library(name: str) -> ctypes.CDLL:
    """A library of ROS that this process has loaded already, wherever it lies."""
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        path = line.partition("/")[2]
        if path.rpartition("/")[2].partition(".so")[0] == f"lib{name}":
            return ctypes.CDLL(f"/{path}")
    raise RuntimeError(f"this process has no library lib{name}")
