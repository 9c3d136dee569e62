"""Recordings of turtles, made by the real simulation core without ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from grader.recording.model import NS, Message, Recording
from grader.run.cell.turtle_truth import TurtleTruth
from sim.motion import Pose
from sim.turtles.simulation import Turtles
from sim.turtles.turtle import STEP_NS, Velocity
from tests.checks.builder import LAUNCH_NS, TWIST, at, message, process, recording, twist

BEGAN_S = 1.0
BLUE = (69, 86, 255)
MIDDLE = (499 / 90, 499 / 90)

Script = Callable[[Turtles, float], Velocity | None]
"""Gets the turtles and the time in s; may act on them, and commands turtle1 if it returns one."""


def swim(
    script: Script, seconds: float = 20.0, placed: Iterable[tuple[str, Pose]] = (), **changes: Any
) -> Recording:
    """Let a script act on turtles in each step of 16 ms, and record it as a cell would."""
    turtles, truth, sent = Turtles(placed), TurtleTruth(), list[Message]()
    for _ in range(round(seconds * NS / STEP_NS)):
        time_s = BEGAN_S + turtles.time_ns / NS
        velocity = script(turtles, turtles.time_ns / NS)
        if velocity is not None:
            turtles.command("turtle1", velocity)
            value = twist((velocity.ahead_m_s, 0, 0), (0, 0, velocity.turn_rad_s))
            topic, number = "/turtle1/cmd_vel", len(sent) + 1
            sent.append(message(time_s, value, sequence=number, topic=topic, type=TWIST))
        truth.keep(turtles.advance(), at(BEGAN_S + (turtles.time_ns) / NS), BLUE)
    end_s = (truth.stamp_ns - LAUNCH_NS) / NS
    defaults: dict[str, Any] = {
        "truth": tuple(truth.truth),
        "incidents": tuple(truth.incidents),
        "turtles": tuple(truth.events),
        "stop_s": end_s,
        "end_s": end_s + 0.1,
        "matched_s": BEGAN_S,
        "processes": (process(exited_s=end_s + 0.1),),
        "messages": {"/turtle1/cmd_vel": tuple(sent)} if sent else {},
        "calls": (),
    }
    return recording(**{**defaults, **changes})


def moves(*legs: tuple[float, float, float]) -> Script:
    """Velocities ahead and of the turn, each for so many seconds; then rest."""

    def script(turtles: Turtles, time_s: float) -> Velocity:
        for ahead, turn, lasts in legs:
            if time_s < lasts - 1e-9:
                return Velocity(ahead, 0.0, turn)
            time_s -= lasts
        return Velocity()

    return script
