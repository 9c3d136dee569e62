"""Listens on a network of one's own to what is sent to the middleware."""

from __future__ import annotations

import ctypes
import socket
import struct
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

_UDP_TABLE = Path("/proc/net/udp")
_SO_ATTACH_FILTER = 26
_ETH_P_IP = 0x0800
_KEPT_BYTES = 65_535
_MOST_AT_ONCE = 4096
# Ports of the first participants of domain 0: the mapping of the DDSI-RTPS standard.
_FIRST_PORT, _LAST_PORT = 7400, 7649
# Classic BPF (linux/bpf_common.h): load a word, half or byte at a place, or behind the IP header.
_LD_W, _LD_H, _LD_B, _LDX_MSH = 0x20, 0x28, 0x30, 0xB1
_LD_H_IND = 0x48
_JEQ, _JGE, _JGT, _JSET, _RET = 0x15, 0x35, 0x25, 0x45, 0x06
# linux/filter.h and linux/if_packet.h: every packet of a loopback comes by twice.
_PACKET_TYPE, _OUTGOING = 0xFFFFF000 + 4, 4
_RTPS_HEADER_BYTES = 20
_SUBMESSAGE_HEADER_BYTES = 4
_HEARTBEAT, _HEARTBEAT_BYTES = 0x07, 28
_MOST_WRITERS, _MOST_KEPT, _MOST_HEARTBEATS = 1000, 2**31, 64
_UDP_HEADER_BYTES = 8


class PacketMonitor:
    """Packets to the ports of the middleware: what is not RTPS, and heartbeats of writers.

    Attributes:
        heartbeats: Writer as hex -> the most messages that it said it keeps, and how many
            heartbeats told of another newest message.
    """

    def __init__(self) -> None:
        self._count = 0
        self._newest: dict[str, int] = {}
        self.heartbeats: dict[str, tuple[int, int]] = {}
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, 0)
        try:
            code = b"".join(_filter())
            buffer = ctypes.create_string_buffer(code, len(code))
            given = struct.pack("HxxxxxxP", len(code) // 8, ctypes.addressof(buffer))
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, given)
            self._socket.setblocking(False)
            self._socket.bind(("lo", _ETH_P_IP))
        except OSError:
            self._socket.close()
            raise

    def malformed(self, ports: Collection[int]) -> int:
        """How many packets to these UDP ports so far were none of any RTPS."""
        for _ in range(_MOST_AT_ONCE):
            try:
                packet = self._socket.recv(_KEPT_BYTES)
            except BlockingIOError:
                break
            header = (packet[0] & 0x0F) * 4
            data = packet[header + _UDP_HEADER_BYTES :]
            # After the name the major version; every vendor's id so far begins with 1.
            if len(data) >= _RTPS_HEADER_BYTES and data[:5] == b"RTPS\2" and data[6] == 1:
                self._note_heartbeats(data)
            else:
                self._count += int.from_bytes(packet[header + 2 : header + 4], "big") in ports
        return self._count

    def _note_heartbeats(self, data: bytes) -> None:
        # A student's process may send anything, and as much as it likes.
        for writer, first, last in islice(heartbeats(data), _MOST_HEARTBEATS):
            if writer in self.heartbeats or len(self.heartbeats) < _MOST_WRITERS:
                kept, number = self.heartbeats.get(writer, (0, 0))
                number += self._newest.get(writer) != last
                self._newest[writer] = last
                self.heartbeats[writer] = max(kept, last - first + 1), number


def bound_ports() -> frozenset[int]:
    """UDP ports that are bound in this network at the moment."""
    lines = _UDP_TABLE.read_text(encoding="ascii").splitlines()[1:]
    return frozenset(int(line.split()[1].rpartition(":")[2], 16) for line in lines)


def heartbeats(data: bytes) -> Iterator[tuple[str, int, int]]:
    """Heartbeats of writers that programs make, in an RTPS message (DDSI-RTPS 2.5, 9.4.5.7)."""
    place = _RTPS_HEADER_BYTES
    while place + _SUBMESSAGE_HEADER_BYTES <= len(data):
        order = "<" if data[place + 1] & 1 else ">"
        (size,) = struct.unpack_from(f"{order}H", data, place + 2)
        begin = place + _SUBMESSAGE_HEADER_BYTES
        body = data[begin : begin + min(size, _HEARTBEAT_BYTES)]
        # The last byte of a writer's id tells whether it is one of the middleware's own.
        if data[place] == _HEARTBEAT and len(body) >= _HEARTBEAT_BYTES and not body[7] & 0xC0:
            high, low, newest_high, newest_low = struct.unpack_from(f"{order}iIiI", body, 8)
            first, last = (high << 32) + low, (newest_high << 32) + newest_low
            if 0 < first <= last < first + _MOST_KEPT:
                yield (data[8:_RTPS_HEADER_BYTES] + body[4:8]).hex(), first, last
        if not size:
            return
        place = begin + size


def _filter() -> list[bytes]:
    """Of IPv4: UDP, not a later fragment, to a port of DDS."""
    keep, drop = 10, 11
    program = [
        (_LD_W, 0, 0, _PACKET_TYPE),
        (_JEQ, drop, None, _OUTGOING),
        (_LD_B, 0, 0, 9),
        (_JEQ, None, drop, socket.IPPROTO_UDP),
        (_LD_H, 0, 0, 6),
        (_JSET, drop, None, 0x1FFF),
        (_LDX_MSH, 0, 0, 0),
        (_LD_H_IND, 0, 0, 2),
        (_JGE, None, drop, _FIRST_PORT),
        (_JGT, drop, keep, _LAST_PORT),
        (_RET, 0, 0, _KEPT_BYTES),
        (_RET, 0, 0, 0),
    ]
    return [
        struct.pack("HBBI", code, *(_distance(number, place) for place in jumps), value)
        for number, (code, *jumps, value) in enumerate(program)
    ]


def _distance(number: int, place: int | None) -> int:
    """How far a jump goes; None, and 0 in what is no jump, go on."""
    return place - number - 1 if place else 0
