"""Listens on a network of one's own for packets to the middleware that no middleware sends."""

from __future__ import annotations

import ctypes
import socket
import struct
from collections.abc import Collection
from pathlib import Path

_UDP_TABLE = Path("/proc/net/udp")
_SO_ATTACH_FILTER = 26
_ETH_P_IP = 0x0800
_KEPT_BYTES = 128
_MOST_AT_ONCE = 4096
# Ports of the first participants of domain 0: the mapping of the DDSI-RTPS standard.
_FIRST_PORT, _LAST_PORT = 7400, 7649
# Classic BPF (linux/bpf_common.h): load a word, half or byte at a place, or behind the IP header.
_LD_W, _LD_H, _LD_B, _LDX_MSH = 0x20, 0x28, 0x30, 0xB1
_LD_W_IND, _LD_H_IND, _LD_B_IND = 0x40, 0x48, 0x50
_JEQ, _JGE, _JGT, _JSET, _RET = 0x15, 0x35, 0x25, 0x45, 0x06
# linux/filter.h and linux/if_packet.h: every packet of a loopback comes by twice.
_PACKET_TYPE, _OUTGOING = 0xFFFFF000 + 4, 4
_RTPS, _RTPS_MAJOR = 0x52545053, 2
_RTPS_HEADER_BYTES = 20
_UDP_HEADER_BYTES = 8


class Wire:
    """What was sent to given ports and is not RTPS.

    Opened while there is the right to; anybody may read it.
    """

    def __init__(self) -> None:
        """Listen from now on.

        Raises:
            OSError: There is no such right, or the kernel has no packet sockets.
        """
        self._count = 0
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
            self._count += int.from_bytes(packet[header + 2 : header + 4], "big") in ports
        return self._count

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()


def bound_ports() -> frozenset[int]:
    """UDP ports that are bound in this network at the moment."""
    lines = _UDP_TABLE.read_text(encoding="ascii").splitlines()[1:]
    return frozenset(int(line.split()[1].rpartition(":")[2], 16) for line in lines)


def _filter() -> list[bytes]:
    """Of IPv4: UDP, not a later fragment, to a port of DDS, with no header of RTPS."""
    keep, drop = 18, 19
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
        (_JGT, drop, None, _LAST_PORT),
        (_LD_H_IND, 0, 0, 4),
        (_JGE, None, keep, _UDP_HEADER_BYTES + _RTPS_HEADER_BYTES),
        (_LD_W_IND, 0, 0, _UDP_HEADER_BYTES),
        (_JEQ, None, keep, _RTPS),
        (_LD_B_IND, 0, 0, _UDP_HEADER_BYTES + 4),
        (_JEQ, None, keep, _RTPS_MAJOR),
        # The first byte of every vendor's id so far.
        (_LD_B_IND, 0, 0, _UDP_HEADER_BYTES + 6),
        (_JEQ, drop, None, 1),
        (_RET, 0, 0, _KEPT_BYTES),
        (_RET, 0, 0, 0),
    ]
    return [
        struct.pack("HBBI", code, *(_distance(number, place) for place in jumps), value)
        for number, (code, *jumps, value) in enumerate(program)
    ]


def _distance(number: int, place: int | None) -> int:
    """How far a jump goes; to None, and to 0 of what is no jump, is to go on."""
    return place - number - 1 if place else 0
