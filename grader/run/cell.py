"""A cell: one run of one scenario, in a process of its own.

``python -m grader.run.cell FOLDER [DOMAIN...]`` joins the graph on a domain of its own (not
one of those given), and waits for a line on standard input. Then it reads a
:class:`~grader.run.order.CellOrder` from ``order.json`` in the folder, runs it, writes
``recording.mcap`` beside it, and tells its progress as JSON lines on standard output. When its
standard input ends, whoever ordered the run is gone, and the cell kills what it started and
ends.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.recording.model import Call, Ending, Endpoint, Kind, LogLine, Owner, Recording, Wait
from grader.run.descendants import become_subreaper, kill_descendants
from grader.run.disturbance import DisturbanceMeter
from grader.run.domain import DomainLock, joined_domains, lock_domain
from grader.run.ending import EndingConditions
from grader.run.order import GO, ORDER_FILE, RECORDING_FILE, CellOrder, Command
from grader.run.output import OutputReader
from grader.run.stopwatch import Stopwatch
from grader.run.student import StudentProcesses
from grader.run.watchdog import Watchdog
from grader.submission.record import SubmissionRecord

if TYPE_CHECKING:
    from grader.run.graph import GraphObserver
    from grader.run.probe import Probe
    from grader.run.simulator import SimulatedRobot
    from grader.sandbox.namespaces import Mounter

_TICK_S = 0.02
_CALM_TICK_S = 0.1
_GRAPH_PERIOD_S = 0.1
# Who comes and goes later than the first match matters to no wait.
_SETTLED_GRAPH_PERIOD_S = 0.25
_PIPES_LIMIT_S = 1.0
# Lines of the student are told by the thread that reads them.
_TELLING = threading.Lock()


class Abandoned(Exception):
    """Whoever ordered the run is gone."""


def tell(event: str, **data: Any) -> None:
    """One line of progress for whoever ordered the run."""
    with _TELLING:
        print(json.dumps({"event": event, **data}), flush=True)


def _tell_line(line: LogLine) -> None:
    # Whoever ordered the run may be gone; the pipes must be drained all the same.
    with contextlib.suppress(OSError):
        tell("printed", process=line.process, text=line.text)


class Cell:
    """Runs one scenario from launch to recording."""

    def __init__(self, order: CellOrder, domain_id: int, probe: Probe) -> None:
        """Set the cell up; nothing of the student's runs yet."""
        from grader.run.graph import GraphObserver
        from grader.run.stimuli.player import Player
        from grader.run.stimuli.stage import Stage

        self._order = order
        self._domain_id = domain_id
        self._probe = probe
        on_line = _tell_line if order.tells_output else None
        self._output = OutputReader(order.limits.output_bytes, on_line)
        self._students = StudentProcesses(self._output, order.enclosure)
        self._other_domains: tuple[int, ...] = ()
        self._watchdog: Watchdog | None = None
        if order.enclosure is not None:
            self._watchdog = Watchdog(
                order.enclosure.limits,
                lambda: self._students.inits,
                lambda: self._output.written_bytes,
            )
        self._meter = DisturbanceMeter(lambda: self._students.pids)
        self._graph: GraphObserver = GraphObserver(
            probe.node,
            lambda: self._students.pids,
            self._students.refresh,
            private=order.enclosure is not None,
        )
        self._waits: list[Wait] = []
        self._robot: SimulatedRobot | None = None
        if order.simulator is not None:
            from grader.run.simulator import SimulatedRobot

            self._robot = SimulatedRobot(probe.node, order.simulator)
        self._stage = Stage(
            probe,
            self._graph,
            self._students,
            self._meter,
            order.limits,
            self._start_again,
            self._waits,
        )
        self._player = Player(order.stimuli, self._stage)
        self._ending = EndingConditions(probe, self._output, self._robot, self._player)
        self._faults: list[str] = []
        self._next_graph = 0.0
        self._told = 0
        self._matched_ns: int | None = None

    def run(self) -> Recording:
        """Launch, observe, stop.

        Raises:
            Abandoned: Nobody waits for the recording any more.
        """
        self._meter.start()
        if self._watchdog is not None:
            self._watchdog.start()
        launched_ns = time.time_ns()
        try:
            ending = self._observe()
            self._probe.recording = False
            stop_ns = time.time_ns()
            self._player.finish()
            if self._robot is not None:
                self._robot.stop()
            tell("stopping")
            self._stop()
        finally:
            self._students.clean_up()
            self._faults += self._students.faults()
            breaches = self._watchdog.stop() if self._watchdog is not None else ()
        written = self._output.close(_PIPES_LIMIT_S)
        log = sorted((*written, *self._probe.rosout.lines), key=lambda line: line.time_ns)
        disturbance = self._meter.stop()
        others = ", ".join(map(str, self._other_domains))
        return Recording(
            scenario=self._order.scenario,
            seed=self._order.seed,
            ending=ending,
            launched_ns=launched_ns,
            matched_ns=self._matched_ns,
            stop_ns=stop_ns,
            end_ns=time.time_ns(),
            submission=SubmissionRecord(id="", sha256=""),
            nodes=self._graph.nodes,
            endpoints=self._graph.endpoints,
            processes=self._students.records(),
            log=tuple(log),
            declarations=self._output.declarations,
            calls=_by_time((*self._probe.calls, *self._stage.asker.calls)),
            services=self._graph.services,
            goals=tuple(sent.record for sent in self._stage.goals),
            waits=tuple(self._waits),
            joins=tuple(self._stage.joins.values()),
            interventions=tuple(self._stage.interventions),
            breaches=breaches,
            sent=dict.fromkeys(self._player.topics, ()),
            answers=self._player.answers,
            disturbance=disturbance,
            faults=tuple(self._faults),
            truth=self._robot.truth if self._robot else (),
            incidents=self._robot.incidents if self._robot else (),
            scene=self._robot.scene() if self._robot else None,
            values=self._order.values,
            environment={
                **self._order.facts,
                "domain_id": str(self._domain_id),
                **({"other_domains": others} if others else {}),
            },
        )

    def _observe(self) -> Ending:
        ending = self._launch()
        # Needed at the end; imported while the student's process starts.
        import grader.recording.mcap_writer  # noqa: F401

        ending = ending or self._await_node() or self._await_match()
        if ending is None:
            tell("matched", limit_s=self._order.limits.timeout_s)
            self._player.begin()
            if self._robot is not None:
                self._robot.start()
            ending = self._await_until()
        if self._order.enclosure is not None:
            self._other_domains = tuple(d for d in joined_domains() if d != self._domain_id)
        # What arrived while the last wait ended still counts.
        self._graph.poll()
        self._find_foreign()
        return Ending.FAULT if self._faults else ending

    def _launch(self) -> Ending | None:
        for command in self._order.commands:
            tell("launching", process=command.name)
            try:
                self._start(command)
            except OSError as error:
                self._waits.append(
                    Wait(f"start of {command.name}: {error.strerror}", 0.0, time.time_ns())
                )
                return Ending.NOT_STARTED
        return None

    def _start_again(self, name: str) -> None:
        self._start(next(item for item in self._order.commands if item.name == name))

    def _start(self, command: Command) -> None:
        """Start a process of the student.

        Raises:
            OSError: It cannot be executed.
        """
        environment = dict(self._order.environment)
        environment["ROS_DOMAIN_ID"] = str(self._domain_id)
        environment["ROSGRADE_HOLD"] = ":".join(topic.name for topic in self._order.topics)
        self._students.launch(command.name, command.argv, environment, Path(self._order.scratch))

    def _await_node(self) -> Ending | None:
        def seen() -> bool:
            return any(node.owner is Owner.STUDENT for node in self._graph.nodes)

        tell("domain", id=self._domain_id)
        tell("waiting", what="a node")
        limit_s = self._order.limits.discovery_s
        for watch in self._wait("a node of the student", limit_s):
            if seen():
                return None
            if self._faults:
                return Ending.FAULT
            if not self._students.poll():
                return self._last_look(seen)
            if watch.elapsed_s > limit_s:
                return Ending.NO_NODE
        return None

    def _last_look(self, seen: Any) -> Ending | None:
        """What an ended process announced may still be on its way: look for a moment more."""
        for watch in self._ticks():
            if seen():
                return None
            if watch.elapsed_s > 2 * _GRAPH_PERIOD_S:
                break
        return Ending.EXITED

    def _await_match(self) -> Ending | None:
        names = ", ".join(topic.name for topic in self._order.topics)
        expected = [f"a publisher on {names}"] if names else []
        if self._player.topics:
            expected.append(f"a subscription on {', '.join(self._player.topics)}")
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
            if not self._students.poll():
                return self._last_look(self._match)
            if self._graph.changed_ns != changed_ns:
                changed_ns, since_change = self._graph.changed_ns, Stopwatch(self._meter)
            if since_change.elapsed_s > settle_s:
                if not self._player.asks:
                    return Ending.NO_MATCH
                # What it should publish is not there; what it is asked, it may still answer.
                self._matched_ns = time.time_ns()
                return None
        return None

    def _match(self) -> bool:
        matching = [e for e in self._graph.endpoints if self._probe.matches(e)]
        for endpoint in matching:
            self._probe.subscribe_leniently(endpoint)
        matching += [e for topic in self._player.topics for e in self._listeners(topic)]
        if matching and self._matched_ns is None:
            self._matched_ns = time.time_ns()
        return bool(matching)

    def _listeners(self, topic: str) -> list[Endpoint]:
        return self._stage.endpoints(Kind.SUBSCRIPTION, topic)

    def _await_until(self) -> Ending:
        timeout_s = self._order.limits.timeout_s
        reported = -1
        for watch in self._wait("the end of the scenario", timeout_s):
            self._match()
            if self._faults:
                return Ending.FAULT
            if self._ending.met(self._order.until, watch) or self._ending.is_over():
                return Ending.UNTIL
            if not self._students.poll() and not self._player.keeps_run:
                return self._last_messages(watch)
            if watch.elapsed_s > timeout_s:
                return Ending.TIMEOUT
            count = sum(self._probe.counts.values())
            if count != reported:
                tell("recording", messages=count, elapsed_s=watch.elapsed_s, limit_s=timeout_s)
                reported = count
        return Ending.TIMEOUT

    def _last_messages(self, watch: Stopwatch) -> Ending:
        """Take in what a process published before it ended."""
        for late in self._ticks():
            if late.elapsed_s > 2 * _GRAPH_PERIOD_S:
                break
        met = self._ending.met(self._order.until, watch)
        return Ending.UNTIL if met else Ending.EXITED

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

    def _ticks(self) -> Iterator[Stopwatch]:
        """Handle events; yields the time since the first tick."""
        watch = Stopwatch(self._meter)
        while True:
            # A message ends the wait at once; only the graph has to be polled.
            tick_s = _TICK_S if self._matched_ns is None else _CALM_TICK_S
            self._probe.spin_once(self._player.pause_s(tick_s))
            now = time.monotonic()
            leaving = self._leaving()
            if now >= self._next_graph or len(leaving) > self._told:
                settled = self._matched_ns is not None
                self._next_graph = now + (_SETTLED_GRAPH_PERIOD_S if settled else _GRAPH_PERIOD_S)
                self._graph.poll()
                self._find_foreign()
                _raise_if_abandoned()
            self._let_leave(leaving)
            self._player.tick()
            yield watch

    def _leaving(self) -> list[str]:
        """Processes that wait to be seen before they end, by their tracers' word."""
        return [item.process for item in self._output.declarations if item.kind == "leaving"]

    def _let_leave(self, leaving: list[str]) -> None:
        if len(leaving) == self._told:
            return
        nodes = {node.name for node in self._graph.nodes}
        announced = {
            (endpoint.kind.value, endpoint.topic)
            for endpoint in self._graph.endpoints
            if endpoint.owner is not Owner.PROBE
        }
        for declaration in self._output.declarations:
            kind, data = declaration.kind, declaration.data
            if kind == "node" and str(data.get("node")) not in nodes:
                return
            is_endpoint = kind in ("publisher", "subscription")
            if is_endpoint and (kind, str(data.get("topic"))) not in announced:
                return
        for name in leaving[self._told :]:
            self._students.let_leave(name)
        self._told = len(leaving)

    def _find_foreign(self) -> None:
        names = sorted({n.name for n in self._graph.nodes if n.owner is Owner.FOREIGN})
        if names and not self._faults:
            self._faults.append(
                f"not alone on ROS domain {self._domain_id}: the node "
                f"{', '.join(names)} belongs neither to rosgrade nor to the submission"
            )

    def _stop(self) -> None:
        """SIGINT, SIGTERM, SIGKILL, each with a bounded wait."""
        self._students.let_leave()
        limits = self._order.limits
        watch = Stopwatch(self._meter)
        for number, limit_s in (
            (signal.SIGINT, limits.shutdown_s),
            (signal.SIGTERM, limits.terminate_s),
            (signal.SIGKILL, limits.terminate_s),
        ):
            if not self._students.poll():
                break
            self._students.signal(number)
            step = Stopwatch(self._meter)
            while self._students.poll() and step.elapsed_s <= limit_s:
                time.sleep(0.005)
                self._students.note_stop(watch.elapsed_s)
            self._students.note_stop(watch.elapsed_s)


def _by_time(calls: Iterable[Call]) -> tuple[Call, ...]:
    return tuple(sorted(calls, key=lambda call: call.requested_ns))


def _raise_if_abandoned() -> None:
    """Standard input ends with the process that ordered the run."""
    readable, _, _ = select.select([0], [], [], 0)
    if readable and not os.read(0, 1):
        raise Abandoned


def _reset_signals() -> None:
    """Let the student's processes inherit the signals that a terminal gives.

    A shell starts background jobs, and `nohup` its command, with some of them ignored; a program
    that inherits that never sees the Ctrl-C that ends it.
    """
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _keep_progress_apart() -> None:
    """Let nothing but our progress go to standard output.

    Fast DDS writes its warnings there, such as one for every message that is too long for the
    type that the probe reads.
    """
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)


def _definitions(order: CellOrder, types: set[str]) -> dict[str, str]:
    from grader.recording.definition import concatenated_definition, definition_finder

    find = definition_finder(Path(prefix) for prefix in order.prefixes)
    return {name: concatenated_definition(name, find) for name in types}


def main(folder: Path, avoid_domains: tuple[int, ...], mounter: Mounter | None = None) -> int:
    """Get ready, wait for the word, run the order in the folder.

    Args:
        folder: The cell's own.
        avoid_domains: Domains not to use.
        mounter: In a sandbox: mounts what the student can write to.
    """
    # A run makes few objects and ends soon; collections would cost a tenth of its CPU time.
    gc.disable()
    become_subreaper()
    _reset_signals()
    _keep_progress_apart()
    with DomainLock(0) if mounter else lock_domain(avoid_domains) as domain:
        from grader.run.probe import Probe

        probe = Probe(domain.domain_id)
        if os.read(0, len(GO)) != GO:
            return 1
        order = CellOrder.from_json((folder / ORDER_FILE).read_text(encoding="utf-8"))
        if order.type_support:
            from grader.run.type_support import add_type_support

            add_type_support(map(Path, order.type_support))
        if mounter is not None and order.enclosure is not None:
            bounds = order.enclosure.limits
            mounter.mount(bounds.disk_bytes, bounds.files, bounds.shared_bytes)
        probe.listen(order.topics, order.limits)
        try:
            recording = Cell(order, domain.domain_id, probe).run()
        except Abandoned:
            return 1
        finally:
            kill_descendants(os.getpid())
        # What was written by another definition would be read as something that nobody sent.
        garbled = {one.topic for one in recording.endpoints if recording.misdefined(one.topic)}
        messages = [one for one in probe.messages if one.is_sent or one.topic not in garbled]
        probe.close()
    from grader.recording.mcap_writer import write_recording

    definitions = _definitions(order, {message.type for message in messages})
    write_recording(
        folder / RECORDING_FILE, recording, messages, definitions, order.submission.encode()
    )
    tell("recorded")
    return 0


if __name__ == "__main__":
    status = main(Path(sys.argv[1]), tuple(map(int, sys.argv[2:])))
    sys.stdout.flush()
    # The recording is written and the graph left; to unload all libraries takes 0.1 s more.
    os._exit(status)
