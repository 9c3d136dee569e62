"""How the scores of a class are distributed."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from grader.checks.wording import counted
from grader.report.drawing.svg import NARROW, WIDE, Figure, drawing, element, label, line
from grader.report.text.words import counted_points, number

HEIGHT, TOP, BOTTOM = 190, 22, 40
BINS = 10


def draw_distribution(scores: Sequence[float], most: float, name: str) -> Figure | None:
    """Draw a histogram of scores, with full points apart.

    Args:
        name: Unique in the document; letters, digits and hyphens.

    Returns:
        The drawing, or None where nobody was graded.
    """
    if not scores or most <= 0.0:
        return None
    counts = [0] * (BINS + 1)
    for score in scores:
        counts[BINS if score >= most else max(0, int(BINS * score / most))] += 1
    caption = (
        f"Scores of {counted(len(scores), 'submission')}, in steps of "
        f"{counted_points(most / BINS)}; full points stand apart at the right."
    )
    return Figure(
        caption,
        _draw(counts, most, caption, f"{name}-wide", WIDE),
        _draw(counts, most, caption, f"{name}-narrow", NARROW),
    )


def _draw(counts: Sequence[int], most: float, caption: str, name: str, width: float) -> Markup:
    standalone_build = 14.0
    step = (width - standalone_build) / len(counts)
    bottom = HEIGHT - BOTTOM
    highest = max(counts)
    content = []
    for index, count in enumerate(counts):
        x = index * step + (standalone_build if index == BINS else 0.0)
        height = (bottom - TOP) * count / highest
        kind = "count full" if index == BINS else "count"
        content.append(
            element("rect", x=x + 2, y=bottom - height, width=step - 4, height=height, class_=kind)
        )
        if count:
            content.append(
                label(str(count), x + step / 2, bottom - height - 6, "lane", anchor="middle")
            )
        if index == BINS or index % (2 if width > NARROW else 5) == 0:
            value = most * index / BINS
            place = x + step / 2 if index == BINS else x
            anchor = "middle" if index else "start"
            content.append(label(number(round(value, 4)), place, bottom + 18, anchor=anchor))
    content.append(line(0, bottom, width, bottom, "axis"))
    content.append(label("score (points)", width, HEIGHT - 4, anchor="end"))
    described = f"{caption} " + ", ".join(
        f"{number(round(most * index / BINS, 4))} or more: {count}"
        for index, count in enumerate(counts)
        if count
    )
    return drawing(name, "Distribution of the scores", described, (width, HEIGHT), content)
