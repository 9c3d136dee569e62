"""Two real nodes that meet: how long discovery takes on this machine."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import dataclass

from grader.ros import RosInstallation
from grader.run.cell.domain import lock_domain
from grader.run.environment import cell_environment

_LIMIT_S = 15.0


@dataclass(frozen=True)
class DiscoveryTime:
    """What came of it.

    Attributes:
        met_s: Seconds from the second node's creation to its match with the first, or None.
        error: Why it failed, or empty.
    """

    met_s: float | None
    error: str = ""


def meet(ros: RosInstallation) -> DiscoveryTime:
    """Start two nodes in two processes and wait until a publisher and a subscription match."""
    with lock_domain() as domain:
        environment = cell_environment(ros)
        environment["ROS_DOMAIN_ID"] = str(domain.domain_id)
        first = subprocess.Popen(
            [str(ros.python), "-m", "grader.run.cell.discovery_probe", "listen"],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert first.stdout is not None
            if first.stdout.readline().strip() != "listening":
                return DiscoveryTime(None, _last_line(first.communicate()[1]))
            second = subprocess.run(
                [str(ros.python), "-m", "grader.run.cell.discovery_probe", "publish"],
                env=environment,
                capture_output=True,
                text=True,
                timeout=2 * _LIMIT_S,
                check=False,
            )
        finally:
            if first.stdin is not None:
                first.stdin.close()
            first.wait(_LIMIT_S)
    if second.returncode != 0:
        return DiscoveryTime(None, _last_line(second.stderr) or "the nodes did not find each other")
    return DiscoveryTime(float(second.stdout))


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else ""


def _listen() -> int:
    import rclpy
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("rosgrade_doctor_listener", start_parameter_services=False)
    node.create_subscription(String, "/rosgrade_doctor", lambda _: None, 10)
    print("listening", flush=True)
    sys.stdin.read()
    rclpy.shutdown()
    return 0


def _publish() -> int:
    import rclpy
    from std_msgs.msg import String

    rclpy.init()
    began_s = time.monotonic()
    node = rclpy.create_node("rosgrade_doctor_talker", start_parameter_services=False)
    publisher = node.create_publisher(String, "/rosgrade_doctor", 10)
    while not publisher.get_subscription_count():
        if time.monotonic() - began_s > _LIMIT_S:
            return 1
        rclpy.spin_once(node, timeout_sec=0.005)
    print(time.monotonic() - began_s)
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(_listen() if sys.argv[1] == "listen" else _publish())
