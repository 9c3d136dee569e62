"""The replay of a recording: a node on a domain of its own gets the recorded messages again.

For students at home: the node runs as they would run it, without a sandbox, and nothing is
judged. It is a run like any other, whose only stimuli are the messages of the recording.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.errors import UsageError
from grader.machine.ros import RosInstallation
from grader.machine.scratch import Scratch
from grader.recording.mcap_reader import read_inputs, read_recording
from grader.recording.mcap_writer import RawMessage
from grader.recording.model import NS, Ending, Kind, Owner, Qos, Recording
from grader.run.request import RunRequest
from grader.run.runner import Runner
from grader.spec.safe_text import clean, one_line

if TYPE_CHECKING:
    from grader.assignment.model import Assignment, Scenario
    from grader.assignment.stimuli.kinds.publish import Publish

_DEFAULT_QOS = Qos("reliable", "volatile")
_DEPTH = 1000
_MOST_PRINTED_PER_S = 10
"""Messages of a topic within a second; a burst is worth reading, a stream is not."""
_AFTERMATH_S = 0.5
"""The observation may have ended with the very answer to the last input."""
_ENDING_LIMIT_S = 20.0


def published(messages: Sequence[RawMessage], qos: Qos, recording: Recording) -> Publish:
    """The messages of one topic as a stimulus; what a late joiner gets comes before the launch."""
    from grader.assignment.stimuli.kinds.publish import Publish

    early: list[RawMessage] = []
    if qos.durability == "transient_local":
        early = [message for message in messages if message.stamp_ns < recording.launched_ns]
    later = messages[len(early) :]
    after_s = (later[0].stamp_ns - began_ns(recording)) / NS if later else 0.0
    offered: Any = {"reliability": qos.reliability, "durability": qos.durability}
    stimulus = Publish.model_construct(
        publish=messages[0].topic,
        type=messages[0].type,
        depth=_DEPTH,
        before_launch=len(early),
        after=max(0.0, after_s),
        **offered,
    )
    return stimulus.sending((message.cdr, message.stamp_ns / NS) for message in messages)


def began_ns(recording: Recording) -> int:
    """When the clock of a run started."""
    return recording.matched_ns or recording.launched_ns


def replay_scenario(file: Path, recording: Recording, assignment: Assignment) -> Scenario:
    """The scenario of a recording, with its messages in the place of world and stimuli."""
    from grader.assignment.model import RecordedTopic, Until

    scenario = next((s for s in assignment.scenarios if s.id == recording.scenario), None)
    if scenario is None:
        raise UsageError(
            f"{file}: the assignment {assignment.id!r} has no scenario {recording.scenario!r}"
        )
    messages: dict[str, list[RawMessage]] = {}
    for message in read_inputs(file, recording):
        messages.setdefault(message.topic, []).append(message)
    if not messages:
        raise UsageError(
            f"{file}: nothing was published to the node in this run, so there is nothing to "
            "replay: run it with `ros2 run`"
        )
    offered = {
        endpoint.topic: endpoint.qos
        for endpoint in recording.endpoints
        if endpoint.owner is Owner.PROBE and endpoint.kind is Kind.PUBLISHER
    }
    published_types = {
        endpoint.topic: endpoint.type for endpoint in recording.student_endpoints(Kind.PUBLISHER)
    }
    elapsed_s = (recording.stop_ns - began_ns(recording)) / NS + _AFTERMATH_S
    return scenario.model_copy(
        update={
            "world": None,
            "stimuli": tuple(
                published(messages[topic], offered.get(topic, _DEFAULT_QOS), recording)
                for topic in sorted(messages)
            ),
            # Every publisher meets the request for best effort.
            "record": tuple(
                RecordedTopic(topic=topic, type=type, reliability="best_effort", depth=_DEPTH)
                for topic, type in published_types.items()
            ),
            "until": Until.model_construct(elapsed=elapsed_s, stimuli="done"),
            "timeout": elapsed_s + _ENDING_LIMIT_S,
        }
    )


def replay(request: RunRequest, ros: RosInstallation) -> int:
    """Replay a recording, and print everything that happens.

    Args:
        request: For a scenario of :func:`replay_scenario`.

    Returns:
        0 when it was played to its end, 1 when the node ended or never listened, 130 when it
        was interrupted; nothing of it runs any more.
    """
    known_packages = set(ros.packages)
    for prefix in request.type_support:
        known_packages.update(path.name for path in prefix.glob("share/*"))
    recorded = []
    for topic in request.scenario.record:
        if topic.type.partition("/")[0] in known_packages:
            recorded.append(topic)
        else:
            _print("rosgrade", f"{topic.topic} is not shown: no {topic.type} here")
    scenario = request.scenario.model_copy(update={"record": tuple(recorded)})
    with Scratch("replay") as folder, Runner(ros, progress=_Screen(), verbose=True) as runner:
        file = folder / "run.mcap"
        try:
            runner.run(replace(request, scenario=scenario), file)
        except KeyboardInterrupt:
            return 130
        return _print_outcome(read_recording(file))


class _Screen:
    """Prints what the processes print, with the time since the first match."""

    def __init__(self) -> None:
        self._began_s: float | None = None

    def __call__(self, _scenario: str, event: Mapping[str, Any]) -> None:
        """Print an event of the run."""
        if event["event"] == "launching":
            _print("rosgrade", f"starting {event['process']}")
        elif event["event"] == "matched":
            self._began_s = time.monotonic()
        elif event["event"] == "printed":
            time_s = None if self._began_s is None else time.monotonic() - self._began_s
            _print(event["process"].rpartition("/")[2], clean(event["text"]), time_s)


def _print_outcome(recording: Recording) -> int:
    """Print the messages and how it ended; return the exit code."""
    for topic in sorted({one.topic for one in recording.student_endpoints(Kind.PUBLISHER)}):
        messages = recording.on(topic)
        count_by_second: Counter[int] = Counter()
        for message in messages:
            time_s = (message.stamp_ns - began_ns(recording)) / NS
            count_by_second[int(time_s)] += 1
            if count_by_second[int(time_s)] <= _MOST_PRINTED_PER_S:
                _print(topic, _as_yaml(message.value), time_s)
        _print("rosgrade", f"{len(messages)} messages on {topic}")
    if recording.ending is Ending.EXITED:
        codes = ", ".join(str(process.exit_code) for process in recording.processes)
        _print("rosgrade", f"the node has ended by itself (exit code {codes})")
    missed = [wait.what for wait in recording.waits if wait.met_ns is None]
    for what in missed:
        _print("rosgrade", f"did not come in time: {what}")
    return 0 if recording.ending is Ending.UNTIL and not missed else 1


def _print(source: str, text: str, time_s: float | None = None) -> None:
    time_text = "" if time_s is None else f"{time_s:.3f} s"
    print(f"{time_text:>10}  {source}  {text}", flush=True)


def _as_yaml(value: Any) -> str:
    """A message in one line, as YAML writes it."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {_as_yaml(item)}" for name, item in value.items()) + "}"
    return f"{value:.6g}" if isinstance(value, float) else one_line(str(value))
