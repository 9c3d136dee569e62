"""executor.timer from outside: who publishes while no executor calls anything."""

from __future__ import annotations

import pytest

from grader.findings.finding import Finding, Status
from grader.grading.next_runs import MOST_ROUNDS
from tests.checks.builder import CHECKS
from tests.run.conftest import RunNode
from tests.run.nodes import HEADER

pytestmark = pytest.mark.ros

NODE = (
    HEADER
    + """
import json, os, threading, time
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor

class BotPublisher(Node):
    def __init__(self, begin):
        super().__init__("bot_publisher")
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 10)
        begin(self)

    def publish(self):
        self.publisher.publish(twist())

    def nothing(self):
        pass

def sleeping(publish):
    while rclpy.ok():
        publish()
        time.sleep(0.1)

def in_a_thread(publish):
    threading.Thread(target=sleeping, args=(publish,), daemon=True).start()

rclpy.init()
try:
%s
except (KeyboardInterrupt, ExternalShutdownException):
    pass
"""
)
SPIN = """
    node = BotPublisher(lambda node: {})
    rclpy.spin(node)
"""
TIMER = "node.create_timer(0.1, node.publish)"
DUMMY = "(node.create_timer(0.1, node.nothing), in_a_thread({}))"
FORGE = """
    def forge(node):
        fd = os.dup(int(os.environ["ROSGRADE_TRACER_FD"]))
        for kind, more in (("timer", {"period_s": 0.1, "callback": "publish"}),
                           ("published", {"topic": "/cmd_vel", "number": 1, "in_callback": True}),
                           ("paused", {})):
            line = {"kind": kind, "pid": os.getpid(), **more}
            os.write(fd, json.dumps(line).encode() + b"\\n")
        in_a_thread(node.publish)
    node = BotPublisher(forge)
    rclpy.spin(node)
"""
RIGHT = {
    "timer": SPIN.format(TIMER),
    "long_callbacks_side_by_side": """
    def begin(node):
        node.group = ReentrantCallbackGroup()
        node.create_timer(0.1, lambda: time.sleep(0.08) or node.publish(), node.group)
    node = BotPublisher(begin)
    executor = MultiThreadedExecutor(4)
    executor.add_node(node)
    executor.spin()
""",
    "loop_of_spin_once": """
    node = BotPublisher(lambda node: node.create_timer(0.1, node.publish))
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0)
        time.sleep(0.005)
""",
    "after_a_node_that_is_gone": """
    rclpy.create_node("helper").destroy_node()
    node = BotPublisher(lambda node: node.create_timer(0.1, node.publish))
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    while rclpy.ok():
        time.sleep(0.1)
""",
    "coroutine": """
    def begin(node):
        async def publish():
            await node.executor.create_task(node.publish)
        node.create_timer(0.1, publish)
    rclpy.spin(BotPublisher(begin))
""",
    "events_executor": """
    from rclpy.experimental.events_executor import EventsExecutor
    executor = EventsExecutor()
    executor.add_node(BotPublisher(lambda node: node.create_timer(0.1, node.publish)))
    executor.spin()
""",
    "timer_that_ends_the_program": """
    left = ["x"] * 4
    def publish(node):
        node.publish()
        left.pop()
        if not left:
            raise SystemExit
    rclpy.spin(BotPublisher(lambda node: node.create_timer(0.1, lambda: publish(node))))
""",
    "process_that_a_timer_commands": """
    if "HELPS" in os.environ:
        node = BotPublisher(lambda node: None)
        for _ in sys.stdin:
            node.publish()
    helper = subprocess.Popen(
        [sys.executable, *sys.argv], env={**os.environ, "HELPS": ""}, stdin=subprocess.PIPE)
    def ask():
        helper.stdin.write(b"now\\n")
        helper.stdin.flush()
    node = rclpy.create_node("other")
    node.create_timer(0.1, ask)
    rclpy.spin(node)
""",
    "timer_that_wakes_a_thread": """
    woken = threading.Event()
    def work(node):
        while woken.wait():
            woken.clear()
            node.publish()
    def begin(node):
        threading.Thread(target=work, args=(node,), daemon=True).start()
        node.create_timer(0.1, woken.set)
    rclpy.spin(BotPublisher(begin))
""",
}
WRONG = {
    "thread": SPIN.format(DUMMY.format("node.publish")),
    "method_of_the_class": SPIN.format(
        DUMMY.format("lambda: type(node.publisher).publish(node.publisher, twist())")
    ),
    "library_below_rclpy": SPIN.format(
        DUMMY.format("lambda: node.publisher.handle.publish(twist())")
    ),
    "code_in_the_name_of_rclpy": SPIN.format(
        DUMMY.format(
            'eval(compile("lambda: node.publish()", "/rclpy/executors.py", "eval"), '
            "dict(node=node))"
        )
    ),
    "forged_lines": FORGE,
    "loop_beside_spin_once": """
    node = BotPublisher(lambda node: node.create_timer(0.1, node.nothing))
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0)
        node.publish()
        time.sleep(0.1)
""",
    "process": """
    if "ALONE" in os.environ:
        node = BotPublisher(lambda node: None)
        sleeping(node.publish)
    subprocess.Popen([sys.executable, *sys.argv], env={**os.environ, "ALONE": ""})
    node = rclpy.create_node("other")
    node.create_timer(0.1, lambda: None)
    rclpy.spin(node)
""",
}


def judged(run_node: RunNode, main: str) -> Finding:
    """executor.timer of a node, in a run that is repeated as a grade repeats it."""
    check = CHECKS["executor.timer"]
    for _ in range(MOST_ROUNDS):
        recording = run_node(NODE % main, pauses=True, until={"messages": 6})
        finding = check.judge(recording, check.parameters.model_validate({"topic": "/cmd_vel"}))
        assert recording.pauses, recording.ending
        if not finding.disturbed:
            break
    return finding


@pytest.mark.parametrize("style", RIGHT)
def test_a_timer_that_publishes_is_right_in_any_style(style: str, run_node: RunNode) -> None:
    finding = judged(run_node, RIGHT[style])
    assert finding.status is Status.PASSED, finding


@pytest.mark.parametrize("trick", WRONG)
def test_what_publishes_beside_a_timer_shows_from_outside(trick: str, run_node: RunNode) -> None:
    finding = judged(run_node, WRONG[trick])
    assert finding.status is Status.FAILED, finding
    assert (
        "published outside of every callback, while rosgrade let the executor call nothing"
        in finding.observed
    )


def test_a_loop_that_ends_by_itself_earns_nothing(run_node: RunNode) -> None:
    loop = """
    node = BotPublisher(lambda node: node.create_timer(1.0, lambda: None))
    for _ in range(4):
        node.publish()
        time.sleep(0.1)
    rclpy.shutdown()
"""
    finding = judged(run_node, loop)
    assert finding.status is Status.FAILED and "never called" in finding.observed, finding
