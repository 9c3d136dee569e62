"""Interpreters that have imported ahead for the students' programs of a class.

To start Python, to import rclpy, NumPy and the interfaces, and to load the DDS libraries is most
of what a student's process costs. A nursery keeps, for each command that was asked for before, an
interpreter that has done this and waits where Python would open the program (see
``tracer/_rosgrade_zygote.py``): in the same environment, of the same command line, with nothing
of a student's in it. A cell asks it for a fork, which enters the sandbox that the cell has made.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import socket
import subprocess
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from grader.run.readable import readable

_VARIABLE = "ROSGRADE_ZYGOTE_FD"
_TOLD_BYTES = 64
_ASKED_BEFORE = 2
"""The first of a class is started as everywhere; who grades only one needs no zygote."""
_MOST_TRIES = 3
"""A zygote that ends, for whatever reason, is replaced that often."""
_MOST = 4
"""Each takes some 100 MB, and a submission's install space decides about its environment."""
IMPORTS = (
    # What is not seen to import what is there already comes first: NumPy's Cython.
    "numpy",
    "argparse",
    "importlib.metadata",
    "random",
    "threading",
    "rclpy",
    "rclpy.action",
    "rclpy.callback_groups",
    "rclpy.duration",
    "rclpy.executors",
    "rclpy.node",
    "rclpy.parameter",
    "rclpy.qos",
    "rclpy.time",
    "rcl_interfaces/msg/Log",
    "rcl_interfaces/srv/ListParameters",
    "std_msgs/msg/String",
    "geometry_msgs/msg/Twist",
    "sensor_msgs/msg/LaserScan",
    "nav_msgs/msg/Odometry",
)
"""What the students of such courses import; without any of it nothing but time is lost."""


def key_of(argv: Sequence[str], environment: Mapping[str, str]) -> str:
    """Name a command; its runs differ in nothing else.

    Args:
        argv: The command.
        environment: Its variables, without those of one run.
    """
    return hashlib.sha256(json.dumps([*argv, sorted(environment.items())]).encode()).hexdigest()


@dataclass
class _Zygote:
    key: str
    popen: subprocess.Popen[bytes]
    socket: socket.socket
    is_ready: bool = False
    cpu_s: float = 0.0

    def is_silent(self) -> bool:
        """Whether it has printed nothing, which each program that imports the same would print."""
        assert self.popen.stdout is not None
        assert self.popen.stderr is not None
        return not readable((self.popen.stdout.fileno(), self.popen.stderr.fileno()), 0)

    def let_go(self) -> None:
        """Let it end as soon as no cell can ask it any more."""
        for stream in (self.socket, self.popen.stdout, self.popen.stderr):
            assert stream is not None
            stream.close()


class Zygotes:
    """All zygotes of a nursery."""

    def __init__(self) -> None:
        """There is none."""
        self._asked: Counter[str] = Counter()
        self._started: Counter[str] = Counter()
        self._zygotes: list[_Zygote] = []
        self._cpu_s = 0.0

    def ask(self, argv: Sequence[str], environment: Mapping[str, str], seccomp: int) -> None:
        """Note that a command is about to be run; it may be run more often.

        Args:
            argv: Python and a program.
            environment: Its variables, without those of one run.
            seccomp: Number of seccomp(2) on this machine.
        """
        key = key_of(argv, environment)
        self._asked[key] += 1
        if self._asked[key] < _ASKED_BEFORE or any(one.key == key for one in self._zygotes):
            return
        if self._started[key] < _MOST_TRIES:
            self._started[key] += 1
            for oldest in self._zygotes[: 1 + len(self._zygotes) - _MOST]:
                self._remove(oldest)
            self._start(key, argv, environment, seccomp)

    def sockets(self) -> list[int]:
        """What becomes readable as a zygote gets ready, has forked, or ends."""
        return [one.socket.fileno() for one in self._zygotes]

    def hear(self, descriptor: int) -> None:
        """Take in what one of :meth:`sockets` has to say."""
        for one in list(self._zygotes):
            if one.socket.fileno() == descriptor:
                told = b""
                with contextlib.suppress(OSError):
                    told = one.socket.recv(_TOLD_BYTES)
                if not told or not one.is_silent():
                    self._remove(one)
                    if not told:
                        # A cell has dismissed it, if it has not ended by itself.
                        one.popen.kill()
                    continue
                one.is_ready = True
                self._cpu_s += float(told) - one.cpu_s
                one.cpu_s = float(told)

    @property
    def cpu_s(self) -> float:
        """CPU time of them so far, without that of the students' processes."""
        return self._cpu_s

    def ready(self) -> dict[str, int]:
        """Descriptor of the socket of each that can fork, by its command's key."""
        return {one.key: one.socket.fileno() for one in self._zygotes if one.is_ready}

    def close(self) -> None:
        """Let them end; cells may still ask them."""
        for one in self._zygotes:
            one.let_go()
        self._zygotes.clear()

    def _remove(self, one: _Zygote) -> None:
        self._zygotes.remove(one)
        one.let_go()

    def _start(
        self, key: str, argv: Sequence[str], environment: Mapping[str, str], seccomp: int
    ) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            variables = {**environment, _VARIABLE: str(theirs.fileno())}
            popen = subprocess.Popen(
                argv,
                cwd="/",
                env=variables,
                stdin=subprocess.DEVNULL,
                # Python makes its streams as they are needed where somebody reads them.
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                pass_fds=(theirs.fileno(),),
            )
        ours.send(json.dumps({"imports": IMPORTS, "seccomp": seccomp}).encode())
        self._zygotes.append(_Zygote(key, popen, ours))
