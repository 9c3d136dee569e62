"""The monitor of packets to the middleware in a private network."""

from __future__ import annotations

import socket
import struct
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

_UDP_TABLE = Path("/proc/net/udp")
_ETH_P_IP = 0x0800
# linux/socket.h, linux/if_packet.h: since Linux 4.20.
_SOL_PACKET, _PACKET_IGNORE_OUTGOING = 263, 23
_FRAGMENT_OFFSET = 0x1FFF
_KEPT_BYTES = 65_535
_MOST_AT_ONCE = 4096
# Ports of the first participants of domain 0: the mapping of the DDSI-RTPS standard.
_FIRST_PORT, _LAST_PORT = 7400, 7649
_RTPS_HEADER_BYTES = 20
_SUBMESSAGE_HEADER_BYTES = 4
_HEARTBEAT, _HEARTBEAT_BYTES = 0x07, 28
_MOST_WRITERS, _MOST_KEPT, _MOST_HEARTBEATS = 1000, 2**31, 64
_UDP_HEADER_BYTES = 8


class PacketMonitor:
    """Packets to the ports of the middleware: what is not RTPS, and heartbeats of writers.

    Attributes:
        heartbeats: Writer as hex -> the largest number of messages in its heartbeats, and how
            many heartbeats had another newest message.
    """

    def __init__(self) -> None:
        self._malformed = 0
        self._newest: dict[str, int] = {}
        self.heartbeats: dict[str, tuple[int, int]] = {}
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, 0)
        try:
            self._socket.setblocking(False)
            # On a loopback each packet goes out, and comes in.
            self._socket.setsockopt(_SOL_PACKET, _PACKET_IGNORE_OUTGOING, 1)
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
            header_bytes = (packet[0] & 0x0F) * 4
            port = int.from_bytes(packet[header_bytes + 2 : header_bytes + 4], "big")
            is_first = not int.from_bytes(packet[6:8], "big") & _FRAGMENT_OFFSET
            is_udp = packet[9] == socket.IPPROTO_UDP
            if not (is_first and is_udp and _FIRST_PORT <= port <= _LAST_PORT):
                continue
            data = packet[header_bytes + _UDP_HEADER_BYTES :]
            # After the name the major version; every vendor's id so far begins with 1.
            if len(data) >= _RTPS_HEADER_BYTES and data[:5] == b"RTPS\2" and data[6] == 1:
                self._note_heartbeats(data)
            elif port in ports:
                self._malformed += 1
        return self._malformed

    def _note_heartbeats(self, data: bytes) -> None:
        # A student's process may send anything, and as much as it likes.
        for writer, first, last in islice(heartbeats(data), _MOST_HEARTBEATS):
            if writer in self.heartbeats or len(self.heartbeats) < _MOST_WRITERS:
                most_kept, changes = self.heartbeats.get(writer, (0, 0))
                if self._newest.get(writer) != last:
                    changes += 1
                self._newest[writer] = last
                self.heartbeats[writer] = max(most_kept, last - first + 1), changes


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
