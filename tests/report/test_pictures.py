"""The pictures of a run: what is drawn, from runs of the real simulator core."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.assignment.model import CheckSpec
from grader.findings.finding import Case, Cases, Comparison, Plot, Span
from grader.recording.event import Breach, Intervention
from grader.recording.model import Qos
from grader.recording.submission import BuildRecord, SourceError
from grader.report.drawing.callbacks import draw_callbacks
from grader.report.drawing.cases import draw_cases
from grader.report.drawing.motion import draw_motion, phases
from grader.report.drawing.path import Target, draw_path, targets
from grader.report.drawing.plot import draw_plot
from grader.report.drawing.svg import simplified
from grader.report.drawing.timeline import draw_timeline
from grader.report.html.report import Gallery, build_lines
from grader.report.html.tables import SIGNS, align, pairs
from sim.motion import Pose
from tests.checks.builder import drive, endpoint, node, on_odometry, output, reader, recording
from tests.report.gallery import CALLS, CASES, DEFINITION, ahead_until
from tests.report.page import description, is_finite, marks, of_class, words
from tests.report.sample import at, make_run


@pytest.fixture(scope="module")
def stopped():
    return ahead_until(0.2)


@pytest.fixture(scope="module")
def touched():
    return ahead_until(0.0)


class TestPath:
    def test_it_says_how_far_before_the_wall_the_robot_stopped(self, stopped):
        figure = draw_path(stopped, (), "p")
        # The wall is at 0.6 m; the robot drives with 0.1 m/s and sees 5 times a second.
        told = figure.caption.partition("obstacle ")[2].partition(" m ahead")[0]
        assert 0.17 <= float(told) <= 0.2
        assert of_class(figure.wide, "measure") and of_class(figure.narrow, "measure")
        assert f"{told} m" in words(figure.wide)

    def test_a_contact_is_marked_and_named(self, touched):
        figure = draw_path(touched, (), "p")
        assert "1 contact with a wall (marked ×)" in figure.caption
        assert len(of_class(figure.wide, "out")) == 1

    def test_headings_world_and_scale_are_drawn(self, stopped):
        wide = draw_path(stopped, (), "p").wide
        assert of_class(wide, "arrow")[0].get("d").count("M") >= 3
        assert of_class(wide, "wall") and of_class(wide, "mover") and of_class(wide, "moved")
        assert "start" in words(wide) and "end" in words(wide) and "0.2 m" in words(wide)

    def test_where_it_should_end(self, stopped):
        target = Target(Pose(0.4, 0.1, 0.0), 0.08)
        figure = draw_path(stopped, (target,), "p")
        (circle,) = of_class(figure.wide, "target")
        assert [float(circle.get(key)) for key in ("cx", "cy", "r")] == [0.4, 0.1, 0.08]
        assert "goal" in words(figure.wide).split() and "goal" in words(figure.narrow).split()
        away_m = math.dist((stopped.truth[-1].x_m, stopped.truth[-1].y_m), (0.4, 0.1))
        told = figure.caption.partition("It ended ")[2].partition(" from the goal")[0]
        assert told == (f"{away_m:.3g} m" if away_m >= 0.1 else f"{away_m * 100:.3g} cm")
        assert "the dashed circle is the tolerance, 8 cm." in figure.caption

    def test_the_places_of_a_route_have_their_numbers(self, stopped):
        checks = [
            {
                "id": "round",
                "uses": "motion.visits",
                "points": 1,
                "with": {"places": [[0.3, 0.0], [0.2, 0.1, 0.4, 0.3]], "position": "5 cm"},
            }
        ]
        lesson = SimpleNamespace(
            checks=[CheckSpec.model_validate(one) for one in checks], scenarios=()
        )
        point, zone = targets(lesson, "run", {})
        assert (point.radius_m, zone.corners[0], zone.corners[2]) == (0.05, (0.2, 0.1), (0.4, 0.3))
        figure = draw_path(stopped, (point, zone), "p")
        assert len(of_class(figure.wide, "target")) == 2
        assert {"1", "2"} <= set(words(figure.wide).split())
        assert "goal" not in words(figure.wide).split()
        assert figure.caption.count("The numbers are the places to visit") == 1

    def test_a_robot_that_stands(self):
        run = drive(lambda _: None, world="{segments: [[1, -1, 1, 1]]}", seconds=1.0)
        assert draw_path(run, (), "p").caption == "The robot did not move."
        caption = draw_path(run, (Target(Pose(0.5, 0.0, 0.0), 0.1),), "p").caption
        assert caption.startswith("The robot did not move. It ended 0.5 m from the goal;")


class TestMotion:
    def test_phases_follow_what_the_robot_did(self):
        def law(pose):
            return (0.1, 0.0) if pose.x_m < 0.2 else (0.0, 0.5)

        run = drive(on_odometry(law), seconds=6.0, rest_s=None)
        found = [phase.kind for phase in phases(run)]
        assert found[0] in ("rests", "drives")
        assert [what for what in found if what not in ("rests", "drives and turns")] == [
            "drives",
            "turns",
        ]
        assert all(a.end_s == b.begin_s for a, b in zip(phases(run), phases(run)[1:], strict=False))

    def test_the_limit_is_drawn_where_it_is_near(self):
        fast = drive(on_odometry(lambda _: (0.5, 0.0)), seconds=3.0)
        slow = drive(on_odometry(lambda _: (0.05, 0.0)), seconds=3.0)
        wide = draw_motion(fast, "m").wide
        assert "limit 0.22 m/s" in words(wide) and "turn (rad/s)" in words(wide)
        assert len(of_class(wide, "command")) == len(of_class(wide, "true")) == 2
        assert draw_motion(make_run(), "m") is None and draw_path(make_run(), (), "p") is None
        assert "limit" not in words(draw_motion(slow, "m").wide)


class TestTimeline:
    def test_nodes_and_endpoints_come_and_go(self):
        run = recording(
            nodes=(node("/bot_publisher", appeared_s=0.3, vanished_s=1.0),),
            endpoints=(replace(endpoint(), vanished_ns=endpoint().appeared_ns + 500_000_000),),
        )
        svg = draw_timeline(run, (), "t").wide
        assert "node /bot_publisher: in the graph until it vanished" in description(svg)
        assert "publishers and subscriptions: 1 endpoint came, 1 went" in description(svg)

    def test_signals_messages_and_limits_are_shown(self):
        run = make_run(
            interventions=(Intervention(at(1.5), "bot_publisher/bot_pub", "kill", "SIGKILL"),),
            sent={"/chatter": make_run().messages["/cmd_vel"]},
            breaches=(Breach(at(0.8), "memory", "1056 MiB of memory", "1024 MiB"),),
        )
        shown = words(draw_timeline(run, (), "t").wide)
        assert "SIGKILL from the scenario 1.50 s" in shown
        assert "to /chatter 4 messages sent" in shown
        assert "limits of the sandbox reached: memory" in shown

    def test_a_traceback_after_our_own_ctrl_c_is_no_cross(self):
        shown = {}
        for time_s in (1.5, 1.9):
            log = output("Traceback (most recent call last):\nKeyboardInterrupt", time_s=time_s)
            run = recording(log=log, stop_s=1.8, end_s=2.0)
            shown[time_s] = words(draw_timeline(run, (), "t").wide)
        assert "2 lines, 1 error" in shown[1.5] and "error" not in shown[1.9]

    def test_errors_in_the_output_are_crosses(self, stopped):
        svg = draw_timeline(stopped, (), "t").wide
        assert "2 lines, 1 error" in words(svg)


class TestHistogram:
    def test_equal_values_are_one_long_bar(self):
        y = (300.0,) * 9 + (340.0,)
        plot = Plot("Period", "t (s)", "period (ms)", tuple(range(10)), y, (285.0, 315.0), True)
        bars = of_class(draw_plot(plot, "p").wide, "count")
        lengths = sorted(float(bar.get("width")) for bar in bars)
        assert len(lengths) == 2 and lengths[1] / lengths[0] == pytest.approx(9.0, rel=0.01)


class TestCallbacks:
    def test_a_row_for_each_name_and_a_bar_for_each_call(self):
        figure = draw_callbacks(CALLS, "c")
        bars = of_class(figure.wide, "span")
        assert len(bars) == 3 and len(of_class(figure.wide, "wrong")) == 1
        assert len({bar.get("y") for bar in bars}) == 2
        assert "2 calls, 400 ms each" in words(figure.wide)
        assert "timer_2" in figure.caption

    @given(st.lists(st.builds(Span, st.text(max_size=9), st.floats(), st.floats(), st.booleans())))
    @settings(max_examples=60, deadline=None)
    def test_a_drawing_of_any_reports_is_finite(self, spans):
        figure = draw_callbacks(spans, "c")
        assert figure is None or is_finite(figure.wide)


class TestCases:
    def test_wrong_and_missing_cases_are_marked_and_counted(self):
        figure = draw_cases(CASES, "c")
        assert marks(figure.wide, "out") == 5
        assert marks(figure.wide, "dots") == 20
        assert len(of_class(figure.wide, "missing")) == 1
        assert figure.caption == (
            "Rotations from axis and angle: 26 cases, 5 beyond the limit of 0.01 deg (marked ×), "
            "1 without an answer (marked ?), of the kind gimbal lock, zero. "
            "The scale is logarithmic."
        )

    @given(st.lists(st.none() | st.floats()), st.floats(1e-12, 1e12))
    @settings(max_examples=60, deadline=None)
    def test_a_drawing_of_any_errors_is_finite(self, errors, limit):
        cases = Cases("t", "e (deg)", limit, tuple(Case("c", "g", error) for error in errors))
        assert is_finite(draw_cases(cases, "c").wide)


class TestComparison:
    def test_lines_are_put_beside_each_other_by_what_they_say(self):
        rows = align(DEFINITION)
        assert [(row.kind, SIGNS[row.kind]) for row in rows] == [
            ("changed", "≠"),
            ("same", ""),
            ("missing", "−"),
            ("same", ""),
            ("extra", "+"),
        ]
        changed = rows[0]
        assert [text for text, differs in changed.expected if differs] == ["1"]
        assert [text for text, differs in changed.observed if differs] == ["0"]

    @given(st.lists(st.text("ab \n", max_size=5)), st.lists(st.text("ab \n", max_size=5)))
    def test_no_line_is_lost(self, expected, observed):
        rows = align(Comparison("t", tuple(expected), tuple(observed)))
        assert sum(row.kind != "extra" for row in rows) == len(expected)
        assert sum(row.kind != "missing" for row in rows) == len(observed)


class TestQos:
    def test_what_does_not_match_says_by_which_policy(self):
        offered = endpoint(qos=Qos(reliability="best_effort", durability="volatile"))
        wanted = reader(qos=Qos(reliability="reliable", durability="volatile"))
        (pair,) = pairs(recording(endpoints=(offered, wanted)))
        assert pair.publisher == "/bot_publisher" and pair.subscription == "the grader"
        assert ("reliability", "best_effort", "reliable") in pair.cells
        assert pair.refused == {"reliability"} and not pair.types_differ


class TestBuildLog:
    def test_the_students_own_line_comes_first(self):
        told = [
            'File "src/b/setup.py", line 7',
            "    entry_points={",
            "SyntaxError: '{' was never closed",
            "Failed",
        ]
        log = "\n".join([*(f"noise {i}" for i in range(50)), *told])
        culprit = SourceError("src/b/setup.py", 7, "SyntaxError: '{' was never closed")
        found = build_lines(BuildRecord(False, 1.0, culprit=culprit, log=log))
        hits = [text for text, hit in found if hit]
        assert hits == ['File "src/b/setup.py", line 7', "SyntaxError: '{' was never closed"]
        assert len(found) < 15

    def test_a_log_that_does_not_tell_is_shown_as_it_is(self):
        assert build_lines(BuildRecord(False, 1.0, log="Failed <<< bot")) == []


SPEED = Plot("Speed", "t (s)", "v (m/s)", (0.0, 1.0), (0.0, 0.1))


def test_the_same_plot_of_the_same_run_is_drawn_once():
    gallery = Gallery()
    assert gallery.plot(SPEED, "one", "ahead")[1] is not None
    assert gallery.plot(SPEED, "two", "ahead") == ("one", None)
    assert gallery.plot(SPEED, "three", "other")[1] is not None


def test_a_plot_that_is_folded_up_is_drawn_again_where_it_is_open():
    gallery = Gallery()
    assert gallery.plot(SPEED, "one", "ahead", folded=True)[1] is not None
    assert gallery.plot(SPEED, "two", "ahead")[1] is not None
    assert gallery.plot(SPEED, "three", "ahead", folded=True) == ("two", None)


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)), min_size=1, max_size=40))
def test_a_simplified_line_keeps_its_ends_and_comes_near_to_every_point(points):
    kept = simplified(points, 0.5)
    assert kept[0] == points[0] and kept[-1] == points[-1] and set(kept) <= set(points)
    pairs_of_ends = list(pairwise(kept)) or [(kept[0], kept[0])]
    for point in points:
        assert min(distance(point, *ends) for ends in pairs_of_ends) <= 0.5 + 1e-6


def distance(point, begin, end):
    """Of a point from the line through two others, or from one of them where they are near."""
    length = math.dist(begin, end)
    if length <= 0.5:
        return min(math.dist(point, begin), math.dist(point, end))
    (x, y), (x1, y1), (x2, y2) = point, begin, end
    return abs((x2 - x1) * (y - y1) - (y2 - y1) * (x - x1)) / length
