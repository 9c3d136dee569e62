"""All output is drained, and what is kept stays within bounds."""

from __future__ import annotations

import json
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.recording.model import LogLine
from grader.run.process.output import OutputReader, _Stream


def read(*chunks: bytes, limit: int = 1 << 16) -> tuple[LogLine, ...]:
    """Write chunks into a pipe that is being read; all lines."""
    return reader_of(*chunks, limit=limit)[1]


def reader_of(
    *chunks: bytes, stream: str = "stdout", limit: int = 1 << 16
) -> tuple[OutputReader, tuple[LogLine, ...]]:
    reader = OutputReader(limit)
    read_end, write_end = os.pipe()
    reader.add(read_end, "p/e", stream)
    for chunk in chunks:
        rest = chunk
        while rest:
            rest = rest[os.write(write_end, rest) :]
    os.close(write_end)
    return reader, reader.close(10.0)


def traced(*lines: bytes) -> OutputReader:
    """What a tracer wrote; none of it is output."""
    reader, output = reader_of(*(line + b"\n" for line in lines), stream="tracer")
    assert output == ()
    return reader


def test_lines_keep_their_order_and_lose_their_ends() -> None:
    assert [line.text for line in read(b"one\ntwo\r\nthr", b"ee\n", b"four")] == [
        "one",
        "two",
        "three",
        "four",
    ]


def test_a_carriage_return_ends_a_line_too() -> None:
    """A progress bar writes its line again and again; a line end may be cut between reads."""
    stream = _Stream("p/e", "stdout", 1 << 16)
    for chunk in (b"10 %\r20 %\r", b"\n30 %\r", b"40 %\r\n\nend"):
        stream.feed(chunk)
    stream.finish()
    texts = [line.text for line in stream.kept.head]
    assert texts == ["10 %", "20 %", "30 %", "40 %", "", "end"]


def test_what_has_no_line_end_is_cut_by_time() -> None:
    """As print(..., end="; ", flush=True) writes, or a status line with escape sequences."""
    stream = _Stream("p/e", "stdout", 1 << 16)
    for milliseconds in (0, 30, 60, 500, 530):
        stream.feed(b"x=%d; " % milliseconds, milliseconds * 1_000_000)
    stream.feed(b"end\nnext", 531_000_000)
    stream.feed(b"\n", 950_000_000)
    stream.finish()
    found = [(line.text, line.time_ns // 1_000_000) for line in stream.kept.head]
    assert found == [
        ("x=0; x=30; x=60; ", 60),
        ("x=500; x=530; end", 531),
        ("next", 531),
    ]


def test_what_a_tracer_reports_is_never_cut_by_time() -> None:
    stream = _Stream("p/e", "tracer", 1 << 16)
    stream.feed(b'{"kind": ', 0)
    stream.feed(b'"spin"}\n', 10**9)
    assert [line.text for line in stream.kept.head] == ['{"kind": "spin"}']


def test_bytes_that_are_not_text_are_replaced() -> None:
    assert read(b"\xff\xfe ok\n")[0].text == "\ufffd\ufffd ok"


def test_the_first_and_the_last_lines_are_kept() -> None:
    lines = [line.text for line in read(*[b"%06d\n" % n for n in range(10_000)], limit=1000)]
    assert lines[0] == "000000"
    assert lines[-1] == "009999"
    assert sum(len(line) + 1 for line in lines) <= 1000


@settings(max_examples=30, deadline=None)
@given(st.lists(st.binary(max_size=20_000), max_size=8))
def test_any_output_is_read_within_bounds(chunks: list[bytes]) -> None:
    lines = read(*chunks, limit=10_000)
    # A line may exceed the bound alone, but never the longest line.
    assert sum(len(line.text) for line in lines) <= 5_000 + max(5_000, 8192)


def test_declarations_are_read_and_nonsense_is_dropped() -> None:
    good = json.dumps({"kind": "timer", "pid": 7, "period_s": 0.3}).encode()
    reader = traced(b"nonsense", b"[1, 2]", b"{}", b"[" * 100_000, good, b'"text"')
    foreign, timer = reader.declarations
    assert (foreign.kind, foreign.process) == ("foreign", "p/e")
    assert (timer.kind, timer.data) == ("timer", {"pid": 7, "period_s": 0.3})


@pytest.mark.parametrize(
    "data",
    [
        {"kind": "rate"},
        {"kind": ["timer"]},
        {"kind": "publisher", "topic": "/cmd_vel", "depth": True},
        {"kind": "subscription", "topic": "/cmd_vel"},
    ],
)
def test_what_no_tracer_writes_was_written_by_another(data: dict[str, object]) -> None:
    reader = traced(json.dumps({"pid": 7, **data}).encode())
    assert reader.forgers == {"p/e"}
    assert [item.kind for item in reader.declarations] == ["foreign"]


@pytest.mark.parametrize("value", [1e300, [1, 2], "\ud800"])
def test_a_tracer_that_reports_what_cannot_be_kept_is_no_forger(value: object) -> None:
    line = json.dumps({"kind": "timer", "pid": 7, "period_s": value}).encode()
    assert traced(line).declarations == ()


def test_a_report_is_at_most_one_level_deep_whatever_stands_beside_it() -> None:
    report = {"kind": "timer", "pid": 7, "group": {}, "other": {"deeper": {}}}
    assert traced(json.dumps(report).encode()).declarations == ()


def test_a_pipe_that_stays_open_does_not_hold_us_up() -> None:
    reader = OutputReader(1000)
    read_end, write_end = os.pipe()
    reader.add(read_end, "p/e", "stdout")
    os.write(write_end, b"still there\n")
    try:
        assert [line.text for line in reader.close(0.2)] == ["still there"]
    finally:
        os.close(write_end)
