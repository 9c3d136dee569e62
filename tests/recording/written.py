"""A recording in a real MCAP file, for tests of what reads it."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

from grader.recording.mcap_reader import read_recording
from grader.recording.mcap_writer import RawMessage, write_recording
from grader.recording.model import NS, Ending, LogLine, Recording
from grader.recording.simulated import Truth
from grader.recording.submission import SubmissionRecord

BEGAN_NS = 1_700_000_000 * NS
TWIST = """\
Vector3  linear
Vector3  angular
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
_CDR_HEADER = b"\x00\x01\x00\x00"


def at(seconds: float) -> int:
    """Nanoseconds of a time since launch."""
    return BEGAN_NS + round(seconds * NS)


def twist(linear: float, angular: float = 0.0) -> bytes:
    """A Twist as CDR, little endian."""
    return _CDR_HEADER + struct.pack("<6d", linear, 0, 0, 0, 0, angular)


def write_robot_run(file: Path, **changes: object) -> Recording:
    """A run of two seconds: a robot drives ahead by commands on ``/cmd_vel``."""
    recording = dataclasses.replace(
        Recording(
            scenario="run",
            seed=7,
            ending=Ending.UNTIL,
            launched_ns=at(0),
            matched_ns=at(0.5),
            stop_ns=at(2),
            end_ns=at(2.1),
            submission=SubmissionRecord(id="ada", sha256="ab" * 32),
            log=(LogLine(at(0.4), "bot/bot", "stdout", "ready"),),
            truth=tuple(
                Truth(at(0.5 + n / 100), n / 1000, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0) for n in range(150)
            ),
        ),
        **changes,  # type: ignore[arg-type]
    )
    messages = [
        RawMessage("/cmd_vel", "geometry_msgs/msg/Twist", twist(0.1), at(t), at(t), n)
        for n, t in enumerate((0.6, 0.9, 1.2), 1)
    ]
    write_recording(file, recording, messages, {"geometry_msgs/msg/Twist": TWIST})
    return read_recording(file)
