"""Plots and time lines: what is drawn, and that nothing breaks them."""

import math
from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.findings.finding import Plot
from grader.recording.model import Call, Declaration, Ending, Message, Process
from grader.report.drawing.axes import Scale, ticks
from grader.report.drawing.frames import draw_frames
from grader.report.drawing.plot import draw_plot
from grader.report.drawing.svg import NARROW, WIDE
from grader.report.drawing.timeline import Flag, draw_timeline, place
from grader.report.drawing.turtles import draw_turtles
from sim.motion import Pose
from sim.turtles.turtle import Pen, Velocity
from tests.checks.test_tf import TF, TF_STATIC, TIMES, on, run, transform
from tests.checks.turtles import swim
from tests.report.page import description, is_finite, marks, of_class, words
from tests.report.sample import PROCESS, at, make_run

MOVING = on(TF, *((time_s, [transform(stamp_s=time_s)]) for time_s in TIMES))


def make_plot(y, band=(285.0, 315.0), x=None):
    x = tuple(float(i) for i in range(len(y))) if x is None else x
    return Plot("Period of /cmd_vel", "time since launch (s)", "period (ms)", x, tuple(y), band)


class TestPlot:
    def test_values_outside_the_band_are_crosses_and_counted(self):
        figure = draw_plot(make_plot([300.0, 612.0, 310.0, 284.9]), "p")
        assert marks(figure.wide, "dots") == marks(figure.narrow, "dots") == 2
        assert marks(figure.wide, "out") == 2
        assert figure.caption == (
            "Period of /cmd_vel: allowed 285 to 315 ms (shaded), 2 of 4 outside (marked ×)."
        )
        shown = words(figure.wide)
        assert "time since launch (s)" in shown and "period (ms)" in shown

    @pytest.mark.parametrize(
        ("band", "said"),
        [
            ((-math.inf, 0.1), "allowed up to 0.1"),
            ((0.2, math.inf), "allowed from 0.2"),
        ],
    )
    def test_a_band_that_is_open_on_one_side(self, band, said):
        figure = draw_plot(make_plot([0.05, 0.3], band), "p")
        assert said in figure.caption
        assert marks(figure.wide, "out") == 1

    def test_nothing_is_marked_where_nothing_was_judged(self):
        plot = replace(make_plot([900.0, 612.0, 310.0, 284.9]), judged=(2.0, 3.0))
        figure = draw_plot(plot, "p")
        assert (marks(figure.wide, "dots"), marks(figure.wide, "out")) == (3, 1)
        assert "(shaded, where it is judged), 1 of 2 outside (marked ×)" in figure.caption

    def test_values_that_cannot_be_drawn_are_reported(self):
        figure = draw_plot(make_plot([300.0, math.nan, math.inf], None), "p")
        assert figure.caption == ("Period of /cmd_vel: 1 value, 2 not finite and not drawn.")

    def test_of_a_flood_every_extreme_stays(self):
        y = [300.0 + (i % 7) for i in range(50_000)]
        y[31_415], y[27_182] = 900.0, 1.0
        svg = draw_plot(make_plot(y), "p").wide
        assert len(svg) < 30_000
        assert marks(svg, "out") == 2

    @given(
        st.lists(st.tuples(st.floats(), st.floats()), max_size=30),
        st.none() | st.tuples(st.floats(), st.floats()),
    )
    def test_a_drawing_of_any_values_is_whole_and_finite(self, points, band):
        x, y = tuple(p[0] for p in points), tuple(p[1] for p in points)
        figure = draw_plot(make_plot(y, band, x), "p")
        assert is_finite(figure.wide) and is_finite(figure.narrow)


@given(st.floats(-1e12, 1e12), st.floats(1e-6, 1e12), st.integers(2, 10))
def test_ticks_are_round_few_and_inside(low, length, count):
    high = low + length
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        return
    found = ticks(low, high, count)
    slack = 1e-6 * length
    assert len(found) <= 2.6 * count + 1
    assert all(low - slack <= value <= high + slack for value, _ in found)


def test_ticks_are_written_with_the_digits_that_they_need():
    assert [text for _, text in ticks(0.0, 4.4, 5)] == ["0", "1", "2", "3", "4"]
    assert [text for _, text in ticks(0.3, 0.5, 4)] == ["0.30", "0.35", "0.40", "0.45", "0.50"]
    assert [text for _, text in ticks(-3e6, 3e6, 3)] == ["-2e+06", "0", "2e+06"]


class TestFlags:
    def test_labels_that_would_collide_go_down(self):
        flags = [Flag(0.39, "node"), Flag(0.44, "matched"), Flag(0.45, "first message")]
        placed = place(flags, Scale(0.0, 5.0, 0.0, 700.0))
        assert [item.row for item in placed] == [0, 1, 2]

    def test_at_the_right_end_labels_lie_left_of_their_time(self):
        flags = [Flag(9.9, "SIGINT"), Flag(10.0, "exit 0")]
        placed = place(flags, Scale(0.0, 10.0, 0.0, 700.0))
        assert [(item.left, item.row) for item in placed] == [(True, 1), (True, 0)]

    @given(
        st.lists(st.floats(0, 10), min_size=1, max_size=9),
        st.sampled_from([NARROW, WIDE]),
        st.integers(1, 25),
    )
    def test_no_label_meets_another_label(self, times, width, length):
        flags = [Flag(time_s, "x" * length) for time_s in sorted(times)]
        placed = place(flags, Scale(0.0, 10.0, 0.0, float(width)))
        assert [item.flag for item in placed] == flags
        for one, other in combinations(placed, 2):
            if one.row == other.row:
                first, second = sorted([one.extent, other.extent])
                assert first[1] <= second[0] + 1


class TestTimeline:
    def test_what_happened_is_labelled_with_its_time(self):
        shown = words(draw_timeline(make_run(), (), "t").wide)
        for label in (
            "launch",
            "node /bot_publisher 0.39 s",
            "matched 0.44 s",
            "first message 0.45 s",
            "SIGINT 1.80 s",
            "exit 0 at 1.90 s",
        ):
            assert label in shown

    def test_every_lane_says_in_words_what_is_in_it(self):
        svg = draw_timeline(make_run(), (0.75,), "t").wide
        for text in (
            "bot_publisher/bot_pub: ran for 1.90 s",
            "/cmd_vel: 4 messages",
            "parameter service: 2 calls, 1 cut off by the end",
            "output: 1 line",
            "findings: 1 moment",
        ):
            assert text in description(svg)

    def test_a_publisher_that_was_held_until_it_was_matched_is_marked_as_held(self):
        held = Declaration(at(0.5), PROCESS, "held", {"topic": "/cmd_vel", "waited_s": 0.184})
        figure = draw_timeline(make_run(declarations=(held,)), (), "t")
        assert "4 messages, held 0.18 s" in words(figure.wide)
        assert "create_publisher() returned only when the publisher was matched" in figure.caption

    def test_a_call_goes_wrong_unless_the_end_cuts_it_off(self):
        service = "/bot_publisher/list_parameters"
        lost, cut_off = Call(service, "", at(0.6)), Call(service, "", at(1.7))
        calls = (lost, cut_off, Call("/add", "", at(1.7)))
        svg = draw_timeline(make_run(calls=calls), (), "t").wide
        assert "2 calls, 1 without an answer, 1 cut off by the end" in words(svg)
        assert "1 call, 1 without an answer" in words(svg)
        assert len(of_class(svg, "out")) == 2

    def test_a_process_that_a_signal_ended(self):
        process = Process(PROCESS, 1, at(0.0), at(0.9), -11, "itself")
        shown = words(draw_timeline(make_run(processes=(process,)), (), "t").wide)
        assert "ended by signal 11 at 0.90 s" in shown
        assert "SIGINT" not in shown

    def test_where_nothing_was_launched_there_is_no_time_line(self):
        assert draw_timeline(make_run(processes=(), ending=Ending.NOT_STARTED), (), "t") is None

    def test_a_flood_of_messages_stays_small(self):
        messages = tuple(
            Message("/cmd_vel", "geometry_msgs/msg/Twist", {}, at(i * 1e-5), at(i * 1e-5), i + 1)
            for i in range(100_000)
        )
        svg = draw_timeline(make_run(messages={"/cmd_vel": messages}), (), "t").wide
        assert marks(svg, "tick") < 3 * WIDE
        assert "100000 messages" in words(svg)


class TestFrames:
    def drawn(self, *edges):
        static = [transform(*edge) for edge in edges]
        return draw_frames(run(moving=MOVING, static=on(TF_STATIC, (0.7, static))), "f")

    def test_each_frame_is_below_its_parent_with_its_rate_or_that_it_is_static(self):
        figure = self.drawn(("base_footprint", "base_link"), ("base_link", "laser"))
        shown = words(figure.wide)
        names = ["odom", "root", "base_footprint", "20 Hz", "base_link", "static", "laser"]
        assert [shown.index(name) for name in names] == sorted(shown.index(name) for name in names)
        assert "laser, static" in description(figure.wide)

    def test_a_second_parent_and_a_second_root_are_seen(self):
        shown = words(self.drawn(("map", "base_footprint")).narrow)
        assert shown.count("two parents") == 2 and shown.count("root") == 2

    def test_circles_long_chains_and_long_names_are_drawn(self):
        chain = [(f"f{n}", f"f{n + 1}") for n in range(5000)]
        for edges in ([("a", "b"), ("b", "a")], [("a", "a")], chain, [("x" * 500, "<svg>")]):
            figure = self.drawn(*edges)
            assert is_finite(figure.wide) and len(figure.wide) < 60_000

    def test_a_run_without_transforms_has_no_tree(self):
        assert draw_frames(make_run(), "f") is None


class TestTurtles:
    def test_the_canvas_shows_lines_turtles_and_who_was_killed(self):
        def script(turtles, time_s):
            if time_s == 0.0:
                turtles.set_pen("turtle1", Pen((255, 0, 0), 9))
                turtles.spawn(Pose(2.0, 2.0, 0.0), "bob")
            if time_s == 0.8:
                turtles.kill("bob")
            return Velocity(1.0)

        figure = draw_turtles(swim(script, 1.6), [((5.5, 5.5), (7.5, 5.5))], "t")
        for drawing in (figure.wide, figure.narrow):
            assert 'stroke="rgb(255 0 0)"' in drawing
            assert 'fill="rgb(69 86 255)"' in drawing
            assert {"turtle1", "1. bob"} <= set(words(drawing).splitlines()) or (
                "turtle1" in words(drawing) and "1. bob" in words(drawing)
            )
            assert is_finite(drawing)
        assert figure.caption.startswith("turtle1 drew 1.6 m; the dashed figure was asked for; 1 ")

    def test_there_is_none_without_turtles(self):
        assert draw_turtles(make_run(), [], "t") is None
