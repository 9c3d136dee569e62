"""How often each value of a plot occurs, as bars beside it on the same axis."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from grader.report.drawing.svg import Scale, element, label, line

BIN = 8
"""Height of a bar, in pixels."""


def bars(values: Sequence[float], y: Scale, left: float, right: float) -> list[Markup]:
    """Draw a histogram beside a plot, with its counts to the right.

    Args:
        y: Its axis; ``begin`` is the lower end.
        left: First pixel.
        right: Last pixel.
    """
    counts: dict[int, int] = {}
    for value in values:
        row = int((y.begin - y.clipped(value)) // BIN)
        counts[row] = counts.get(row, 0) + 1
    drawn = [line(left, y.begin, left, y.end, "axis")]
    if not counts:
        return drawn
    most = max(counts.values())
    for row, count in sorted(counts.items()):
        top = max(y.end, y.begin - (row + 1) * BIN)
        width = (right - left) * count / most
        drawn.append(
            element(
                "rect", x=left, y=top + 1, width=max(1.5, width), height=BIN - 2, class_="count"
            )
        )
    drawn.append(label("0", left, y.begin + 18, anchor="middle"))
    drawn.append(label(str(most), right, y.begin + 18, anchor="end"))
    return drawn
