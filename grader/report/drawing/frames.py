"""The tree of frames that the transforms of a run make."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from markupsafe import Markup

from grader.measure.transforms import Sent, is_static, roots, sent
from grader.recording.model import NS, Recording
from grader.report.drawing import svg

ROW, INDENT, MOST_ROWS = 24, 22, 60


def draw_frames(recording: Recording, name: str) -> svg.Figure | None:
    """Draw each frame below its parent; None in a run without transforms."""
    rows = list(islice(_rows(recording), MOST_ROWS))
    if not rows:
        return None
    frames = [frame for _, frame, _ in rows]

    def draw(width: float) -> tuple[float, list[Markup]]:
        drawn: list[Markup] = []
        # Where the newest frame of each depth is.
        above: list[float] = []
        for index, (depth, frame, note) in enumerate(rows):
            x, y, twice = 6.0 + depth * INDENT, ROW * (index + 0.5), frames.count(frame) > 1
            if depth:
                class_, left = "command" if note == "static" else "true", x - INDENT + 4
                drawn.append(svg.line(left, above[depth - 1] + 6, left, y, class_))
                drawn.append(svg.line(left, y, x - 4, y, class_))
            above[depth:] = [y]
            told = f"{note}, two parents" if twice else note
            shown = svg.fitted(frame, width - x - (len(told) + 3) * svg.LETTER)
            drawn.append(svg.label(shown, x, y + 4, "missing" if twice else "lane"))
            drawn.append(svg.label(told, width, y + 4, anchor="end"))
        return ROW * len(rows) + 4.0, drawn

    caption = "The frames, each below its parent. Dashed: static. Solid: with the rate in Hz."
    described = "; ".join(f"{frame}, {note}" for _, frame, note in rows)
    title = f"Frames in the scenario {recording.scenario}"
    return svg.figure(name, title, caption, draw, f"{caption} {described}.")


def _rows(recording: Recording) -> Iterator[tuple[int, str, str]]:
    """Each frame, with how deep it is in the tree and what there is to say of its transform."""
    there = list(sent(recording, recording.messages))
    children: dict[str, dict[str, list[Sent]]] = {}
    for one in there:
        children.setdefault(one.parent, {}).setdefault(one.child, []).append(one)

    def below(depth: int, frame: str, note: str) -> Iterator[tuple[int, str, str]]:
        yield depth, frame, note
        # What is below a frame with two parents is shown once.
        for child, found in children.pop(frame, {}).items():
            yield from below(depth + 1, child, _note(found))

    for root in roots(there):
        yield from below(0, root, "root")


def _note(found: list[Sent]) -> str:
    first, last = found[0].message, found[-1].message
    span_s = (last.stamp_ns - first.stamp_ns) / NS
    moving = f"{(len(found) - 1) / span_s:.3g} Hz" if span_s > 0.0 else "once"
    return "static" if is_static(first.topic) else moving
