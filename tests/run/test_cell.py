"""What a cell observes of real student nodes, and that nothing of them is left behind."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest

from grader.checks.doubt import is_doubtful
from grader.errors import GraderFault
from grader.findings.finding import Status
from grader.machine import ros
from grader.measure import declarations
from grader.recording.model import NS, Ending, Kind, Owner, Recording
from grader.run.environment import cell_environment
from tests.checks.builder import judge
from tests.run import nodes
from tests.run.conftest import EXECUTABLE, RunNode, running

pytestmark = pytest.mark.ros


def is_alive(pid: int) -> bool:
    """Whether a process runs."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return stat[stat.rindex(")") + 2] not in "ZX"


def values(recording: Recording) -> list[float]:
    """linear.x of all messages on /cmd_vel."""
    return [message.value["linear"]["x"] for message in recording.on("/cmd_vel")]


HEARS_ITSELF = nodes.ONE_SHOT.replace(
    "        self.publisher =",
    '        self.create_subscription(Twist, "cmd_vel", print, 10)\n        self.publisher =',
)


@pytest.mark.parametrize(
    ("source", "quiet", "ending"),
    [
        pytest.param(nodes.ONE_SHOT, "300 ms", Ending.UNTIL, id="in the constructor"),
        pytest.param(HEARS_ITSELF, "300 ms", Ending.UNTIL, id="and heard by the program"),
        pytest.param(nodes.ONE_SHOT_THEN_EXIT, "2 s", Ending.EXITED, id="before it ends"),
    ],
)
def test_a_message_that_is_published_once_is_received(
    run_node: RunNode, source: str, quiet: str, ending: Ending
) -> None:
    for _ in range(5):
        recording = run_node(source, until={"quiet": quiet})
        assert values(recording) == [1.0]
        assert recording.ending is ending


def test_a_timer_is_recorded_with_its_source_timestamps(run_node: RunNode) -> None:
    recording = run_node(
        nodes.timed(period_s=0.1),
        until={"messages": 11},
        stimuli=[{"call": "list_parameters", "every": "200 ms"}],
    )
    stamps = [message.stamp_ns for message in recording.on("/cmd_vel")]
    periods = sorted((b - a) / NS for a, b in itertools.pairwise(stamps))
    assert recording.ending is Ending.UNTIL
    assert periods[len(periods) // 2] == pytest.approx(0.1, abs=0.02)
    assert recording.calls and all(call.answered_ns for call in recording.calls[:-1])
    (publisher,) = recording.declared("publisher")
    assert (publisher.data["topic"], publisher.data["depth"]) == ("/cmd_vel", 10)
    (timer,) = recording.declared("timer")
    assert timer.data["period_s"] == pytest.approx(0.1)
    assert recording.processes[0].stopped_by == "SIGINT"
    assert [node.name for node in recording.student_nodes] == ["/bot_publisher"]


@pytest.mark.parametrize("spin", ["executor.spin()", "rclpy.spin(node, executor)"])
def test_an_events_executor_calls_back(run_node: RunNode, spin: str) -> None:
    executor = (
        "from rclpy.experimental.events_executor import EventsExecutor\n"
        "executor = EventsExecutor()\n"
        "executor.add_node(node)\n"
    )
    source = nodes.timed(period_s=0.1, before_spin=executor)
    recording = run_node(source.replace("rclpy.spin(node)\n", f"{spin}\n"), until={"messages": 5})
    assert len(recording.on("/cmd_vel")) >= 5
    assert [item.data["executor"] for item in recording.declared("spin")] == ["EventsExecutor"]
    assert recording.processes[0].stopped_by == "SIGINT"


_CALLBACKS = """
class Worker(Node):
    def __init__(self):
        super().__init__("worker")
        groups = {groups}
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_timer(0.2, self.work, callback_group=groups[0])
        self.create_timer(0.001, lambda: None)
        self.create_subscription(Twist, "cmd_vel", self.heard, 10, callback_group=groups[1])

    def work(self):
        self.publisher.publish(twist())
        time.sleep(0.1)

    async def heard(self, message):
        self.get_logger().info("heard: start")
        time.sleep(0.05)
        print("heard: end", flush=True)

rclpy.init()
node = Worker()
executor = MultiThreadedExecutor()
{spin}
"""


@pytest.mark.parametrize("parallel", [True, False])
def test_when_callbacks_run_and_in_which_groups(run_node: RunNode, parallel: bool) -> None:
    imports = (
        "from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup\n"
        "from rclpy.executors import MultiThreadedExecutor\n"
    )
    groups = "[ReentrantCallbackGroup(), MutuallyExclusiveCallbackGroup()]"
    source = imports + nodes.HEADER + _CALLBACKS.format(
        groups=groups if parallel else "[None, None]",
        spin="rclpy.spin(node, executor)" if parallel else "rclpy.spin(node)",
    )  # fmt: skip
    recording = run_node(source, until={"messages": 6})
    named = ("/cmd_vel", "work")
    kind, other = "MultiThreadedExecutor", "SingleThreadedExecutor"
    found = {
        "overlap": judge("executor.overlap", recording, callbacks=named),
        "never": judge("executor.overlap", recording, callbacks=("heard", "200 ms"), never=True),
        "itself": judge(
            "executor.overlap", recording, callbacks=["heard"], never=True, log=["start", "end"]
        ),
        "kind": judge(
            "executor.kind", recording, executor=kind, callbacks=named, groups="different"
        ),
        "single": judge("executor.kind", recording, executor=other, callbacks=named),
    }
    passed = {name for name, finding in found.items() if finding.status is Status.PASSED}
    assert passed == {"itself"} | ({"overlap", "kind"} if parallel else {"never", "single"}), found
    # A timer of 1 ms that does nothing floods nothing.
    assert len(recording.declared("ran")) < 100


def test_a_short_callback_is_seen_beside_a_long_one_in_every_run(run_node: RunNode) -> None:
    """The textbook's talker and slow timer, each in a group of its own."""
    source = (
        "from rclpy.callback_groups import MutuallyExclusiveCallbackGroup\n"
        "from rclpy.executors import MultiThreadedExecutor\n" + nodes.HEADER
    )
    source += """
class Talker(Node):
    def __init__(self):
        super().__init__("talker")
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 10)
        for period_s, callback in ((0.1, self.talk), (1.0, self.think)):
            self.create_timer(period_s, callback, MutuallyExclusiveCallbackGroup())

    def talk(self):
        self.publisher.publish(twist())

    def think(self):
        time.sleep(0.9)

rclpy.init()
executor = MultiThreadedExecutor(2)
executor.add_node(Talker())
executor.spin()
"""
    recording = run_node(source, until={"messages": 29})
    both = {"callbacks": ["talk", "think"], "at_least": 2}
    assert judge("executor.overlap", recording, **both).status is Status.PASSED
    assert judge("executor.overlap", recording, **both, never=True).status is Status.FAILED
    runs = [one.data["callback"] for one in recording.declared("ran")]
    assert runs.count("Talker.talk") > 15


def test_which_nodes_an_executor_was_given(run_node: RunNode) -> None:
    """Some before it spins, and one while it does."""
    executor = (
        "from rclpy.executors import SingleThreadedExecutor\n"
        "executor = SingleThreadedExecutor()\n"
        "first, second = rclpy.create_node('first'), rclpy.create_node('second')\n"
        "first.create_timer(0.05, lambda: executor.add_node(second))\n"
        "executor.add_node(first)\n"
        "executor.spin()\n"
    )
    source = nodes.timed().replace("rclpy.spin(node)\n", executor)
    recording = run_node(source, until={"elapsed": "1 s"})
    assert not recording.on("/cmd_vel")
    given = {
        name: not declarations.in_no_executor(recording, name)
        for name in ("/bot_publisher", "/first", "/second")
    }
    assert given == {"/bot_publisher": False, "/first": True, "/second": True}


@pytest.mark.parametrize("spins", [True, False])
def test_a_node_without_parameter_services_is_asked_for_something_else(
    run_node: RunNode, spins: bool
) -> None:
    source = (nodes.timed() if spins else nodes.BLOCKED).replace(
        '"bot_publisher")', '"bot_publisher", start_parameter_services=False)'
    )
    recording = run_node(
        source,
        until={"elapsed": "3 s"},
        stimuli=[{"call": "list_parameters", "every": "100 ms"}],
    )
    asked = [call for call in recording.calls if call.requested_ns < recording.stop_ns - 10**9]
    assert {call.service for call in asked} == {"/bot_publisher/get_type_description"}
    assert {call.answered_ns is not None for call in asked} == {spins}


def test_messages_after_sigint_are_not_recorded(run_node: RunNode) -> None:
    source = nodes.timed().replace(
        "rclpy.spin(node)\n",
        "try:\n    rclpy.spin(node)\nexcept KeyboardInterrupt:\n"
        "    node.publisher.publish(twist(99.0))\n",
    )
    recording = run_node(source)
    assert set(values(recording)) == {1.0}


def test_a_blocked_executor_does_not_answer(run_node: RunNode) -> None:
    recording = run_node(
        nodes.BLOCKED,
        until={"messages": 20},
        stimuli=[{"call": "list_parameters", "every": "100 ms"}],
    )
    assert len(recording.on("/cmd_vel")) >= 20
    assert recording.calls and recording.calls[0].answered_ns is None
    assert not recording.declared("spin")
    # The program tells where it stands.
    stands = recording.declared("stands")[-1].data
    assert (stands["function"], stands["loop_text"]) == ("__init__", "while True:")
    assert not stands["in_callback"]


def test_a_publisher_that_does_not_match_the_probe_is_recorded_all_the_same(
    run_node: RunNode,
) -> None:
    qos = "QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)"
    recording = run_node(nodes.timed(qos=qos))
    (publisher,) = recording.student_endpoints(Kind.PUBLISHER, "/cmd_vel")
    assert publisher.qos.reliability == "best_effort"
    sequences = [message.sequence for message in recording.on("/cmd_vel")]
    assert len(sequences) >= 3 and len(set(sequences)) == len(sequences)


def test_a_publisher_of_another_type_is_seen_but_not_recorded(run_node: RunNode) -> None:
    recording = run_node(nodes.timed(interface="Vector3"))
    assert recording.ending is Ending.NO_MATCH
    (publisher,) = recording.student_endpoints(Kind.PUBLISHER, "/cmd_vel")
    assert publisher.type == "geometry_msgs/msg/Vector3"
    assert not recording.on("/cmd_vel")


def test_code_that_hangs_at_import_ends_after_the_discovery_limit(run_node: RunNode) -> None:
    recording = run_node(nodes.HANGS_AT_IMPORT, discovery="2 s")
    assert recording.ending is Ending.NO_NODE
    assert not recording.student_nodes
    assert not is_alive(recording.processes[0].pid)


def test_a_segfault_is_recorded_with_its_signal(run_node: RunNode) -> None:
    recording = run_node(nodes.SEGFAULT)
    assert recording.ending is Ending.EXITED
    assert (recording.processes[0].exit_code, recording.processes[0].stopped_by) == (-11, "itself")
    assert recording.declared("started") and not recording.declared("exiting")


def test_an_exception_is_recorded_with_its_traceback(run_node: RunNode) -> None:
    recording = run_node(nodes.RAISES)
    errors = [line.text for line in recording.log if line.stream == "stderr"]
    assert errors[0] == "Traceback (most recent call last):"
    assert errors[-1] == "RuntimeError: no robot here"
    assert recording.declared("exiting")
    assert recording.processes[0].exit_code == 1


def test_an_executable_that_does_not_exist_is_recorded(run_node: RunNode) -> None:
    recording = run_node(nodes.ONE_SHOT, launch=[{"executable": "bot_pubb"}])
    assert recording.ending is Ending.NOT_STARTED
    assert not recording.faults


@pytest.mark.slow
def test_a_gigabyte_of_output_is_drained_and_bounded(run_node: RunNode) -> None:
    recording = run_node(nodes.FLOOD, discovery="60 s", timeout="60 s")
    kept = sum(len(line.text) for line in recording.log)
    assert recording.processes[0].exit_code == 0
    assert kept < 2**20
    assert recording.processes[0].dropped_bytes + kept > 2**30 - 2**20


def test_a_grader_in_the_background_interrupts_as_a_terminal_does(run_node: RunNode) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        recording = run_node(
            nodes.timed(before_spin="rclpy.shutdown()\nwhile True: time.sleep(0.1)"),
            until={"elapsed": "1 s"},
        )
    finally:
        signal.signal(signal.SIGINT, before)
    assert recording.processes[0].stopped_by == "SIGINT"


@pytest.mark.parametrize(
    ("ignored", "needed"),
    [("signal.SIGINT", "SIGTERM"), ("signal.SIGINT, signal.SIGTERM", "SIGKILL")],
)
def test_a_node_that_ignores_signals_is_stopped_in_steps(
    run_node: RunNode, ignored: str, needed: str
) -> None:
    own_segments = (
        "import glob\nfor fd in glob.glob('/proc/self/fd/*'):\n"
        "    path = os.path.realpath(fd)\n"
        "    if '/dev/shm/fastrtps_' in path and 'port' not in path:\n"
        "        print('segment', path)\n"
    )
    handler = (
        own_segments
        + "for number in ("
        + ignored
        + ",):\n    signal.signal(number, signal.SIG_IGN)\n"
        "while True:\n    rclpy.spin_once(node, timeout_sec=0.1)\n"
    )
    recording = run_node(
        nodes.timed(before_spin=handler), shutdown="500 ms", until={"elapsed": "1 s"}
    )
    assert recording.processes[0].stopped_by == needed
    assert not is_alive(recording.processes[0].pid)
    held = [line.text.split()[1] for line in recording.log if line.text.startswith("segment ")]
    assert held
    assert not [path for path in held if Path(path).exists()]


def test_a_child_that_leaves_the_session_is_killed_and_named(run_node: RunNode) -> None:
    marker = f"time.sleep(86399)  # {uuid4()}"
    spawn = (
        f"subprocess.Popen([sys.executable, '-c', 'import time; {marker}'], start_new_session=True)"
    )
    recording = run_node(nodes.timed(before_spin=spawn))
    assert any(marker in command for command in recording.processes[0].survivors)
    assert not running(marker)


def test_a_foreign_node_ends_the_run_as_our_fault_by_name(run_node: RunNode) -> None:
    foreign: list[subprocess.Popen[bytes]] = []
    source = "import rclpy\nrclpy.init()\nrclpy.spin(rclpy.create_node('neighbour'))\n"

    def join(_scenario: str, event: object) -> None:
        assert isinstance(event, dict)
        if event["event"] == "domain":
            environment = {**cell_environment(ros.find()), "ROS_DOMAIN_ID": str(event["id"])}
            foreign.append(subprocess.Popen([sys.executable, "-c", source], env=environment))

    try:
        recording = run_node(
            nodes.timed(), progress=join, until={"elapsed": "15 s"}, timeout="15 s"
        )
    finally:
        for process in foreign:
            process.kill()
            process.wait()
    assert recording.ending is Ending.FAULT
    assert "/neighbour belongs neither to rosgrade nor to the submission" in recording.faults[0]
    assert {n.name for n in recording.nodes if n.owner is Owner.FOREIGN} == {"/neighbour"}


def test_a_second_process_of_the_student_is_not_foreign(run_node: RunNode) -> None:
    second = (
        "child = subprocess.Popen([sys.executable, '-c', 'import rclpy; rclpy.init();"
        ' rclpy.spin(rclpy.create_node("second"))\'])'
    )
    recording = run_node(nodes.timed(before_spin=second), until={"elapsed": "2 s"}, timeout="8 s")
    assert not recording.faults
    assert {n.name for n in recording.student_nodes} == {"/bot_publisher", "/second"}


def one_run(*arguments: str) -> subprocess.Popen[str]:
    """A run in a process of its own."""
    return subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("one_run.py")), *arguments],
        env={**cell_environment(ros.find()), "PYTHONPATH": str(Path.cwd())},
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_five_at_once_never_hear_each_other(tmp_path: Path) -> None:
    processes = [one_run(str(tmp_path / str(n)), f"{n}.0") for n in range(1, 6)]
    heard = [process.communicate()[0].split() for process in processes]
    assert heard == [[f"{number}.0"] for number in range(1, 6)]


def test_nothing_survives_the_end_of_the_process_that_ordered_the_run(tmp_path: Path) -> None:
    marker = str(tmp_path / "1")
    process = one_run(marker, "1.0", "forever")
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "recording"
    assert running(marker)
    process.kill()
    process.communicate()
    deadline = time.monotonic() + 20.0
    while running(marker):
        assert time.monotonic() < deadline, "the student's process is still there"
        time.sleep(0.05)


def test_a_node_that_ends_at_once_is_seen_every_time(run_node: RunNode) -> None:
    for _ in range(5):
        recording = run_node(nodes.timed().replace("rclpy.spin(node)\n", ""))
        assert [node.name for node in recording.student_nodes] == ["/bot_publisher"]
        assert recording.student_endpoints(Kind.PUBLISHER, "/cmd_vel")
        assert recording.ending is Ending.EXITED


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_what_a_signal_from_outside_does_to_a_node_is_recorded_at_once(
    run_node: RunNode, tmp_path: Path, number: signal.Signals
) -> None:
    sent = []

    def progress(_scenario: str, event: Mapping[str, Any]) -> None:
        if event["event"] == "recording" and not sent:
            sent.extend(running(f"{tmp_path}/0/install"))
            for pid in sent:
                os.kill(pid, number)

    recording = run_node(
        nodes.timed(), progress, until={"elapsed": "60 s"}, timeout="60 s", discovery="30 s"
    )
    (process,) = recording.processes
    assert (recording.ending, process.exit_code) == (Ending.EXITED, -number)
    finding = judge("node.alive", recording)
    assert finding.status is Status.FAILED
    assert number.name in finding.observed
    assert is_doubtful(recording, None)


def test_a_cell_that_is_stopped_is_a_fault_of_the_machine_within_bounds(
    run_node: RunNode, tmp_path: Path
) -> None:
    def progress(_scenario: str, event: Mapping[str, Any]) -> None:
        if event["event"] == "recording":
            for pid in running(f"{tmp_path}/0/install"):
                os.kill(int(Path(f"/proc/{pid}/stat").read_text().split()[3]), signal.SIGSTOP)

    began_s = time.monotonic()
    with pytest.raises(GraderFault, match="killed, or stopped by a signal such as SIGSTOP"):
        run_node(nodes.timed(), progress, until={"elapsed": "300 s"}, timeout="300 s")
    assert time.monotonic() - began_s < 120.0
    second = run_node(nodes.timed())
    assert second.ending is Ending.UNTIL, second.faults


def test_a_launch_with_after_starts_later_and_the_run_waits_for_it(run_node: RunNode) -> None:
    later = {"executable": EXECUTABLE, "name": "second", "after": "1.5 s"}
    source = nodes.timed()
    recording = run_node(source, launch=[{"executable": EXECUTABLE}, later], until={"messages": 1})
    first, second = recording.processes
    assert second.started_ns - first.started_ns > 1.4 * NS
