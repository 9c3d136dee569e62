"""What is shown while a submission is graded."""

from __future__ import annotations

import io
import re
import sys
import threading

import pytest
from rich.console import Console

from grader.cli.screen import live
from grader.cli.screen.live import Activity, GradingProgress

LAUNCHING = {"event": "launching", "process": "bot_publisher/bot_pub"}
WAITING = {"event": "waiting", "what": "a publisher on /cmd_vel"}
MATCHED = {"event": "matched", "limit_s": 4.5}
MESSAGES = {"event": "recording", "messages": 9, "elapsed_s": 3.0, "limit_s": 4.5}
STOPPING = {"event": "stopping"}
RECORDED = {"event": "recorded"}


def told(*events: dict[str, object], at_s: float = 0.0) -> list[tuple[bool, str]]:
    activity = Activity("building bot_publisher")
    for event in events:
        activity.take("run", event, 10.0)
    return activity.lines(10.0 + at_s)


def test_before_a_scenario_begins_the_build_is_told() -> None:
    assert told() == [(False, "building bot_publisher")]


def test_each_step_of_a_scenario_is_told() -> None:
    assert told(LAUNCHING) == [(False, "run: starting bot_publisher/bot_pub")]
    assert told(LAUNCHING, WAITING) == [(False, "run: waiting for a publisher on /cmd_vel")]
    assert told(LAUNCHING, WAITING, MATCHED, MESSAGES, at_s=3.2) == [
        (False, "run: recording, 3.2 of at most 4.5 s, 9 messages")
    ]
    assert told(LAUNCHING, MATCHED, MESSAGES, STOPPING) == [(False, "run: stopping")]
    assert told(LAUNCHING, MATCHED, STOPPING, RECORDED) == [(True, "run: recorded")]


def test_the_time_goes_on_without_messages_but_not_beyond_the_limit() -> None:
    assert told(MATCHED, at_s=1.04) == [(False, "run: recording, 1.0 of at most 4.5 s, 0 messages")]
    assert told(MATCHED, at_s=9.0) == [(False, "run: recording, 4.5 of at most 4.5 s, 0 messages")]


def test_a_scenario_that_is_run_again_begins_anew() -> None:
    assert told(MATCHED, MESSAGES, STOPPING, RECORDED, LAUNCHING) == [
        (False, "run: starting bot_publisher/bot_pub")
    ]


def test_what_takes_long_says_for_how_long() -> None:
    activity = Activity()
    assert activity.say("building example_interfaces", 10.0)
    assert not activity.say("building example_interfaces", 20.0)
    assert activity.lines(14.0) == [(False, "building example_interfaces")]
    assert activity.lines(52.4) == [(False, "building example_interfaces, 42 s so far")]
    assert activity.say("reading", 60.0)
    assert activity.lines(61.0) == [(False, "reading")]


def test_where_lines_stay_what_still_goes_on_is_told_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(live, "_REMIND_S", 0.01)
    progress = GradingProgress()
    reminded = threading.Event()
    plain = progress._print

    def told(text: str) -> None:
        plain(text)
        if text.startswith("still"):
            reminded.set()

    monkeypatch.setattr(progress, "_print", told)
    with progress.shown():
        progress.say("building example_interfaces")
        assert reminded.wait(20.0)
    assert "rosgrade: still building example_interfaces\n" in capsys.readouterr().err
    assert not [thread for thread in threading.enumerate() if thread.name == "reminder"]


def test_scenarios_have_a_line_each_in_the_order_in_which_they_began() -> None:
    activity = Activity()
    activity.take("front", LAUNCHING, 0.0)
    activity.take("behind", LAUNCHING, 0.0)
    activity.take("front", WAITING, 0.0)
    assert [line for _, line in activity.lines(0.0)] == [
        "front: waiting for a publisher on /cmd_vel",
        "behind: starting bot_publisher/bot_pub",
    ]


AT_80 = """\
⠋ front: recording, 0.0 of at most 4.5 s, 0 messages
⠋ behind: waiting for a node that is called /a_very_long_name_of_a_node_that_is…
  left: recorded
"""
AT_120 = """\
⠋ front: recording, 0.0 of at most 4.5 s, 0 messages
⠋ behind: waiting for a node that is called /a_very_long_name_of_a_node_that_is_not_there
  left: recorded
"""


@pytest.mark.parametrize(("width", "text"), [(80, AT_80), (120, AT_120)])
def test_the_lines_on_a_terminal(width: int, text: str) -> None:
    activity = Activity()
    activity.take("front", MATCHED, 0.0)
    what = "a node that is called /a_very_long_name_of_a_node_that_is_not_there"
    activity.take("behind", {"event": "waiting", "what": what}, 0.0)
    activity.take("left", RECORDED, 0.0)
    stream = io.StringIO()
    console = Console(file=stream, width=width, highlight=False)
    console.print(live._spinning(lambda: activity.lines(0.0))())
    shown = "\n".join(line.rstrip() for line in stream.getvalue().splitlines()) + "\n"
    assert shown == text


def say_everything(progress: GradingProgress) -> None:
    with progress.shown():
        progress.say("building bot_publisher")
        progress.say("building bot_publisher")
        progress.output("build", "Starting >>> bot_publisher")
        for event in (LAUNCHING, WAITING, MATCHED, MESSAGES, STOPPING, RECORDED):
            progress.narrate("run", event)
        progress.narrate("run", {"event": "printed", "process": "bot_pub", "text": "\x1b[2Jhello"})


def test_where_lines_stay_each_step_is_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    say_everything(GradingProgress())
    out, err = capsys.readouterr()
    assert out == ""
    assert err == (
        "rosgrade: building bot_publisher\n"
        "rosgrade: run: starting bot_publisher/bot_pub\n"
        "rosgrade: run: recording\n"
        "rosgrade: run: recorded\n"
    )


def test_quiet_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    say_everything(GradingProgress(quiet=True, verbose=True))
    assert capsys.readouterr() == ("", "")


def test_verbose_shows_what_is_printed_and_obeys_none_of_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    say_everything(GradingProgress(verbose=True))
    err = capsys.readouterr().err
    assert "build | Starting >>> bot_publisher\n" in err
    assert "run bot_pub | hello\n" in err
    assert "\x1b" not in err


def test_a_terminal_gets_lines_that_change_without_colours_where_unwanted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", "1")
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    say_everything(GradingProgress(verbose=True))
    text = terminal.getvalue()
    assert "rosgrade: " not in text
    assert "run: recorded" in text and "hello" in text
    assert "\x1b[2J" not in text
    assert not re.search(r"\x1b\[[349]\dm", text)
