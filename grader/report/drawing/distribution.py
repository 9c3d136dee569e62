"""How the scores of a class are distributed."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from grader.findings.words import counted
from grader.report.drawing.svg import NARROW, Figure, element, figure, label, line
from grader.report.text.words import counted_points, number

HEIGHT, TOP, BOTTOM = 190, 22, 40
BINS = 10
APART = 14.0
"""Pixels between the other scores and full points."""


def draw_distribution(scores: Sequence[float], most: float, name: str) -> Figure | None:
    """Draw a histogram of scores, with full points apart; None where there is no score."""
    if not scores or most <= 0.0:
        return None
    counts = [0] * (BINS + 1)
    for score in scores:
        counts[BINS if score >= most else max(0, int(BINS * score / most))] += 1
    least = [number(round(most * index / BINS, 4)) for index in range(BINS + 1)]

    def draw(width: float) -> tuple[float, list[Markup]]:
        step, bottom = (width - APART) / len(counts), HEIGHT - BOTTOM
        content = []
        for index, count in enumerate(counts):
            full = index == BINS
            x = index * step + (APART if full else 0.0)
            height = (bottom - TOP) * count / max(counts)
            kind = "count full" if full else "count"
            bar = {"x": x + 2, "y": bottom - height, "width": step - 4, "height": height}
            content.append(element("rect", class_=kind, **bar))
            if count:
                top = bottom - height - 6
                content.append(label(str(count), x + step / 2, top, "lane", anchor="middle"))
            if full or index % (2 if width > NARROW else 5) == 0:
                place, anchor = x + step / 2 if full else x, "middle" if index else "start"
                content.append(label(least[index], place, bottom + 18, anchor=anchor))
        content.append(line(0, bottom, width, bottom, "axis"))
        content.append(label("score (points)", width, HEIGHT - 4, anchor="end"))
        return HEIGHT, content

    caption = (
        f"Scores of {counted(len(scores), 'submission')}, in steps of "
        f"{counted_points(most / BINS)}; full points stand apart at the right."
    )
    bins = zip(least, counts, strict=True)
    described = ", ".join(f"{value} or more: {count}" for value, count in bins if count)
    return figure(name, "Distribution of the scores", caption, draw, f"{caption} {described}")
