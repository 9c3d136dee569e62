from __future__ import annotations

import os
import selectors
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.submission.build import bounded
from grader.submission.build.bounded import (
    CappedOutput,
    Command,
    Outcome,
    OutputLimits,
    run_bounded,
)


def run(
    program: str, folder: Path, wall_s: float = 20.0, output: OutputLimits | None = None
) -> Outcome:
    """Run a Python program, with what it must not leave behind marked in its environment."""
    environment = {"PATH": os.environ["PATH"], "MARK": str(folder)}
    command = Command([sys.executable, "-I", "-S", "-c", program], folder, environment)
    return run_bounded(command, wall_s=wall_s, output=output)


def left_behind(folder: Path) -> list[int]:
    """Processes that have the mark of a run in this folder."""
    mark = f"MARK={folder}\0".encode()
    found = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            try:
                if mark in (process / "environ").read_bytes():
                    found.append(int(process.name))
            except OSError:
                continue
    return found


def test_output_and_exit_status_are_returned(tmp_path: Path) -> None:
    outcome = run("import sys; print('out'); print('err', file=sys.stderr); sys.exit(3)", tmp_path)
    assert outcome.status == 3
    assert sorted(outcome.output.split()) == ["err", "out"]
    assert outcome.ended_by_us is None


def test_what_is_written_until_the_end_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a busy machine, where the reader comes to itself when all has ended."""

    class Late(selectors.DefaultSelector):
        """Finds nothing at first, and then waits until the command has ended."""

        found_nothing = False

        def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
            if self.found_nothing:
                return super().select(timeout)
            self.found_nothing = True
            os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)
            return []

    monkeypatch.setattr(bounded.selectors, "DefaultSelector", Late)
    outcome = run("print('Finished')", tmp_path)
    assert (outcome.status, outcome.output) == (0, "Finished\n")


def test_a_bounded_program_gets_no_input(tmp_path: Path) -> None:
    assert (
        run("print(repr(input()))", tmp_path)
        .output.strip()
        .endswith("EOFError: EOF when reading a line")
    )


def test_it_is_ended_after_its_time_with_all_that_it_started(tmp_path: Path) -> None:
    started = time.monotonic()
    outcome = run(
        "import os, time\nprint('on', flush=True)\nfor _ in range(3): os.fork()\ntime.sleep(60)",
        tmp_path,
        wall_s=1.0,
    )
    assert (outcome.ended_by_us, outcome.status, outcome.output) == ("time", None, "on\n")
    assert time.monotonic() - started < 10
    assert left_behind(tmp_path) == []


DAEMON = """
import os, signal, time
for ignored in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
    signal.signal(ignored, signal.SIG_IGN)
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        os.setsid()
        time.sleep(60)
    os._exit(0)
print('done')
"""


def test_a_daemon_that_holds_the_output_is_killed_and_not_waited_for(tmp_path: Path) -> None:
    started = time.monotonic()
    outcome = run(DAEMON, tmp_path)
    assert (outcome.status, outcome.output) == (0, "done\n")
    assert time.monotonic() - started < 10
    assert left_behind(tmp_path) == []


def test_too_much_output_ends_it_and_is_not_kept(tmp_path: Path) -> None:
    limits = OutputLimits(head=1000, tail=1000, total=1_000_000)
    outcome = run("while True: print('x' * 99)", tmp_path, output=limits)
    assert outcome.ended_by_us == "output"
    assert len(outcome.output) < 2100
    assert "bytes left out" in outcome.output


def test_lines_are_reported_while_it_runs(tmp_path: Path) -> None:
    lines: list[str] = []
    program = "print('a'); print('b' * 10000); print('c', end='')"
    command = Command([sys.executable, "-c", program], tmp_path, {})
    run_bounded(command, wall_s=20.0, on_line=lines.append)
    assert lines[0] == "a"
    assert len(lines[1]) == 4096
    assert len(lines) == 2


def test_a_command_that_kills_its_supervisor_has_no_success(tmp_path: Path) -> None:
    outcome = run("import os, time; os.kill(os.getppid(), 9); time.sleep(0.2)", tmp_path)
    assert outcome.status == -9


def test_a_program_that_does_not_exist_says_so(tmp_path: Path) -> None:
    outcome = run_bounded(Command(["no-such"], tmp_path, {"PATH": "/bin"}), wall_s=20.0)
    assert outcome.status == 127
    assert "no-such" in outcome.output


def test_a_file_has_a_bound(tmp_path: Path) -> None:
    program = "import resource as r; print(r.getrlimit(r.RLIMIT_FSIZE), r.getrlimit(r.RLIMIT_CORE))"
    assert run(program, tmp_path).output == f"({2**30}, {2**30}) (0, 0)\n"


@settings(deadline=None)
@given(st.lists(st.binary(max_size=50)), st.integers(0, 40), st.integers(1, 40))
def test_beginning_and_end_of_output_are_kept(blocks: list[bytes], head: int, tail: int) -> None:
    output = CappedOutput(OutputLimits(head=head, tail=tail))
    for block in blocks:
        output.feed(block)
    data = b"".join(blocks)
    assert output.total == len(data)
    if len(data) <= head + tail:
        assert output.text() == data.decode("utf-8", "replace")
    else:
        gap = f"\n[... {len(data) - head - tail} bytes left out ...]\n".encode()
        assert output.text() == (data[:head] + gap + data[-tail:]).decode("utf-8", "replace")
