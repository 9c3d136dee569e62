"""A cell: one run of one scenario, in a process of its own."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.recording.event import Breach, Pause, Wait
from grader.recording.model import NS, Ending, Endpoint, Kind, Owner, Recording
from grader.recording.submission import SubmissionRecord
from grader.run.cell.companions import Companions
from grader.run.cell.domain import joined_domains
from grader.run.cell.ending import EndingConditions, ExitBarrier
from grader.run.cell.graph import GraphObserver
from grader.run.cell.prefork_protocol import readable
from grader.run.cell.probe import Probe
from grader.run.cell.progress_events import LineTeller, tell
from grader.run.cell.simulated import Simulated, simulated_by_us
from grader.run.host.disturbance import DisturbanceMeter
from grader.run.host.machine_faults import MachineFaults
from grader.run.host.run_delay import is_blocked
from grader.run.host.stopwatch import Stopwatch
from grader.run.host.watchdog import Watchdog
from grader.run.order import CellOrder, ProcessCommand
from grader.run.process.descendants import Family
from grader.run.process.launched import launched
from grader.run.process.output import OutputReader
from grader.run.process.student import StudentProcesses
from grader.run.stimuli.context import StimulusContext
from grader.run.stimuli.player import Player
from grader.sandbox.packet_monitor import PacketMonitor, bound_ports
from grader.spec.unit import format_duration

if TYPE_CHECKING:
    from grader.run.cell.author_simulator import AuthorSimulator

_TICK_S = 0.05
_CALM_TICK_S = 0.1
_GRAPH_PERIOD_S = 0.1
# After the first match no wait depends on new endpoints, so the graph is read less often.
_SETTLED_GRAPH_PERIOD_S = 0.25
_PIPES_LIMIT_S = 5.0
_PAUSED_INTERVALS = 2.5
_LEAST_PAUSE_S, _MOST_PAUSE_S = 0.4, 6.0
_UNTIL_PAUSED_S = 3.0
_MOST_SANDBOX_S = 120.0
"""A machine whose kernel threads got no CPU was seen to take 13 s for a sandbox."""
_MOST_MALFORMED = 10
"""Packets; no library sends a single one."""
_FORGERY = "wrote into the channel through which rosgrade reports from inside a process"
_NAMES = "made a node or a topic with a name that ROS does not allow, without rclpy's checks"
_GARBAGE = "sent garbage to the UDP ports of the node that watches the run"


class Abandoned(Exception):
    """The runner that ordered the run is gone."""


class Cell:
    """Runs one scenario from launch to recording."""

    def __init__(
        self,
        order: CellOrder,
        domain_id: int,
        probe: Probe,
        packets: PacketMonitor | None = None,
    ) -> None:
        self._order = order
        self._domain_id = domain_id
        self._probe = probe
        self._packets = packets
        # Ports of the probe's own participant: no other is here yet.
        self._ports = bound_ports() if packets is not None else frozenset()
        on_line = LineTeller() if order.tells_output else None
        self._output = OutputReader(order.limits.output_bytes, on_line)
        self._has_node = False
        # Later a program could pretend to wait, as the parent of a vfork(2) does.
        self._meter = DisturbanceMeter(
            Family(os.getpid()).look,
            is_blocked=lambda pid: not self._has_node and is_blocked(pid),
        )
        self._students = StudentProcesses(self._output, self._meter, order.process_sandbox)
        self._other_domains: tuple[int, ...] = ()
        self._graph = GraphObserver(
            probe.node,
            self._own_pids,
            self._students.refresh,
            private=order.process_sandbox is not None,
        )
        self._watchdog: Watchdog | None = None
        if order.process_sandbox is not None:
            self._watchdog = Watchdog(
                order.process_sandbox.limits,
                lambda: self._students.inits,
                lambda: self._output.written_bytes,
                self._violations,
            )
        self._exit_barrier = ExitBarrier(self._output, self._graph, self._students)
        self._waits: list[Wait] = []
        self._simulated = Simulated()
        author_simulator: AuthorSimulator | None = None
        if order.simulator is not None:
            self._simulated = simulated_by_us(probe.node, order.simulator)
        elif order.author_simulator is not None:
            from grader.run.cell.author_simulator import AuthorSimulator

            author_simulator = AuthorSimulator(probe, self._graph, order.author_simulator)
            self._simulated = author_simulator
        self._companions: Companions | None = None
        if order.companions:
            self._companions = Companions(order, self._meter, self._graph, author_simulator)
        self._faults: list[str] = []
        self._context = StimulusContext(
            probe,
            self._graph,
            self._students,
            self._meter,
            order.limits,
            self._start_again,
            self._waits,
            self._faults,
            self._simulated.driven,
        )
        self._player = Player(order.stimuli, self._context)
        self._ending = EndingConditions(probe, self._output, self._simulated.moving, self._player)
        self._later: list[ProcessCommand] = []
        self._next_graph = 0.0
        self._launched_ns = self._stop_ns = 0
        self._pauses: tuple[Pause, ...] = ()
        self._matched_ns: int | None = None

    def run(self) -> Recording:
        """Launch, observe, stop."""
        self._meter.start()
        if self._watchdog is not None:
            self._watchdog.start()
        machine_faults = MachineFaults()
        self._launched_ns = time.time_ns()
        try:
            ending = self._start_companions() or self._observe()
            self._stop()
        finally:
            breaches = self._clean_up()
        recording = self._recording(ending, breaches)
        ended = machine_faults.out_of_memory(recording.processes, breaches)
        ended = ended or self._students.ended_from_outside(breaches)
        self._faults += filter(None, (machine_faults.clock_was_set(), ended))
        return replace(recording, faults=tuple(dict.fromkeys(self._faults)))

    def _stop(self) -> None:
        """End the observation, and then the programs."""
        self._probe.recording = False
        self._stop_ns = time.time_ns()
        self._player.finish()
        # With its last command a robot would drive on while nothing steers it.
        self._simulated.stop()
        if self._order.pauses:
            self._pauses = self._pause()
        tell("stopping")
        self._students.stop(self._order.limits)
        if self._companions is not None:
            self._faults += self._companions.stop()

    def _clean_up(self) -> tuple[Breach, ...]:
        """Leave nothing of the programs behind; returns which limits they passed."""
        self._students.clean_up()
        if self._companions is not None:
            self._companions.clean_up()
        self._faults += self._students.faults()
        return self._watchdog.stop() if self._watchdog is not None else ()

    def _recording(self, ending: Ending, breaches: tuple[Breach, ...]) -> Recording:
        printed = self._output.close(_PIPES_LIMIT_S)
        processes, log, declarations = launched(
            {command.name for command in self._order.commands if command.is_launch_file},
            self._stop_ns,
            self._students.records(),
            sorted((*printed, *self._probe.logs), key=lambda line: line.time_ns),
            self._output.declarations,
        )
        executor_calls = self._probe.executor_calls.calls
        calls = [call for call in executor_calls if call.requested_ns <= self._stop_ns]
        calls += self._context.calls.calls
        environment = {**self._order.environment, "domain_id": str(self._domain_id)}
        if self._other_domains:
            environment["other_domains"] = ", ".join(map(str, self._other_domains))
        return Recording(
            scenario=self._order.scenario,
            seed=self._order.seed,
            ending=ending,
            launched_ns=self._launched_ns,
            matched_ns=self._matched_ns,
            stop_ns=self._stop_ns,
            end_ns=time.time_ns(),
            submission=SubmissionRecord(id="", sha256=""),
            nodes=self._graph.nodes,
            endpoints=tuple(map(self._with_heartbeats, self._graph.endpoints)),
            processes=processes,
            log=log,
            declarations=declarations,
            calls=tuple(sorted(calls, key=lambda call: call.requested_ns)),
            services=self._graph.services,
            clients=self._graph.clients,
            asked=(*self._context.asked, *self._simulated.asked),
            goals=tuple(self._context.goals),
            waits=tuple(self._waits),
            joins=tuple(self._context.joins.values()),
            pauses=self._pauses,
            interventions=tuple(self._context.interventions),
            breaches=breaches,
            sent=dict.fromkeys(self._player.topics, ()),
            answers=self._player.answers,
            disturbance=self._meter.stop(),
            truth=tuple(self._simulated.truth),
            incidents=tuple(self._simulated.incidents),
            scenes=self._simulated.scenes,
            turtles=tuple(self._simulated.events),
            values=self._order.values,
            names=self._order.names,
            environment=environment,
        )

    def _with_heartbeats(self, endpoint: Endpoint) -> Endpoint:
        heard = self._packets.heartbeats if self._packets is not None else {}
        kept, number = heard.get(endpoint.gid, (None, 0))
        return replace(endpoint, kept=kept, heartbeats=number)

    def _violations(self) -> Iterator[tuple[str, str]]:
        """Forbidden actions of the student's processes so far, each with its kind and a text."""
        for violation in self._students.violations:
            yield "forbidden call", violation
        if self._output.forgers:
            yield "forged report", _FORGERY
        if self._graph.forbidden_names:
            yield "forbidden name", _NAMES
        packets = self._packets
        if packets is not None and packets.malformed(self._ports) > _MOST_MALFORMED:
            yield "forbidden packets", _GARBAGE

    def _own_pids(self) -> frozenset[int]:
        companions = self._companions.pids if self._companions is not None else frozenset()
        return self._students.pids | companions

    def _start_companions(self) -> Ending | None:
        """Start the author's programs, and know their nodes before any of the student's runs."""
        if self._companions is None:
            return None
        self._companions.start(self._domain_id)
        for _ in self._ticks():
            if self._faults:
                return Ending.FAULT
            if self._companions.are_ready():
                break
        self._students.others = self._companions.pids
        return None

    def _observe(self) -> Ending:
        # The first to start is the last.
        self._later = sorted(self._order.commands, key=lambda command: command.after_s)[::-1]
        ending = self._launch()
        ending = ending or self._await_sandboxes() or self._await_node() or self._await_match()
        if ending is None:
            tell("matched", limit_s=self._order.limits.timeout_s)
            self._player.begin()
            self._simulated.start()
            ending = self._await_until()
        if self._order.process_sandbox is not None:
            self._other_domains = tuple(d for d in joined_domains() if d != self._domain_id)
        # Endpoints that appeared while the last wait ended still count.
        self._graph.poll()
        self._find_foreign()
        return Ending.FAULT if self._faults else ending

    def _pause(self) -> tuple[Pause, ...]:
        """Let executors call no callback, for longer than two messages are apart.

        What is published meanwhile comes from a thread or a loop.
        """
        length_s = min(_PAUSED_INTERVALS * self._probe.interval_s(), _MOST_PAUSE_S)
        length_s = max(length_s, _LEAST_PAUSE_S)
        began_ns = time.time_ns()
        if self._all_ended():
            return (Pause(began_ns, began_ns),)
        self._students.pause()
        for watch in self._ticks():
            paused_ns = [
                declared.time_ns
                for declared in self._output.declarations
                if declared.kind == "paused" and declared.time_ns >= began_ns
            ]
            if not paused_ns:
                # Wakes executors that wait for nothing else.
                for node in self._graph.nodes:
                    self._probe.executor_calls.call(node.name, "list_parameters")
            elif time.time_ns() - max(paused_ns) > length_s * NS:
                break
            if watch.elapsed_s > _UNTIL_PAUSED_S + length_s:
                break
        received = {name: tuple(times) for name, times in self._probe.afterwards.items()}
        return (Pause(began_ns, time.time_ns(), received),)

    def _launch(self, since_launch_s: float = 0.0) -> Ending | None:
        """Start what is due; those of one time in the order of the scenario."""
        while self._later and self._later[-1].after_s <= since_launch_s:
            command = self._later.pop()
            tell("launching", process=command.name)
            try:
                self._start(command)
            except OSError as error:
                self._waits.append(
                    Wait(f"start of {command.name}: {error.strerror}", 0.0, time.time_ns())
                )
                return Ending.NOT_STARTED
        return None

    def _all_ended(self) -> bool:
        """Whether no process runs, and none is still to be started."""
        return not self._students.poll() and not self._later

    def _start_again(self, name: str) -> None:
        self._probe.executor_calls.counts_servers = False
        self._start(next(item for item in self._order.commands if item.name == name))

    def _start(self, command: ProcessCommand) -> None:
        order = self._order
        of_run = {
            "ROS_DOMAIN_ID": str(self._domain_id),
            "ROSGRADE_HOLD": ":".join(topic.name for topic in order.topics),
        }
        self._students.launch(
            command.name, command.argv, order.student_environment, of_run, Path(order.scratch)
        )

    def _await_sandboxes(self) -> Ending | None:
        """Wait until the programs begin: what comes before is the machine's."""
        for watch in self._ticks():
            waiting = self._students.waiting
            if waiting is None:
                return None
            if watch.elapsed_s > _MOST_SANDBOX_S:
                limit = format_duration(_MOST_SANDBOX_S)
                self._faults.append(f"the sandbox of {waiting} did not stand within {limit}")
            if self._faults:
                return Ending.FAULT
        return None

    def _await_node(self) -> Ending | None:
        def seen() -> bool:
            return any(node.owner is Owner.STUDENT for node in self._graph.nodes)

        tell("domain", id=self._domain_id)
        tell("waiting", what="a node")
        limit_s = self._order.limits.discovery_s
        for watch in self._wait("a node of the student", limit_s):
            if seen():
                self._has_node = True
                return None
            if self._faults:
                return Ending.FAULT
            if self._all_ended():
                return self._last_look(seen)
            if watch.elapsed_s > limit_s:
                return Ending.NO_NODE
        return None

    def _last_look(self, seen: Any) -> Ending | None:
        """Look for a moment more: announcements of an ended process may still be on their way."""
        for _ in self._ticks_for(2 * _GRAPH_PERIOD_S):
            if seen():
                return None
        return Ending.EXITED

    def _await_match(self) -> Ending | None:
        names = ", ".join(topic.name for topic in self._order.topics)
        expected = [f"a publisher on {names}"] if names else []
        if self._player.topics:
            expected.append(f"a subscription on {', '.join(self._player.topics)}")
        if self._player.servers:
            expected.append(f"a client of {', '.join(self._player.servers)}")
        if not expected:
            self._matched_ns = time.time_ns()
            return None
        what = " or ".join(expected)
        tell("waiting", what=what)
        settle_s = self._order.limits.settle_s
        changed_ns, since_change = 0, Stopwatch(self._meter)
        for _ in self._wait(what, settle_s):
            if self._match():
                return None
            if self._faults:
                return Ending.FAULT
            if self._all_ended():
                return self._last_look(self._match)
            if self._graph.changed_ns != changed_ns:
                changed_ns, since_change = self._graph.changed_ns, Stopwatch(self._meter)
            if since_change.elapsed_s > settle_s and not self._later:
                if not self._player.asks:
                    return Ending.NO_MATCH
                # What it should publish is not there; it may still answer requests.
                self._matched_ns = time.time_ns()
                return None
        return None

    def _match(self) -> bool:
        matching: list[Any] = [e for e in self._graph.endpoints if self._probe.matches(e)]
        for endpoint in matching:
            self._probe.subscribe_leniently(endpoint)
        servers = {*self._player.servers, *self._simulated.services}
        matching += [client for client in self._graph.clients if client.name in servers]
        for topic in self._player.topics:
            matching += self._context.endpoints(Kind.SUBSCRIPTION, topic)
        if matching and self._matched_ns is None:
            self._matched_ns = time.time_ns()
        return bool(matching)

    def _await_until(self) -> Ending:
        timeout_s = self._order.limits.timeout_s
        reported = -1
        for watch in self._wait("the end of the scenario", timeout_s):
            self._match()
            if self._faults:
                return Ending.FAULT
            is_met = not self._later and self._ending.met(self._order.until, watch)
            if is_met or self._ending.is_over():
                return Ending.UNTIL
            if self._all_ended() and not self._player.keeps_run:
                # What a process published before it ended may still be on its way.
                for _ in self._ticks_for(2 * _GRAPH_PERIOD_S):
                    pass
                met = self._ending.met(self._order.until, watch)
                return Ending.UNTIL if met else Ending.EXITED
            if watch.elapsed_s > timeout_s:
                return Ending.TIMEOUT
            count = sum(self._probe.counts.values())
            if count != reported:
                tell("recording", messages=count, elapsed_s=watch.elapsed_s, limit_s=timeout_s)
                reported = count
        return Ending.TIMEOUT

    def _wait(self, what: str, limit_s: float) -> Iterator[Stopwatch]:
        """Tick until the caller leaves the loop; the wait is recorded either way."""
        began_ns = time.time_ns()
        met_ns: int | None = None
        watch = None
        try:
            for watch in self._ticks():
                yield watch
        finally:
            if watch is None or watch.elapsed_s <= limit_s:
                met_ns = time.time_ns()
            self._waits.append(Wait(what, limit_s, began_ns, met_ns))

    def _ticks_for(self, limit_s: float) -> Iterator[Stopwatch]:
        for watch in self._ticks():
            yield watch
            if watch.elapsed_s > limit_s:
                return

    def _ticks(self) -> Iterator[Stopwatch]:
        """Handle events; yields the time since the first tick, first for what is known already."""
        watch = Stopwatch(self._meter)
        while True:
            yield watch
            # A publisher that comes ends the wait at once; for all else the graph has to be polled.
            tick_s = _TICK_S if self._matched_ns is None else _CALM_TICK_S
            self._probe.spin_once(self._player.pause_s(tick_s))
            now = time.monotonic()
            settled = self._matched_ns is not None
            news = self._probe.has_met() and not settled
            if now >= self._next_graph or news or self._exit_barrier.is_asked:
                self._next_graph = now + (_SETTLED_GRAPH_PERIOD_S if settled else _GRAPH_PERIOD_S)
                self._graph.poll()
                self._find_foreign()
                _raise_if_abandoned()
            self._exit_barrier.give()
            if not self._probe.recording:
                continue
            if self._companions is not None:
                self._faults += self._companions.faults()
            self._player.tick()
            if self._later:
                self._launch((time.time_ns() - self._launched_ns) / NS)

    def _find_foreign(self) -> None:
        names = sorted({n.name for n in self._graph.nodes if n.owner is Owner.FOREIGN})
        if names and not self._faults:
            self._faults.append(
                f"not alone on ROS domain {self._domain_id}: the node "
                f"{', '.join(names)} belongs neither to rosgrade nor to the submission"
            )


def _raise_if_abandoned() -> None:
    """Raise if standard input has ended, as it does with the runner that ordered the run."""
    if readable((0,), limit_s=0.0) and not os.read(0, 1):
        raise Abandoned
