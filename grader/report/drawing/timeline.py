"""The time line of a run: what happened when, from the launch to the end of the process."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from markupsafe import Markup

from grader.diagnosis.no_endpoint import OWN_TOPICS
from grader.findings.words import counted, listing
from grader.recording.model import NS, Call, LogLine, Owner, Process, Recording
from grader.report.drawing import axes
from grader.report.drawing.svg import LETTER, Figure, figure, fitted, label, line
from grader.report.model.excerpt import printed
from grader.spec.safe_text import one_line

ROW = 17
GAP = 6


class Flag(NamedTuple):
    """A labelled time, in seconds since launch."""

    time_s: float
    text: str


class PlacedFlag(NamedTuple):
    """A flag with the pixel of its leader, and the first and the last one of its text."""

    flag: Flag
    x: float
    extent: tuple[float, float]
    row: int

    @property
    def left(self) -> bool:
        """Whether its text lies left of the leader, because it would not fit on the right."""
        return self.extent[0] < self.x


def place(flags: Sequence[Flag], scale: axes.Scale) -> list[PlacedFlag]:
    """Give every flag, by time, a row, so that no text meets another.

    Each goes below all texts before it that it would meet: so the leader of a later one begins
    below an earlier text. Texts to the left mirror this, the latest is on top, and they come
    first: only there a leader passes behind a text.
    """
    placed: list[PlacedFlag] = []
    lefts: list[tuple[Flag, float, tuple[float, float]]] = []
    rights: list[tuple[Flag, float, tuple[float, float]]] = []
    for flag in flags:
        x, length = scale.clipped(flag.time_s), len(flag.text) * LETTER + GAP
        if x + length > scale.end:
            lefts.insert(0, (flag, x, (x - length, x)))
        else:
            rights.append((flag, x, (x, x + length)))
    for flag, x, (begin, end) in lefts + rights:
        met = [one.row for one in placed if one.extent[0] < end + 1 and begin - 1 < one.extent[1]]
        placed.append(PlacedFlag(flag, x, (begin, end), 1 + max(met, default=-1)))
    return sorted(placed, key=lambda one: (one.flag.time_s, one.x))


def draw_flags(
    flags: Sequence[Flag], scale: axes.Scale, below: float
) -> tuple[list[Markup], float]:
    """Draw flags with leaders that go on through what is drawn below.

    Args:
        below: Height of what is drawn below, in pixels.

    Returns:
        The elements, and the pixel at which to draw what is below.
    """
    placed = place(flags, scale)
    top = ROW * (1 + max((one.row for one in placed), default=0)) + 6
    leaders, labels = [], []
    for one in placed:
        y = ROW * one.row
        leaders.append(line(one.x, y + 4, one.x, top + below, "leader"))
        anchor, shift = ("end", -4) if one.left else ("start", 4)
        labels.append(label(one.flag.text, one.x + shift, y + 13, "flag", anchor))
    return leaders + labels, top


MOST_NODES = 4
_LEAST_HELD_S = 0.01
_MOST_HELD_S = 60.0
_OWN_SERVICE = "parameter service"
"""Lane of what the grader asks every node again and again, until the end."""
_COMPLAINTS = ("Traceback (most recent call last)", "[ERROR]", "[FATAL]")


def draw_timeline(recording: Recording, moments_s: Sequence[float], name: str) -> Figure | None:
    """Draw the time line of a run; None where nothing was launched.

    Args:
        moments_s: Times that findings point at, in seconds since launch.
    """
    end_s = recording.since_launch_s(recording.end_ns)
    if not recording.processes or end_s <= 0.0:
        return None
    flags = _flags(recording)
    lanes = [*_of_processes(recording), *_of_topics(recording), *_of_requests(recording)]
    lanes += _of_what_went_wrong(recording, moments_s)

    def draw(width: float) -> tuple[float, list[Markup]]:
        scale = axes.Scale(0.0, end_s, axes.SIDE, width - axes.SIDE)
        content, top = draw_flags(flags, scale, axes.LANE * len(lanes))
        bottom = top + axes.LANE * len(lanes) + 6
        content += axes.draw_lanes(lanes, scale, top, width)
        return bottom + axes.TIME_AXIS, [*content, *axes.time_axis(scale, bottom, width)]

    caption = "Each stroke is one event; × marks what went wrong, or what a finding points at."
    if any(_held(recording, topic) for topic in recording.messages):
        caption += " Held: create_publisher() returned only when the publisher was matched."
    described = [flag.text for flag in flags]
    described += [f"{one_line(lane.name)}: {lane.note}" for lane in lanes]
    title = f"Time line of the scenario {recording.scenario}"
    return figure(name, title, caption, draw, "; ".join(described))


def _flags(recording: Recording) -> list[Flag]:
    flags = [Flag(0.0, "launch")]

    def add(time_ns: int | None, text: str) -> None:
        if time_ns is not None:
            time_s = recording.since_launch_s(time_ns)
            flags.append(Flag(time_s, f"{text} {time_s:.2f} s"))

    nodes = [(node.appeared_ns, one_line(node.name)) for node in recording.student_nodes]
    if nodes:
        time_ns, node_name = min(nodes)
        add(time_ns, f"node {fitted(node_name, 100)}")
    add(recording.matched_ns, "matched")
    firsts = [messages[0].stamp_ns for messages in recording.messages.values() if messages]
    add(min(firsts, default=None), "first message")
    for item in recording.interventions:
        add(item.time_ns, f"{item.signal or item.action} from the scenario")
    if any(process.stopped_by != "itself" for process in recording.processes):
        add(recording.stop_ns, "SIGINT")
    for process in recording.processes:
        add(process.exited_ns, _exit(process))
    return sorted(flags, key=lambda flag: flag.time_s)


def _exit(process: Process) -> str:
    if process.exit_code is not None and process.exit_code < 0:
        return f"ended by signal {-process.exit_code} at"
    needed = f" after {process.stopped_by}" if process.stopped_by in ("SIGTERM", "SIGKILL") else ""
    return f"exit {process.exit_code}{needed} at"


def _since(recording: Recording, times_ns: Iterable[int]) -> list[float]:
    return [recording.since_launch_s(time_ns) for time_ns in times_ns]


def _bar(recording: Recording, begin_ns: int, end_ns: int | None) -> list[axes.Bar]:
    """A bar until a time, or until the end of the run where that is None."""
    end_ns = recording.end_ns if end_ns is None else end_ns
    since = recording.since_launch_s
    return [axes.Bar(since(begin_ns), since(max(begin_ns, end_ns)))]


def _of_processes(recording: Recording) -> Iterator[axes.Lane]:
    """When processes and nodes were there, and when their endpoints came and went."""
    for process in recording.processes:
        bars = _bar(recording, process.started_ns, process.exited_ns)
        yield axes.Lane(process.name, f"ran for {bars[0].end_s - bars[0].begin_s:.2f} s", bars)
    for node in recording.student_nodes[:MOST_NODES]:
        vanished = node.vanished_ns is not None and node.vanished_ns < recording.stop_ns
        note = "in the graph until it vanished" if vanished else "in the graph to the end"
        yield axes.Lane(
            f"node {node.name}", note, _bar(recording, node.appeared_ns, node.vanished_ns)
        )
    own = [
        item
        for item in recording.endpoints
        if item.owner is Owner.STUDENT and item.topic not in OWN_TOPICS
    ]
    gone = [
        item.vanished_ns
        for item in own
        if item.vanished_ns is not None and item.vanished_ns < recording.stop_ns
    ]
    if own:
        yield axes.Lane(
            "publishers and subscriptions",
            f"{counted(len(own), 'endpoint')} came, {len(gone) or 'none'} went",
            ticks=_since(recording, [item.appeared_ns for item in own]),
            crosses=_since(recording, gone),
        )


def _of_topics(recording: Recording) -> Iterator[axes.Lane]:
    found = [(topic, _held(recording, topic), all_) for topic, all_ in recording.messages.items()]
    sent = [(f"to {topic}", " sent", all_) for topic, all_ in recording.sent.items()]
    for name, rest, messages in sorted(found) + sorted(sent):
        ticks = _since(recording, [one.stamp_ns for one in messages])
        yield axes.Lane(name, f"{counted(len(messages), 'message')}{rest}", ticks=ticks)


def _held(recording: Recording, topic: str) -> str:
    """How long the tracer let a publisher wait until it was matched, in words; empty if hardly."""
    waits = [
        item.data.get("waited_s", 0.0)
        for item in recording.declared("held")
        if item.data.get("topic") == topic
    ]
    # It is the student's process that reports it.
    longest_s = max((wait for wait in waits if isinstance(wait, float)), default=0.0)
    if not _LEAST_HELD_S <= longest_s <= _MOST_HELD_S:
        return ""
    return f", held {longest_s:.2f} s"


def _of_requests(recording: Recording) -> Iterator[axes.Lane]:
    """Calls of services, and goals."""
    found: dict[str, list[Call]] = {}
    for call in recording.calls:
        own = call.service.endswith("_parameters")
        found.setdefault(_OWN_SERVICE if own else call.service, []).append(call)
    for service, calls in found.items():
        # The end cuts off the last one of a series. An answer may take 1 s.
        last_ns = recording.stop_ns - NS if service == _OWN_SERVICE else recording.end_ns
        unanswered = [call.requested_ns for call in calls if call.answered_ns is None]
        lost = [time_ns for time_ns in unanswered if time_ns <= last_ns]
        cut_off = len(unanswered) - len(lost)
        notes = [f"{len(lost)} without an answer"] if lost else []
        notes += [f"{cut_off} cut off by the end"] if cut_off else []
        others = [call.requested_ns for call in calls if call.requested_ns not in lost]
        yield axes.Lane(
            service,
            ", ".join([counted(len(calls), "call"), *(notes or ["all answered"])]),
            ticks=_since(recording, others),
            crosses=_since(recording, lost),
        )
    for goal in recording.goals:
        end_ns = recording.stop_ns if goal.result_ns is None else goal.result_ns
        became = "rejected" if goal.accepted is False else goal.status or "no result"
        yield axes.Lane(
            goal.action,
            f"goal: {became}, {counted(len(goal.feedback), 'message')} of feedback",
            _bar(recording, goal.sent_ns, end_ns),
            ticks=_since(recording, [item.time_ns for item in goal.feedback]),
        )


def _of_what_went_wrong(recording: Recording, moments_s: Sequence[float]) -> Iterator[axes.Lane]:
    """Output with its errors, limits that were reached, and what findings point at."""
    lines = printed(recording)
    # How a right node words its end after Ctrl+C is up to it.
    running = (entry for entry in lines if entry.time_ns <= recording.stop_ns)
    bad = [entry.time_ns for entry in running if _complains(entry)]
    note = counted(len(lines), "line") + (f", {counted(len(bad), 'error')}" if bad else "")
    times_s = _since(recording, [entry.time_ns for entry in lines])
    yield axes.Lane("output", note, ticks=times_s, crosses=_since(recording, bad))
    if recording.breaches:
        reached = listing(breach.what for breach in recording.breaches)
        times_s = _since(recording, [breach.time_ns for breach in recording.breaches])
        yield axes.Lane("limits of the sandbox", f"reached: {reached}", crosses=times_s)
    if moments_s:
        yield axes.Lane("findings", counted(len(moments_s), "moment"), crosses=moments_s)


def _complains(entry: LogLine) -> bool:
    return entry.level in ("ERROR", "FATAL") or entry.text.startswith(_COMPLAINTS)
