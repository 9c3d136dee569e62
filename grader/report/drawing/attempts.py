"""The scores of a student's attempts, one bar each."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from grader.findings.wording import counted
from grader.report.drawing.svg import Figure, element, figure, label, line
from grader.report.model.result_model import AttemptPart
from grader.report.text.words import number

HEIGHT, TOP, BOTTOM = 120, 22, 22
WIDEST = 56.0
"""Of a bar with the room around it, in pixels."""
ROOM = 28.0
"""What the numbers of a bar need, in pixels."""


def draw_attempts(attempts: Sequence[AttemptPart], name: str) -> Figure:
    """Draw the score of each attempt; one without a score has a question mark and no bar."""
    most = max([1.0, *(one.max_score for one in attempts)])

    def draw(width: float) -> tuple[float, list[Markup]]:
        step, bottom = min(WIDEST, width / len(attempts)), HEIGHT - BOTTOM
        content = [line(0, TOP, step * len(attempts), TOP, "band-edge")]
        for index, one in enumerate(attempts):
            middle = (index + 0.5) * step
            height = (bottom - TOP) * (one.score or 0.0) / most
            bar = {"x": middle - step / 2 + 2, "y": bottom - height, "width": step - 4}
            kind = "count full" if one.counts else "count"
            content.append(element("rect", class_=kind, height=height, **bar))
            if step >= ROOM or index in (0, len(attempts) - 1):
                shown = "?" if one.score is None else number(round(one.score, 1))
                content.append(label(shown, middle, bottom - height - 5, "lane", anchor="middle"))
                content.append(label(str(index + 1), middle, HEIGHT - 6, anchor="middle"))
        content.append(line(0, bottom, step * len(attempts), bottom, "axis"))
        return HEIGHT, content

    caption = f"Scores of {counted(len(attempts), 'attempt')}; the line is {number(most)} points."
    return figure(name, "Scores of the attempts", caption, draw)
