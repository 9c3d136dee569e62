"""Packets on a loopback of the test's own."""

from __future__ import annotations

import struct
import subprocess
import sys

import pytest

from grader.sandbox import trial
from grader.sandbox.packet_monitor import heartbeats

SOURCE = """\
import fcntl, socket, struct
from grader.sandbox.packet_monitor import PacketMonitor, bound_ports
from grader.sandbox.namespaces import _bring_up_loopback
_bring_up_loopback()
monitor = PacketMonitor()
ear, mouth = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
ear.bind(('127.0.0.1', 7410))
ours = bound_ports()
def send(data, port=7410, times=20):
    for _ in range(times):
        mouth.sendto(data, ('127.0.0.1', port))
    print(monitor.malformed(ours))
send(b'RTPS' + bytes((2, 3, 1, 15)) + bytes(60_000))
send(b'RTPS' + bytes((2, 3, 1, 15)) + bytes(12))
send(b'telemetry of a student', 7500)
send(b'telemetry of a student', 9000)
send(b'RTPS' + b'garbage' * 30)
send(b'RTPS')
send(b'')
send(bytes(3000))
for begin in range(0, 64 * 40, 64):
    writers = (number.to_bytes(3, 'big') + bytes((3,)) for number in range(begin, begin + 64))
    told = (struct.pack('<BBHI4siIiIi', 7, 1, 28, 0, one, 0, 1, 0, 1, 7) for one in writers)
    mouth.sendto(b'RTPS' + bytes((2, 3, 1, 15)) + bytes(12) + b''.join(told), ('127.0.0.1', 7410))
monitor.malformed(ours)
print(len(monitor.heartbeats))
"""


def test_only_what_no_middleware_sends_is_counted_and_of_writers_only_so_many() -> None:
    found = trial.try_sandbox()
    if found.problem:
        pytest.skip(f"no sandbox on this machine: {found.problem}; {found.remedy}")
    own_network = ["unshare", "--user", "--map-root-user", "--net"]
    said = subprocess.run(
        [*own_network, sys.executable, "-c", SOURCE], capture_output=True, text=True, check=False
    )
    counts = ["0", "0", "0", "0", "20", "40", "60", "80", "1000"]
    assert said.stdout.split() == counts, said.stderr


def heartbeat(writer: bytes, first: int, last: int, order: str = "<") -> bytes:
    """A submessage as the standard has it."""
    body = bytes(4) + writer + struct.pack(f"{order}iIiIi", 0, first, 0, last, 7)
    return struct.pack(f"{order}BBH", 7, order == "<", len(body)) + body


def test_heartbeats_tell_what_a_writer_of_a_program_keeps() -> None:
    prefix, own, builtin = bytes(range(12)), b"\0\0\x12\3", b"\0\3\0\xc7"
    data = struct.pack("<BBH", 0x15, 1, 8) + bytes(8)
    message = b"RTPS\2\3\1\x0f" + prefix + data + heartbeat(own, 3, 12)
    message += heartbeat(builtin, 1, 9) + heartbeat(own, 13, 12) + heartbeat(own, 4, 4, ">")
    writer = (prefix + own).hex()
    assert list(heartbeats(message)) == [(writer, 3, 12), (writer, 4, 4)]
    # Every process may send anything.
    assert not list(heartbeats(message[:40]))
    assert not list(heartbeats(message[:20] + bytes(30)))
