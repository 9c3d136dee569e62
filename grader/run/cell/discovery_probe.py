"""Two real nodes, each with a participant of its own: how long they take to discover each other."""

from __future__ import annotations

import subprocess
import sys
import time

from grader.errors import GraderFault
from grader.machine.ros import RosInstallation
from grader.run.cell.domain import lock_domain
from grader.run.environment import cell_environment

_LIMIT_S = 15.0


def discovery_time_s(ros: RosInstallation) -> float:
    """Seconds from the creation of a publisher to its match with a subscription."""
    with lock_domain() as domain:
        done = subprocess.run(
            [str(ros.python), "-m", __name__],
            cwd="/",
            env={**cell_environment(ros), "ROS_DOMAIN_ID": str(domain.domain_id)},
            capture_output=True,
            text=True,
            timeout=4 * _LIMIT_S,
            check=False,
        )
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["the nodes did not find each other"]
        raise GraderFault(lines[-1])
    return float(done.stdout)


def main() -> int:
    """Make both nodes, each with a participant of its own."""
    import rclpy
    from rclpy.context import Context
    from std_msgs.msg import String

    listener, talker = Context(), Context()
    for context in (listener, talker):
        rclpy.init(context=context)
    first = rclpy.create_node("rosgrade_doctor_listener", context=listener)
    first.create_subscription(String, "/rosgrade_doctor", lambda _: None, 10)
    began_s = time.monotonic()
    second = rclpy.create_node("rosgrade_doctor_talker", context=talker)
    publisher = second.create_publisher(String, "/rosgrade_doctor", 10)
    while not publisher.get_subscription_count():
        if time.monotonic() - began_s > _LIMIT_S:
            return 1
        time.sleep(0.005)
    print(time.monotonic() - began_s)
    for context in (listener, talker):
        rclpy.shutdown(context=context)
    return 0


if __name__ == "__main__":
    sys.exit(main())
