"""The process that replays: ``python -m grader.run.replay_player FOLDER``.

It publishes what the node was given, at the times of the recording, and prints what the node
does. It ends when everything was given, when the node has ended, or when its standard input
does.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from grader.recording.mcap_reader import read_inputs, read_recording
from grader.recording.mcap_writer import RawMessage
from grader.recording.model import NS
from grader.run.cell.domain import lock_domain
from grader.run.cell.probe import import_interface, qos_profile
from grader.run.cell.type_support import add_type_support
from grader.run.process.descendants import become_subreaper, kill_descendants
from grader.run.replay import ORDER_FILE, ReplayOrder
from grader.run.stimuli.filling import plain
from grader.safe_text import clean, one_line

NAME = "rosgrade_replay"
_TICK_S = 0.01
_DEPTH = 1000
_MOST_SHOWN = 10
"""Messages of a topic within a second; a burst is worth reading, a stream is not."""
_TERMINATE_S = 2.0
# The observation may have ended with the very answer to the last input.
_AFTERMATH_S = 0.5


class Ended(Exception):
    """Nobody waits any more, or every process has ended; ``status`` is the exit code."""

    def __init__(self, status: int) -> None:
        """Keep the exit code."""
        super().__init__(status)
        self.status = status


class Printer:
    """Lines with the time since the recording's clock started; safe to use from threads."""

    def __init__(self) -> None:
        """Before the clock starts, lines have no time."""
        self._lock = threading.Lock()
        self._began_s: float | None = None

    def start(self) -> None:
        """Start the clock."""
        self._began_s = time.monotonic()

    @property
    def elapsed_s(self) -> float:
        """Time since the start, in seconds; 0 before."""
        return 0.0 if self._began_s is None else time.monotonic() - self._began_s

    def say(self, who: str, text: str) -> None:
        """Print a line."""
        at = "" if self._began_s is None else f"{self.elapsed_s:.3f} s"
        with self._lock:
            print(f"{at:>10}  {who}  {text}", flush=True)


@dataclass
class Heard:
    """What came on a topic, how much of it was shown, and when the last of that."""

    count: int = 0
    shown: int = 0
    shown_s: deque[float] = field(default_factory=lambda: deque(maxlen=_MOST_SHOWN))
    last: Any = None


class Player:
    """Gives the inputs and prints the rest."""

    def __init__(self, order: ReplayOrder, domain_id: int) -> None:
        """Join the graph."""
        self._order = order
        self._domain_id = domain_id
        self._printer = Printer()
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id)
        self._node = Node(
            NAME,
            context=self._context,
            start_parameter_services=False,
            enable_rosout=False,
            use_global_arguments=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._heard: dict[str, Heard] = {}
        self._processes: list[subprocess.Popen[bytes]] = []
        self._publishers = {
            one.topic: self._node.create_publisher(
                import_interface(one.type),
                one.topic,
                qos_profile(one.reliability, one.durability, _DEPTH),
            )
            for one in order.inputs
        }
        self._latched = {one.topic for one in order.inputs if one.durability == "transient_local"}
        for topic, interface in order.outputs.items():
            self._listen(topic, interface)

    def play(self, messages: tuple[RawMessage, ...]) -> int:
        """Launch, give everything, stop."""
        early = [m for m in messages if self._is_early(m)]
        for message in early:
            self._publishers[message.topic].publish(message.cdr)
        self._launch()
        try:
            self._await_listener()
            self._printer.start()
            for message in messages:
                if message not in early:
                    self._wait_until((message.stamp_ns - self._order.matched_ns) / NS)
                    self._publishers[message.topic].publish(message.cdr)
            self._wait_until(self._order.duration_s + _AFTERMATH_S)
            status = 0
        except Ended as end:
            status = end.status
        self._stop()
        for topic, heard in sorted(self._heard.items()):
            if heard.shown < heard.count:
                self._tell(topic, heard)
            self._printer.say("rosgrade", f"{heard.count} messages on {topic}")
        return status

    def _is_early(self, message: RawMessage) -> bool:
        """Published before the launch, for whoever comes late."""
        return message.topic in self._latched and message.stamp_ns < self._order.launched_ns

    def _listen(self, topic: str, interface: str) -> None:
        self._heard[topic] = Heard()
        try:
            kind = import_interface(interface)
        except ImportError:
            self._printer.say("rosgrade", f"{topic} is not shown: no {interface} here")
            return

        def show(message: Any) -> None:
            self._show(topic, message)

        # The weakest request, which every publisher meets.
        self._node.create_subscription(
            kind, topic, show, qos_profile("best_effort", "volatile", _DEPTH)
        )

    def _show(self, topic: str, message: Any) -> None:
        heard = self._heard[topic]
        heard.count += 1
        heard.last = message
        now = time.monotonic()
        if len(heard.shown_s) < _MOST_SHOWN or now - heard.shown_s[0] > 1.0:
            heard.shown_s.append(now)
            self._tell(topic, heard)

    def _tell(self, topic: str, heard: Heard) -> None:
        left_out = heard.count - heard.shown - 1
        more = f"   ({left_out} more before it)" if left_out else ""
        heard.shown = heard.count
        self._printer.say(topic, f"{_written(plain(heard.last))}{more}")

    def _launch(self) -> None:
        environment = {**self._order.environment, "ROS_DOMAIN_ID": str(self._domain_id)}
        for command in self._order.commands:
            self._printer.say("rosgrade", f"starting {command.name} on domain {self._domain_id}")
            process = subprocess.Popen(
                command.argv,
                cwd=self._order.scratch,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            self._processes.append(process)
            assert process.stdout is not None
            name = command.name.rpartition("/")[2]
            threading.Thread(target=self._pump, args=(name, process.stdout), daemon=True).start()

    def _pump(self, name: str, pipe: IO[bytes]) -> None:
        for line in pipe:
            self._printer.say(name, clean(line.decode(errors="replace").rstrip("\n")))

    def _await_listener(self) -> None:
        """Wait until the node listens to anything that is given.

        Raises:
            Ended: It does not within the discovery limit, or it has ended.
        """
        deadline = time.monotonic() + self._order.discovery_s
        while not any(p.get_subscription_count() for p in self._publishers.values()):
            if time.monotonic() > deadline:
                topics = ", ".join(self._publishers)
                self._printer.say(
                    "rosgrade",
                    f"nothing subscribed to {topics} within {self._order.discovery_s:g} s",
                )
                raise Ended(1)
            self._tick()

    def _wait_until(self, time_s: float) -> None:
        """Handle what comes until a time of the recording's clock.

        Raises:
            Ended: Nobody waits any more, or the node has ended.
        """
        while (left_s := time_s - self._printer.elapsed_s) > 0:
            self._tick(min(left_s, _TICK_S))

    def _tick(self, limit_s: float = _TICK_S) -> None:
        self._executor.spin_once(timeout_sec=limit_s)
        readable, _, _ = select.select([0], [], [], 0)
        if readable and not os.read(0, 1):
            raise Ended(130)
        if all(process.poll() is not None for process in self._processes):
            codes = ", ".join(str(process.returncode) for process in self._processes)
            self._printer.say("rosgrade", f"the node has ended by itself (exit code {codes})")
            raise Ended(1)

    def _stop(self) -> None:
        """SIGINT, SIGTERM, SIGKILL, each with a bounded wait."""
        for number, limit_s in (
            (signal.SIGINT, self._order.shutdown_s),
            (signal.SIGTERM, _TERMINATE_S),
            (signal.SIGKILL, _TERMINATE_S),
        ):
            running = [process for process in self._processes if process.poll() is None]
            if not running:
                break
            for process in running:
                os.killpg(process.pid, number)
            deadline = time.monotonic() + limit_s
            for process in running:
                try:
                    process.wait(max(0.0, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    after = f"still runs {limit_s:g} s after {number.name}"
                    self._printer.say("rosgrade", after)
        kill_descendants(os.getpid())


def _written(value: Any) -> str:
    """A message in one line, as YAML writes it."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {_written(item)}" for name, item in value.items()) + "}"
    if isinstance(value, float):
        return f"{value:.6g}"
    return one_line(str(value))


def main(folder: Path) -> int:
    """Replay the order in a folder."""
    become_subreaper()
    # Ctrl-C reaches rosgrade, which tells us by the end of our standard input. Were it ignored
    # and not handled, the node would inherit that.
    signal.signal(signal.SIGINT, lambda _number, _frame: None)
    order = ReplayOrder.from_json((folder / ORDER_FILE).read_text(encoding="utf-8"))
    add_type_support(Path(prefix) for prefix in order.type_support)
    file = Path(order.recording)
    messages = read_inputs(file, read_recording(file))
    with lock_domain() as domain:
        return Player(order, domain.domain_id).play(messages)


if __name__ == "__main__":
    status = main(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(status)
