"""A grade with every kind of picture in its report, from a run of the real simulator core."""

from __future__ import annotations

import math
from dataclasses import replace

from grader.findings.finding import Case, Cases, Comparison, Evidence, Finding, Moment, Plot, Span
from grader.measure.motion.track import speed_plot
from grader.recording.event import Breach
from grader.recording.model import Recording
from grader.report.html.replay import Replay, make_replay
from tests.checks.builder import drive, endpoint, on_scan, output, reader
from tests.grade.sample import Told, make_submission
from tests.report.sample import PERIOD, Sample, at, attempts, judged_runs, make_run, reviewed

WALL = "{segments: [[0.6, -0.6, 0.6, 0.6]], moving: [{circle: {radius: 0.1}, path: [{at: 0 s, \
pose: [0, 0.62]}, {at: 5 s, pose: [0.4, 0.62]}]}]}"
DEFINITION = Comparison(
    "msg/BotStatus.msg",
    ("uint8 BURGER=1", "uint8 model", "geometry_msgs/Pose2D pose", "float64[2] velocities"),
    ("uint8 BURGER=0", "uint8 model", "float64[2] velocities", "string extra"),
)
CALLS = (
    Span("timer_1", 1.0, 1.4),
    Span("timer_2", 1.2, 1.6, wrong=True),
    Span("timer_1", 2.0, 2.4),
)
CASES = Cases(
    "Rotations from axis and angle",
    "error of the rotation (deg)",
    0.01,
    (
        *(Case(f"case {i}", "ordinary", 1e-6 * (i + 1)) for i in range(20)),
        *(Case(f"case {i}", "gimbal lock", 3.0 * (i + 1)) for i in range(5)),
        Case("zero axis", "zero", None),
    ),
)


def ahead_until(distance_m: float) -> Recording:
    """A run towards a wall at 0.6 m that stops so far from it."""
    front = on_scan(lambda ranges: (0.0 if 0.0 < ranges[0] <= distance_m else 0.1, 0.0))
    run = drive(front, world=WALL, seconds=10.0)
    return replace(
        run,
        scenario="drive",
        submission=make_submission(),
        endpoints=(endpoint("/cmd_vel"), reader("/cmd_vel")),
        log=(
            *output("Front is clear", time_s=1.5),
            *output("Traceback (most recent call last)", time_s=3.0),
        ),
        values={"wall_x": 0.6},
    )


def gallery() -> Sample:
    """A robot that touched the wall, and a check for each other kind of evidence."""
    run = ahead_until(0.0)
    touched_s = next(run.since_launch_s(step.time_ns) for step in run.truth if step.contact)
    touch = Finding.failed(
        "no contact on its way",
        "drove into a wall",
        "Stop early enough.",
        Evidence(moments=(Moment("contact", touched_s),), plots=(speed_plot(run),)),
    )
    same = Finding.passed("a speed", "0.1 m/s", Evidence(plots=(speed_plot(run),)))
    wave = tuple(0.1 * i for i in range(400))
    smooth = Plot("Heading", "time since launch (s)", "heading (rad)", wave,
                  tuple(map(math.sin, wave)))  # fmt: skip
    checks = [
        Told("period", PERIOD, scenarios=("listen",), points=3, title="It publishes every 300 ms"),
        Told("touch", touch, scenarios=("drive",), points=2, title="The robot touches nothing"),
        Told("speed", same, scenarios=("drive",), title="It drives with 0.1 m/s"),
        Told("stops", scenarios=("drive",), requires=("touch",), title="It stops at 0.2 m"),
        Told("calls", Finding.failed("one at a time", "two at once", "", Evidence(spans=CALLS)),
             scenarios=("listen",), title="Callbacks do not overlap"),
        Told("rotation", Finding.failed("within 0.01°", "15° off", "", Evidence(cases=(CASES,))),
             scenarios=("listen",), title="Rotations are right"),
        Told("message", Finding.failed("as given", "differs", "",
             Evidence(comparisons=(DEFINITION,), plots=(smooth,))),
             scenarios=("listen",), title="The message is defined as given"),
    ]  # fmt: skip
    reached = Breach(at(0.9), "disk", "all space in /tmp and home", "256 MiB")
    recordings = {"listen": make_run(breaches=(reached,)), "drive": run}
    sample = judged_runs(
        checks, recordings, titles={"listen": "It publishes", "drive": "A wall is ahead"}
    )
    added = reviewed("`time.sleep` in the callback\n    keeps it busy", waits=True)
    return replace(sample, added={"attempts": attempts(1.0, None, 4.25), **added})


def reference() -> dict[str, Replay]:
    """The replay of a run that stops in time."""
    replay = make_replay(ahead_until(0.2), gallery().grade.assignment.scenarios[1])
    assert replay is not None
    return {"drive": replay}
