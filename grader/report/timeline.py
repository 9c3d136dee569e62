"""The time line of a run: what happened when, from the launch to the end of the process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.checks.finding import Moment
from grader.checks.wording import counted
from grader.recording.model import Process, Recording
from grader.report.clean import one_line
from grader.report.flags import Flag, draw_flags
from grader.report.sections import printed
from grader.report.svg import (
    NARROW,
    WIDE,
    Figure,
    Scale,
    columns,
    cross,
    drawing,
    element,
    fitted,
    label,
    line,
    ticks,
)

LANE = 36
TRACK = 12
SIDE = 6


@dataclass(frozen=True)
class Lane:
    """A row of the time line; all times in seconds since launch.

    Attributes:
        name: Whose it is.
        note: What is to be seen in it, in words.
        bar: From when to when it was there, or None.
        ticks: Single events.
        crosses: Single events that went wrong.
    """

    name: str
    note: str
    bar: tuple[float, float] | None = None
    ticks: tuple[float, ...] = ()
    crosses: tuple[float, ...] = ()


def draw_timeline(recording: Recording, moments: Sequence[Moment], name: str) -> Figure | None:
    """Draw the time line of a run.

    Args:
        recording: The run.
        moments: Times that findings point at.
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
    if any(process.stopped_by != "itself" for process in recording.processes):
        add(recording.stop_ns, "SIGINT")
    for process in recording.processes:
        add(process.exited_ns, _exit(process))
    return tuple(sorted(flags, key=lambda flag: flag.time_s))


def _exit(process: Process) -> str:
    if process.exit_code is not None and process.exit_code < 0:
        return f"ended by signal {-process.exit_code} at"
    return f"exit {process.exit_code} at"


def _lanes(recording: Recording, moments: Sequence[Moment]) -> list[Lane]:
    since = recording.since_launch_s
    lanes = []
    for process in recording.processes:
        end_ns = recording.end_ns if process.exited_ns is None else process.exited_ns
        begin, end = since(process.started_ns), since(end_ns)
        lanes.append(Lane(process.name, f"ran for {end - begin:.2f} s", bar=(begin, end)))
    for topic, messages in sorted(recording.messages.items()):
        times = tuple(since(message.stamp_ns) for message in messages)
        lanes.append(Lane(topic, counted(len(times), "message"), ticks=times))
    if recording.calls:
        lost = [call for call in recording.calls if call.answered_ns is None]
        note = counted(len(recording.calls), "call")
        lanes.append(
            Lane(
                "parameter service",
                f"{note}, {len(lost)} without an answer" if lost else f"{note}, all answered",
                ticks=tuple(
                    since(call.requested_ns)
                    for call in recording.calls
                    if call.answered_ns is not None
                ),
                crosses=tuple(since(call.requested_ns) for call in lost),
            )
        )
    lines = tuple(since(entry.time_ns) for entry in printed(recording))
    lanes.append(Lane("output", counted(len(lines), "line"), ticks=lines))
    if moments:
        lanes.append(
            Lane(
                "findings",
                counted(len(moments), "moment"),
                crosses=tuple(moment.time_s for moment in moments),
            )
        )
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
    content.append(line(SIDE, bottom, width - SIDE, bottom, "axis"))
    for value, text in ticks(0.0, end_s, 10 if width > NARROW else 5):
        x = scale(value)
        content.append(line(x, bottom, x, bottom + 5, "axis"))
        anchor = "start" if x < 20 else "end" if x > width - 20 else "middle"
        content.append(label(text, x, bottom + 18, anchor=anchor))
    content.append(label("time since launch (s)", width - SIDE, bottom + 34, anchor="end"))
    described = [f"{flag.text}" for flag in flags]
    described += [f"{one_line(lane.name)}: {lane.note}" for lane in lanes]
    title = f"Time line of the scenario {recording.scenario}"
    return drawing(name, title, "; ".join(described), (width, bottom + 40), content)


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
    for x in columns([scale.clipped(time_s) for time_s in lane.ticks]):
        drawn.append(line(x, y + 1, x, y + TRACK - 1, "tick"))
    for x in columns([scale.clipped(time_s) for time_s in lane.crosses]):
        drawn.append(cross(x, y + TRACK / 2, "out", 4.0))
    return drawn
