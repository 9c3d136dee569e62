"""What a launch file starts is told apart by what `ros2 launch` prints."""

from __future__ import annotations

from grader.recording.model import Process
from grader.run.process.launched import launched
from tests.checks.builder import STOP_S, at, declared, died, output, process

FILE = "bot_bringup/robot.launch.py"
BEGUN = "[INFO] [driver-1]: process started with pid [7]"
COMMAND = "/ws/install/lib/bot/driver --ros-args -r __ns:=/robot1"
NODE = declared("node", name=FILE, node="/robot1/driver", pid=7)


def dies(code: int, command: str = COMMAND) -> str:
    return f"[ERROR] [driver-1]: process has died [pid 7, exit code {code}, cmd '{command}']."


def split(*lines: str, of: Process | None = None, has_node: bool = True):
    """What comes of a launch file that prints some lines."""
    log = output("\n".join(lines), stream="stdout", name=FILE)
    declarations = (declared("started", name=FILE, pid=2), *[NODE] * has_node)
    return launched({FILE}, at(STOP_S), (of or process(FILE),), log, declarations)


def test_a_node_becomes_a_process_with_its_output_and_declarations() -> None:
    (launch, driver), log, declarations = split(
        BEGUN, "[driver-1] [INFO] [1.0] [robot1.driver]: hello", "[other-9] stays"
    )
    assert (launch.name, driver.name, driver.stopped_by) == (FILE, "driver-1", "SIGINT")
    assert [(line.process, line.text) for line in log[1:]] == [
        ("driver-1", "[INFO] [1.0] [robot1.driver]: hello"),
        (FILE, "[other-9] stays"),
    ]
    assert [(one.process, one.kind) for one in declarations] == [
        (FILE, "started"),
        ("driver-1", "node"),
        ("driver-1", "started"),
    ]


def test_a_node_that_dies_ended_by_itself_and_its_traceback_is_stderr() -> None:
    (_, driver), log, _ = split(BEGUN, "[driver-1] ValueError: no", dies(1))
    assert (driver.exit_code, driver.stopped_by, driver.exited_ns) == (1, "itself", at(1.0))
    assert (log[1].stream, log[1].text) == ("stderr", "ValueError: no")


def test_a_program_that_dies_before_its_node_counts_too() -> None:
    assert len(split(BEGUN, dies(1), has_node=False)[0]) == 2


def test_a_helper_without_a_node_is_no_process_of_its_own() -> None:
    assert len(split(BEGUN, dies(1, "ros2 service call /x"), has_node=False)[0]) == 1
    assert len(split(BEGUN, has_node=False)[0]) == 1


def test_what_dies_after_sigint_was_stopped_by_it() -> None:
    late = output(dies(-2), stream="stdout", name=FILE, time_s=STOP_S + 0.05)
    begun = output(BEGUN, stream="stdout", name=FILE)
    (_, driver), _, _ = launched({FILE}, at(STOP_S), (process(FILE),), (*begun, *late), (NODE,))
    assert (driver.stopped_by, driver.stop_s) == ("SIGINT", 0.1)
    assert driver.exited_ns == at(STOP_S + 0.05)


def test_when_each_node_ended_after_sigint_is_told_by_launch() -> None:
    clean = "[INFO] [driver-1]: process has finished cleanly [pid 7]"
    late = output(clean, stream="stdout", name=FILE, time_s=STOP_S + 0.02)
    begun = output(BEGUN, stream="stdout", name=FILE)
    (launch, driver), _, _ = launched(
        {FILE}, at(STOP_S), (process(FILE),), (*begun, *late), (NODE,)
    )
    assert (driver.exited_ns, driver.stopped_by) == (at(STOP_S + 0.02), "SIGINT")
    assert launch.exited_ns != driver.exited_ns


def test_other_processes_stay_as_they_are() -> None:
    given = ((died(1),), output(f"{BEGUN}\n[driver-1] a"), (declared("node", pid=7),))
    assert launched(set(), at(STOP_S), *given) == given


def test_a_node_that_ends_cleanly_before_is_a_helper_and_no_early_end() -> None:
    (launch, driver), _, _ = split(BEGUN, "[INFO] [driver-1]: process has finished cleanly [pid 7]")
    assert (driver.exited_ns, driver.stopped_by) == (launch.exited_ns, "SIGINT")


def test_an_id_that_a_program_makes_up_is_of_no_process() -> None:
    forged = declared("node", name=FILE, node="/a", pid=[7])
    log = output(BEGUN, stream="stdout", name=FILE)
    processes, _, declarations = launched({FILE}, at(STOP_S), (process(FILE),), log, (forged,))
    assert len(processes) == 1 and declarations == (forged,)
