"""The ground plan of a world, drawn in metres: what stands still, what moves, a scale.

All content goes into one group that is scaled from metres to pixels, with y upwards (REP-103);
widths of strokes are in metres where they are true widths, else in pixels.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from grader.recording.model import NS
from grader.recording.simulated import Scene
from grader.report.drawing.svg import Point, element, label, line, simplified
from sim.motion import Pose
from sim.shapes import MovingObstacle

MARGIN_M = 0.15
"""Shown around what matters."""
FAR_M = 0.35
"""So far from the path a wall still widens the picture."""
PX = "non-scaling-stroke"


@dataclass(frozen=True)
class View:
    """What part of a world is shown, and how large; ``scale`` is in pixels for a metre."""

    left_m: float
    top_m: float
    scale: float
    width: float
    height: float

    def pixel(self, x_m: float, y_m: float) -> Point:
        """Where a position lies in the drawing."""
        return (x_m - self.left_m) * self.scale, (self.top_m - y_m) * self.scale

    @property
    def matrix(self) -> str:
        """The same as an SVG transform."""
        x, y = -self.left_m * self.scale, self.top_m * self.scale
        return f"matrix({self.scale:.2f} 0 0 {-self.scale:.2f} {x:.2f} {y:.2f})"


def fit(points: Iterable[Point], scene: Scene, width: float, lowest: float, highest: float) -> View:
    """Choose the part of the world to show: the path, the robot, and what is near it.

    Args:
        points: Positions that must be seen, in metres; at least one.
        lowest: The least height of the drawing in pixels; ``width`` and ``highest`` likewise.
    """
    found = list(points)
    reach = scene.radius_m + MARGIN_M
    x1, x2 = min(x for x, _ in found) - reach, max(x for x, _ in found) + reach
    y1, y2 = min(y for _, y in found) - reach, max(y for _, y in found) + reach
    for x, y in _near(scene, (x1 - FAR_M, y1 - FAR_M, x2 + FAR_M, y2 + FAR_M)):
        x1, x2 = min(x1, x - MARGIN_M), max(x2, x + MARGIN_M)
        y1, y2 = min(y1, y - MARGIN_M), max(y2, y + MARGIN_M)
    scale = min(width / (x2 - x1), highest / (y2 - y1))
    height = max(lowest, min(highest, (y2 - y1) * scale))
    left_m = (x1 + x2) / 2.0 - width / scale / 2.0
    top_m = (y1 + y2) / 2.0 + height / scale / 2.0
    return View(left_m, top_m, scale, width, height)


def _near(scene: Scene, box: tuple[float, float, float, float]) -> Iterable[Point]:
    """Points of the outlines, moved into a box that they reach into."""
    x1, y1, x2, y2 = box
    for capsules in scene.outlines.values():
        for ax, ay, bx, by, _ in capsules:
            if max(ax, bx) >= x1 and min(ax, bx) <= x2 and max(ay, by) >= y1 and min(ay, by) <= y2:
                yield min(max(ax, x1), x2), min(max(ay, y1), y2)
                yield min(max(bx, x1), x2), min(max(by, y1), y2)


def world(scene: Scene, view: View) -> list[Markup]:
    """Draw the grid, the lines on the floor, and what stands still, in metres."""
    drawn = [_grid(view), *(track(points, "floor-line") for points in scene.lines)]
    for capsules in scene.outlines.values():
        thin = [(c[:4]) for c in capsules if c[4] == 0.0]
        if thin:
            path = "".join(f"M{_m(a)} {_m(b)}L{_m(c)} {_m(d)}" for a, b, c, d in thin)
            drawn.append(element("path", d=path, class_="wall", vector_effect=PX))
        for x1, y1, x2, y2, radius in capsules:
            if radius > 0.0:
                # A length of zero is drawn as a dot, as long as it has a length at all.
                path = f"M{_m(x1)} {_m(y1)}L{_m(x2 + 1e-4)} {_m(y2)}"
                drawn.append(element("path", d=path, class_="thing", stroke_width=_m(2.0 * radius)))
    return drawn


def moving(scene: Scene, until_s: float) -> list[Markup]:
    """Draw where the things that move have been, and where they are at a time, in metres."""
    drawn = []
    for obstacle in scene.moving:
        seen = [place for place in places(obstacle, until_s) if place is not None]
        if not seen:
            continue
        drawn.append(track(simplified([(p.x_m, p.y_m) for p in seen], 0.005), "moved"))
        last = seen[-1]
        if obstacle.radius_m is not None:
            drawn.append(disc(last.x_m, last.y_m, obstacle.radius_m, "mover"))
        else:
            corners = obstacle.shape_at(last).corners
            drawn.append(track([*corners, *corners[:1]], "mover"))
    return drawn


def places(obstacle: MovingObstacle, until_s: float) -> list[Pose | None]:
    """Where something is every 0.1 s from the start of the simulation; None where it is not."""
    return [obstacle.pose_at(tenth * NS // 10) for tenth in range(int(until_s * 10.0) + 1)]


def disc(x_m: float, y_m: float, radius_m: float, class_: str) -> Markup:
    """A circle, in metres."""
    return element(
        "circle", cx=_m(x_m), cy=_m(y_m), r=_m(radius_m), class_=class_, vector_effect=PX
    )


def track(points: Sequence[Point], class_: str) -> Markup:
    """A line, in metres."""
    path = "M" + "L".join(f"{_m(x)} {_m(y)}" for x, y in points)
    return element("path", d=path, class_=class_, vector_effect=PX)


def scale_bar(view: View) -> list[Markup]:
    """Say how long a grid square is."""
    length_m = _square_m(view)
    y, begin = view.height - 10.0, 10.0
    end = begin + length_m * view.scale
    return [
        line(begin, y, end, y, "scale"),
        line(begin, y - 4, begin, y + 4, "scale"),
        line(end, y - 4, end, y + 4, "scale"),
        label(f"{length_m:g} m", end + 8, y + 4),
    ]


def _grid(view: View) -> Markup:
    step = _square_m(view)
    right_m = view.left_m + view.width / view.scale
    bottom_m = view.top_m - view.height / view.scale
    columns = range(math.ceil(view.left_m / step), math.floor(right_m / step) + 1)
    rows = range(math.ceil(bottom_m / step), math.floor(view.top_m / step) + 1)
    path = "".join(f"M{_m(i * step)} {_m(bottom_m)}V{_m(view.top_m)}" for i in columns)
    path += "".join(f"M{_m(view.left_m)} {_m(i * step)}H{_m(right_m)}" for i in rows)
    return element("path", d=path, class_="grid", vector_effect=PX)


def _square_m(view: View) -> float:
    return next(
        (step for step in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0) if step * view.scale >= 44.0), 10.0
    )


def _m(value: float) -> str:
    """Metres to the millimetre."""
    return f"{value:.3f}".rstrip("0").rstrip(".") if value else "0"
