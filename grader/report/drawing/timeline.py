"""The time line of a run: what happened when, from the launch to the end of the process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.checks.finding import Moment
from grader.checks.wording import counted, listing
from grader.diagnosis.no_endpoint import OWN_TOPICS
from grader.recording.model import NS, Call, LogLine, Owner, Process, Recording
from grader.report.drawing import axis
from grader.report.drawing.axis import time_axis
from grader.report.drawing.flags import Flag, draw_flags
from grader.report.drawing.svg import (
    NARROW,
    WIDE,
    Figure,
    Scale,
    columns,
    crosses,
    drawing,
    element,
    fitted,
    label,
)
from grader.report.model.sections import printed
from grader.safe_text import one_line

LANE = 36
TRACK = 12
SIDE = 6
MOST_NODES = 4
_LEAST_HELD_S = 0.01
_MOST_HELD_S = 60.0
_OWN_SERVICE = "parameter service"
"""Lane of what the grader asks every node again and again, until the end."""
_COMPLAINTS = ("Traceback (most recent call last)", "[ERROR]", "[FATAL]")


@dataclass(frozen=True)
class Lane:
    """A row of the time line; all times in seconds since launch.

    Attributes:
        bar: From when to when it was there, or None.
    """

    name: str
    note: str
    bar: tuple[float, float] | None = None
    ticks: tuple[float, ...] = ()
    crosses: tuple[float, ...] = ()


def draw_timeline(recording: Recording, moments: Sequence[Moment], name: str) -> Figure | None:
    """Draw the time line of a run.

    Args:
        name: Unique in the document; letters, digits and hyphens.

    Returns:
        The drawing, or None where nothing was launched.
    """
    end_s = recording.since_launch_s(recording.end_ns)
    if not recording.processes or end_s <= 0.0:
        return None
    flags = _flags(recording)
    lanes = _lanes(recording, moments)
    caption = "Each stroke is one event; × marks what went wrong, or what a finding points at."
    if any(_held(recording, topic) for topic in recording.messages):
        caption += " Held: create_publisher() returned only when the publisher was matched."
    return Figure(
        caption,
        _draw(recording, flags, lanes, end_s, f"{name}-wide", WIDE),
        _draw(recording, flags, lanes, end_s, f"{name}-narrow", NARROW),
    )


def _flags(recording: Recording) -> tuple[Flag, ...]:
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
    return tuple(sorted(flags, key=lambda flag: flag.time_s))


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


def _exit(process: Process) -> str:
    if process.exit_code is not None and process.exit_code < 0:
        return f"ended by signal {-process.exit_code} at"
    needed = f" after {process.stopped_by}" if process.stopped_by in ("SIGTERM", "SIGKILL") else ""
    return f"exit {process.exit_code}{needed} at"


def _lanes(recording: Recording, moments: Sequence[Moment]) -> list[Lane]:
    since = recording.since_launch_s
    lanes = []
    for process in recording.processes:
        end_ns = recording.end_ns if process.exited_ns is None else process.exited_ns
        begin, end = since(process.started_ns), since(end_ns)
        lanes.append(Lane(process.name, f"ran for {end - begin:.2f} s", bar=(begin, end)))
    lanes += _graph(recording)
    for topic, messages in sorted(recording.messages.items()):
        times = tuple(since(message.stamp_ns) for message in messages)
        held = _held(recording, topic)
        lanes.append(Lane(topic, f"{counted(len(times), 'message')}{held}", ticks=times))
    for topic, messages in sorted(recording.sent.items()):
        times = tuple(since(message.stamp_ns) for message in messages)
        lanes.append(Lane(f"to {topic}", f"{counted(len(times), 'message')} sent", ticks=times))
    for asked, calls in _calls(recording).items():
        lost = [call for call in calls if _is_lost(call, asked, recording)]
        cut_off = sum(call.answered_ns is None for call in calls) - len(lost)
        notes = [f"{len(lost)} without an answer"] if lost else []
        notes += [f"{cut_off} cut off by the end"] if cut_off else []
        lanes.append(
            Lane(
                asked,
                ", ".join([counted(len(calls), "call"), *(notes or ["all answered"])]),
                ticks=tuple(
                    since(call.requested_ns)
                    for call in calls
                    if not _is_lost(call, asked, recording)
                ),
                crosses=tuple(since(call.requested_ns) for call in lost),
            )
        )
    for goal in recording.goals:
        end_ns = recording.stop_ns if goal.result_ns is None else goal.result_ns
        became = "rejected" if goal.accepted is False else goal.status or "no result"
        lanes.append(
            Lane(
                goal.action,
                f"goal: {became}, {counted(len(goal.feedback), 'message')} of feedback",
                bar=(since(goal.sent_ns), since(end_ns)),
                ticks=tuple(since(item.time_ns) for item in goal.feedback),
            )
        )
    lines = printed(recording)
    bad = tuple(since(entry.time_ns) for entry in lines if _complains(entry))
    note = counted(len(lines), "line") + (f", {counted(len(bad), 'error')}" if bad else "")
    lanes.append(
        Lane("output", note, ticks=tuple(since(entry.time_ns) for entry in lines), crosses=bad)
    )
    if recording.breaches:
        reached = listing(breach.what for breach in recording.breaches)
        times = tuple(since(breach.time_ns) for breach in recording.breaches)
        lanes.append(Lane("limits of the sandbox", f"reached: {reached}", crosses=times))
    if moments:
        lanes.append(
            Lane(
                "findings",
                counted(len(moments), "moment"),
                crosses=tuple(moment.time_s for moment in moments),
            )
        )
    return lanes


def _complains(entry: LogLine) -> bool:
    return entry.level in ("ERROR", "FATAL") or entry.text.startswith(_COMPLAINTS)


def _is_lost(call: Call, asked: str, recording: Recording) -> bool:
    """Whether a call should have been answered; the end cuts off the last one of a series.

    An answer may take 1 s, as ``executor.responsive`` has it by default.
    """
    at_the_end = asked == _OWN_SERVICE and call.requested_ns > recording.stop_ns - NS
    return call.answered_ns is None and not at_the_end


def _calls(recording: Recording) -> dict[str, list[Call]]:
    """Calls by the lane that they are drawn in."""
    found: dict[str, list[Call]] = {}
    for call in recording.calls:
        own = call.service.endswith("_parameters")
        found.setdefault(_OWN_SERVICE if own else call.service, []).append(call)
    return found


def _graph(recording: Recording) -> list[Lane]:
    """When nodes were there, and when their endpoints came and went."""
    since = recording.since_launch_s
    lanes = []
    for node in recording.student_nodes[:MOST_NODES]:
        vanished = node.vanished_ns is not None and node.vanished_ns < recording.stop_ns
        end_ns = node.vanished_ns if node.vanished_ns is not None else recording.end_ns
        note = "in the graph until it vanished" if vanished else "in the graph to the end"
        bar = since(node.appeared_ns), since(max(end_ns, node.appeared_ns))
        lanes.append(Lane(f"node {node.name}", note, bar=bar))
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
        note = f"{counted(len(own), 'endpoint')} came, {len(gone) or 'none'} went"
        came = tuple(since(item.appeared_ns) for item in own)
        lost = tuple(since(time_ns) for time_ns in gone)
        lanes.append(Lane("publishers and subscriptions", note, ticks=came, crosses=lost))
    return lanes


def _draw(
    recording: Recording,
    flags: Sequence[Flag],
    lanes: Sequence[Lane],
    end_s: float,
    name: str,
    width: float,
) -> Markup:
    scale = Scale(0.0, end_s, SIDE, width - SIDE)
    bottom_of_lanes = LANE * len(lanes)
    content, top = draw_flags(flags, scale, bottom_of_lanes)
    for index, lane in enumerate(lanes):
        content += _lane(lane, scale, top + index * LANE, width)
    bottom = top + bottom_of_lanes + 6
    content += time_axis(scale, bottom, width)
    described = [f"{flag.text}" for flag in flags]
    described += [f"{one_line(lane.name)}: {lane.note}" for lane in lanes]
    title = f"Time line of the scenario {recording.scenario}"
    return drawing(name, title, "; ".join(described), (width, bottom + axis.HEIGHT), content)


def _lane(lane: Lane, scale: Scale, top: float, width: float) -> list[Markup]:
    y = top + 18
    note_width = len(lane.note) * 6.3
    drawn = [
        label(fitted(lane.name, width - 2 * SIDE - note_width - 12), SIDE, top + 12, "lane"),
        label(lane.note, width - SIDE, top + 12, anchor="end"),
        element("rect", x=SIDE, y=y, width=width - 2 * SIDE, height=TRACK, rx=3, class_="track"),
    ]
    if lane.bar:
        begin, end = (scale.clipped(time_s) for time_s in lane.bar)
        drawn.append(
            element(
                "rect", x=begin, y=y, width=max(2.0, end - begin), height=TRACK, rx=3, class_="bar"
            )
        )
    if lane.ticks:
        places = columns(scale.all_clipped(lane.ticks))
        stroke = f" {y + 1:g}v{TRACK - 2}"
        path = "".join([f"M{x:g}{stroke}" for x in places])
        drawn.append(element("path", d=path, class_="tick"))
    if lane.crosses:
        places = columns(scale.all_clipped(lane.crosses))
        drawn.append(crosses([(x, y + TRACK / 2) for x in places], "out", 4.0))
    return drawn
