"""The tree of frames that the transforms of a run make."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from markupsafe import Markup

from grader.measure.transforms import Sent, roots, sent
from grader.recording.model import NS, Recording
from grader.report.drawing import svg

ROW, INDENT, MOST_ROWS = 24, 22, 60

Row = tuple[int, str, list[Sent]]
"""How deep a frame is in the tree, its name, and the transforms from its parent."""


def draw_frames(recording: Recording, name: str) -> svg.Figure | None:
    """Draw each frame below its parent; None in a run without transforms."""
    rows = list(islice(_rows(recording), MOST_ROWS))
    if not rows:
        return None

    def draw(width: float) -> tuple[float, list[Markup]]:
        drawn: list[Markup] = []
        # Row and column of the newest frame of each depth.
        above: list[float] = []
        for index, (depth, frame, found) in enumerate(rows):
            x, y = svg.LETTER + depth * INDENT, ROW * (index + 0.5)
            note = _note(found)
            if depth:
                class_ = "command" if _is_static(found) else "true"
                left = x - INDENT + 4
                drawn.append(svg.line(left, above[depth - 1] + 6, left, y, class_))
                drawn.append(svg.line(left, y, x - 4, y, class_))
            above[depth:] = [y]
            room = width - x - len(note) * svg.LETTER - 12
            drawn.append(svg.label(svg.fitted(frame, room), x, y + 4, "lane"))
            drawn.append(svg.label(note, width, y + 4, anchor="end"))
        return ROW * len(rows) + 4.0, drawn

    caption = "The frames, each below its parent. Dashed: static. Solid: with the rate in Hz."
    title = f"Frames in the scenario {recording.scenario}"
    described = "; ".join(f"{frame}, {_note(found)}" for _, frame, found in rows)
    return svg.figure(name, title, caption, draw, f"{caption} {described}.")


def _rows(recording: Recording) -> Iterator[Row]:
    children: dict[str, dict[str, list[Sent]]] = {}
    there = list(sent(recording, recording.messages))
    for one in there:
        children.setdefault(one.parent, {}).setdefault(one.child, []).append(one)
    shown: set[str] = set()

    def below(depth: int, frame: str, found: list[Sent]) -> Iterator[Row]:
        yield depth, frame, found
        # A frame with two parents stands below both, and what is below it only once.
        if frame not in shown:
            shown.add(frame)
            for child, more in children.get(frame, {}).items():
                yield from below(depth + 1, child, more)

    for root in roots(there):
        yield from below(0, root, [])


def _is_static(found: list[Sent]) -> bool:
    return found[0].message.topic.endswith("_static")


def _note(found: list[Sent]) -> str:
    if not found or _is_static(found):
        return "static" if found else "root"
    span_s = (found[-1].message.stamp_ns - found[0].message.stamp_ns) / NS
    return f"{(len(found) - 1) / span_s:.3g} Hz" if span_s > 0.0 else "once"
