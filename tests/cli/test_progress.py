"""What is shown while a command works."""

from __future__ import annotations

import io
import re
import sys

import pytest

from grader.cli.screen.progress import Progress

EVENTS: tuple[dict[str, object], ...] = (
    {"event": "launching", "process": "bot_publisher/bot_pub"},
    {"event": "waiting", "what": "a publisher on /cmd_vel"},
    {"event": "matched", "limit_s": 4.5},
    {"event": "recording", "messages": 9, "elapsed_s": 3.0, "limit_s": 4.5},
    {"event": "stopping"},
    {"event": "recorded"},
)


def made_terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """Let standard error be a terminal of 80 columns."""

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    found = Terminal()
    monkeypatch.setattr(sys, "stderr", found)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("NO_COLOR", "1")
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    return found


def say_everything(progress: Progress) -> None:
    with progress.shown():
        progress.say("building bot_publisher")
        progress.say("building bot_publisher")
        progress.output("build", "Starting >>> bot_publisher")
        for event in EVENTS:
            progress.narrate("run", event)
        progress.narrate("run", {"event": "printed", "process": "bot_pub", "text": "\x1b[2Jhello"})


def grade_a_class(progress: Progress) -> None:
    with progress.shown():
        progress.begin("grading", 5, already=1)
        progress.advance("ana", "10 of 10 points", fresh=False)
        for name in ("ben", "cai", "dan"):
            progress.advance(name, "9 of 10 points")
        progress.note("eve handed in nothing")


def test_where_lines_stay_each_step_is_printed_once(capsys: pytest.CaptureFixture[str]) -> None:
    say_everything(Progress())
    out, err = capsys.readouterr()
    assert out == ""
    assert err == (
        "rosgrade: building bot_publisher\n"
        "rosgrade: run: starting bot_publisher/bot_pub\n"
        "rosgrade: run: recording\n"
        "rosgrade: run: recorded\n"
    )


def test_where_lines_stay_every_submission_of_a_class_is_printed_with_the_rate(
    capsys: pytest.CaptureFixture[str],
) -> None:
    grade_a_class(Progress())
    lines = capsys.readouterr().err.splitlines()
    assert lines[:3] == [
        "rosgrade: grading 5, 1 of them by an earlier run",
        "rosgrade: 2 of 5: ben: 9 of 10 points",
        "rosgrade: 3 of 5: cai: 9 of 10 points",
    ]
    assert re.fullmatch(r"rosgrade: 4 of 5: dan: 9 .* \(\d+ a minute, 0 s left\)", lines[3])


def test_quiet_prints_only_what_must_not_be_missed(capsys: pytest.CaptureFixture[str]) -> None:
    say_everything(Progress(quiet=True, verbose=True))
    grade_a_class(Progress(quiet=True))
    assert capsys.readouterr() == ("", "rosgrade: eve handed in nothing\n")


def test_verbose_shows_what_is_printed_and_obeys_none_of_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    say_everything(Progress(verbose=True))
    err = capsys.readouterr().err
    assert "build | Starting >>> bot_publisher\n" in err
    assert "run bot_pub | hello\n" in err
    assert "\x1b" not in err


def test_a_terminal_gets_lines_that_change_without_colours_where_unwanted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = made_terminal(monkeypatch)
    say_everything(Progress(verbose=True))
    text = terminal.getvalue()
    assert "rosgrade: " not in text
    assert "run: recorded" in text and "hello" in text
    assert "\x1b[2J" not in text
    assert not re.search(r"\x1b\[[349]\dm", text)


def test_a_terminal_gets_the_rate_of_a_class(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = made_terminal(monkeypatch)
    grade_a_class(Progress())
    text = terminal.getvalue()
    assert "rosgrade: eve handed in nothing" in text
    assert re.search(r"grading, 4 of 5, \d+ a minute, 0 s left", text)
