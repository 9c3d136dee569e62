"""A ROS domain that only its holder uses on this machine, locked as long as the holder lives.

Domains 1 to 101 are used: the ports of higher ones collide with the system's ephemeral
ports (https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Domain-ID.html), and 0 is the
default. The lock is the one of ROS's own ``domain_coordinator``: a TCP socket bound to port
32768 + domain, which the kernel releases with the process.
"""

from __future__ import annotations

import random
import socket
from collections.abc import Collection
from contextlib import AbstractContextManager

from grader.errors import GraderFault
from grader.sandbox.packet_monitor import bound_ports

DOMAINS = range(1, 102)
_BASE_PORT = 32768
_FIRST_PORT, _PORTS = 7400, 250
_OWN_PORTS = range(10, _PORTS, 2)


class DomainLock(AbstractContextManager["DomainLock"]):
    """Holds one domain until it is closed; without a lock in a private network."""

    def __init__(self, domain_id: int, lock: socket.socket | None = None) -> None:
        self.domain_id = domain_id
        self._socket = lock

    def close(self) -> None:
        """Release the domain."""
        if self._socket is not None:
            self._socket.close()

    def __exit__(self, *_: object) -> None:
        self.close()


def lock_domain(avoid: Collection[int] = ()) -> DomainLock:
    """Lock any free domain; in no order, as nodes on the last one may just have been killed."""
    free = [domain for domain in DOMAINS if domain not in avoid]
    for domain in random.SystemRandom().sample(free, len(free)):
        lock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            lock.bind(("", _BASE_PORT + domain))
        except OSError:
            lock.close()
            continue
        return DomainLock(domain, lock)
    raise GraderFault(f"all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are in use")


def joined_domains() -> tuple[int, ...]:
    """Domains with participants in a private network, by the UDP ports that are bound."""
    return domains_of_ports(bound_ports())


def domains_of_ports(bound: Collection[int]) -> tuple[int, ...]:
    """Domains of which the ports of a participant are bound.

    A participant binds 7400 + 250 * domain for discovery by multicast, and two of its own,
    10 + 2 * participant and 11 + 2 * participant above that (the mapping of ports of the DDSI-RTPS
    standard; see About-Domain-ID). One of these alone may be any socket's, whose port the system
    chose.
    """
    ports = {port - _FIRST_PORT for port in bound}
    domains = (port for port in sorted(ports) if port >= 0 and port % _PORTS == 0)
    return tuple(
        first // _PORTS
        for first in domains
        if any({first + own, first + own + 1} <= ports for own in _OWN_PORTS)
    )
