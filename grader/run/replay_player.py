"""The process that replays: ``python -m grader.run.replay_player FOLDER``.

It publishes what the node was given, at the times of the recording, and prints what the node
does. It ends when everything was given, when the node has ended, or when its standard input
does.
"""

from __future__ import annotations

import os
import pickle
import select
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from grader.recording.mcap_reader import read_inputs, read_recording
from grader.recording.mcap_writer import RawMessage
from grader.recording.model import NS, LogLine
from grader.run.cell.domain import lock_domain
from grader.run.cell.probe import import_interface, qos_profile
from grader.run.cell.type_support import add_type_support
from grader.run.host.disturbance import DisturbanceMeter
from grader.run.order import RunLimits
from grader.run.process.descendants import become_subreaper
from grader.run.process.output import OutputReader
from grader.run.process.student import StudentProcesses
from grader.run.replay import ORDER_FILE, ReplayOrder
from grader.run.stimuli.filling import plain
from grader.safe_text import clean, one_line

NAME = "rosgrade_replay"
_TICK_S = 0.01
_DEPTH = 1000
_MOST_SHOWN = 10
"""Messages of a topic within a second; a burst is worth reading, a stream is not."""
_KEPT_BYTES = 4096
_PIPES_LIMIT_S = 5.0
# The observation may have ended with the very answer to the last input.
_AFTERMATH_S = 0.5


class Ended(Exception):
    """The replay is interrupted, or every process has ended; its argument is the exit code."""


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
        self._order = order
        self._domain_id = domain_id
        self._printing = threading.Lock()
        self._began_s: float | None = None
        self._output = OutputReader(_KEPT_BYTES, self._say_line)
        self._students = StudentProcesses(self._output)
        context = Context()
        rclpy.init(args=[], context=context, domain_id=domain_id)
        self._node = Node(
            NAME,
            context=context,
            start_parameter_services=False,
            enable_rosout=False,
            use_global_arguments=False,
        )
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._heard: dict[str, Heard] = {}
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
        # Published before the launch, for a subscription that comes later.
        early = [
            message
            for message in messages
            if message.topic in self._latched and message.stamp_ns < self._order.launched_ns
        ]
        for message in early:
            self._publishers[message.topic].publish(message.cdr)
        status = 0
        try:
            self._launch()
            self._await_listener()
            self._began_s = time.monotonic()
            for message in messages:
                if message not in early:
                    self._wait_until((message.stamp_ns - self._order.matched_ns) / NS)
                    self._publishers[message.topic].publish(message.cdr)
            self._wait_until(self._order.duration_s + _AFTERMATH_S)
        except Ended as end:
            status = end.args[0]
        limits = RunLimits(self._order.discovery_s, 0.0, self._order.shutdown_s)
        self._students.stop(limits, DisturbanceMeter(tuple))
        self._students.clean_up()
        self._output.close(_PIPES_LIMIT_S)
        for process in self._students.records():
            if process.stopped_by in ("SIGTERM", "SIGKILL"):
                self._say("rosgrade", f"{process.name} ended only after {process.stopped_by}")
        for topic, heard in sorted(self._heard.items()):
            if heard.shown < heard.count:
                self._show(topic, heard)
            self._say("rosgrade", f"{heard.count} messages on {topic}")
        return status

    @property
    def _elapsed_s(self) -> float:
        return 0.0 if self._began_s is None else time.monotonic() - self._began_s

    def _say(self, source: str, text: str) -> None:
        """Print a line, with the time of the recording's clock once that runs."""
        at = "" if self._began_s is None else f"{self._elapsed_s:.3f} s"
        with self._printing:
            print(f"{at:>10}  {source}  {text}", flush=True)

    def _say_line(self, line: LogLine) -> None:
        self._say(line.process.rpartition("/")[2], clean(line.text))

    def _listen(self, topic: str, interface: str) -> None:
        heard = self._heard[topic] = Heard()
        try:
            kind = import_interface(interface)
        except ImportError:
            self._say("rosgrade", f"{topic} is not shown: no {interface} here")
            return

        def take(message: Any) -> None:
            heard.count += 1
            heard.last = message
            now = time.monotonic()
            if len(heard.shown_s) < _MOST_SHOWN or now - heard.shown_s[0] > 1.0:
                heard.shown_s.append(now)
                self._show(topic, heard)

        # The weakest request, which every publisher meets.
        profile = qos_profile("best_effort", "volatile", _DEPTH)
        self._node.create_subscription(kind, topic, take, profile)

    def _show(self, topic: str, heard: Heard) -> None:
        left_out = heard.count - heard.shown - 1
        more = f"   ({left_out} more before it)" if left_out else ""
        heard.shown = heard.count
        self._say(topic, f"{_written(plain(heard.last))}{more}")

    def _launch(self) -> None:
        order = self._order
        of_run = {"ROS_DOMAIN_ID": str(self._domain_id)}
        for command in order.commands:
            self._say("rosgrade", f"starting {command.name} on domain {self._domain_id}")
            scratch = Path(order.scratch)
            self._students.launch(command.name, command.argv, order.environment, of_run, scratch)
        # A process that ends need not wait until the graph was seen.
        self._students.let_exit()

    def _await_listener(self) -> None:
        deadline = time.monotonic() + self._order.discovery_s
        while not any(p.get_subscription_count() for p in self._publishers.values()):
            if time.monotonic() > deadline:
                topics = ", ".join(self._publishers)
                within = f"within {self._order.discovery_s:g} s"
                self._say("rosgrade", f"nothing subscribed to {topics} {within}")
                raise Ended(1)
            self._tick(_TICK_S)

    def _wait_until(self, time_s: float) -> None:
        while (left_s := time_s - self._elapsed_s) > 0:
            self._tick(min(left_s, _TICK_S))

    def _tick(self, limit_s: float) -> None:
        self._executor.spin_once(timeout_sec=limit_s)
        readable, _, _ = select.select([0], [], [], 0)
        if readable and not os.read(0, 1):
            raise Ended(130)
        if not self._students.poll():
            codes = ", ".join(str(process.exit_code) for process in self._students.records())
            self._say("rosgrade", f"the node has ended by itself (exit code {codes})")
            raise Ended(1)


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
    order: ReplayOrder = pickle.loads((folder / ORDER_FILE).read_bytes())
    add_type_support(Path(prefix) for prefix in order.type_support)
    file = Path(order.recording)
    messages = read_inputs(file, read_recording(file))
    with lock_domain() as domain:
        return Player(order, domain.domain_id).play(messages)


if __name__ == "__main__":
    status = main(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(status)
