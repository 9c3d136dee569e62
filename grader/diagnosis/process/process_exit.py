"""Why a process ended before it was asked to: exit code, signal, exception, place."""

from __future__ import annotations

import re
import signal
from collections.abc import Sequence
from dataclasses import dataclass, replace

from grader.checks.finding import Evidence, Moment
from grader.checks.wording import code
from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.process.exceptions import Raised
from grader.diagnosis.process.missing_library import lacking_package
from grader.diagnosis.process.newer_names import newer_name
from grader.diagnosis.process.raised import Failure, fatal_failure, student_place
from grader.measure import declarations
from grader.recording.model import Ending, Process, Recording
from grader.submission.record import SourceError

_LOG_LINES = 15

_SIGNALS = {
    signal.SIGSEGV: "segmentation fault",
    signal.SIGABRT: "abort",
    signal.SIGBUS: "bus error",
    signal.SIGILL: "illegal instruction",
    signal.SIGFPE: "arithmetic error in native code",
    signal.SIGKILL: "killed: by itself, or for too much memory",
    signal.SIGSTOP: "stopped: it waited for SIGCONT",
    signal.SIGXCPU: "too much CPU time",
    signal.SIGXFSZ: "wrote a larger file than is allowed",
    signal.SIGSYS: "a system call that no node needs",
    signal.SIGTERM: "asked to end by another process",
    signal.SIGPIPE: "wrote to a closed pipe",
}
_SIGNAL_HINTS = {
    signal.SIGSEGV: "Native code crashed: look at the last call before it, such as one on a node "
    "or publisher that was destroyed already.",
    signal.SIGABRT: "A C++ exception or an assertion ended it: the last lines of output name it.",
    signal.SIGKILL: "Look for os.kill or os.killpg, or for a list or an image that grows without "
    "end.",
    signal.SIGSTOP: "Look for os.kill, os.killpg and signal.raise_signal with SIGSTOP.",
    signal.SIGTERM: "Look for os.kill, os.killpg or subprocess calls that end their own group.",
}

_BREACH_HINTS = {
    "memory": "Look for a list, a queue or an image that grows without end.",
    "cpu time": "Look for a loop without a pause: a node waits in rclpy.spin() and costs nothing "
    "while nothing happens.",
    "open files": "Look for files, sockets or processes that a loop opens and nothing closes.",
    "descriptors in flight": "Receive at once what socket.send_fds() or multiprocessing sends.",
    "escaped processes": "Write to no process but your own.",
    "sessions": "Look for a loop that starts processes with start_new_session=True or setsid.",
    "output": "Look for a print() or a log call in a loop that nothing slows down.",
    "forbidden call": "Look for os.kill(os.getppid(), ...), and for whatever else is aimed at the "
    "system, or at processes that are not your own.",
    "forbidden packets": "The UDP ports from 7400 on belong to the middleware: choose another one "
    "for a socket of your own.",
    "forbidden name": "Let rclpy make your nodes and topics, and let it say which names it takes: "
    "letters, digits and `_`, and `/` between the parts of a topic or a namespace.",
    "forged report": "Write to no file descriptor that you did not open.",
}

# A converter of rclpy met an object of another class; the name is that of the wanted one.
_OTHER_CLASS = re.compile(r'convert_from_py: Assertion .strncmp\("[\w.]*\.(\w+)"')

# A converter of rclpy met something else in a field of a message.
_OTHER_FIELD = re.compile(r"Assertion .Py(Long|Float|Unicode|Bool)_Check\(")
_FIELD_HINTS = {
    "Long": "A field of integers in a message was given something else, such as a float or a text: "
    "write int(value), and look for a parameter whose default is 1.0 or '1' in place of 1, or of "
    "which .value is missing: get_parameter('name').value.",
    "Float": "A field of floats in a message was given something else, such as a text or a whole "
    "vector: write float(value).",
    "Unicode": "A text field of a message was given something else: write str(value).",
    "Bool": "A field that is True or False in a message was given something else: write "
    "bool(value).",
}


def ended_early(recording: Recording, process: Process) -> bool:
    """Whether a process ended by itself before the end of the observation.

    One that was already on its way out when SIGINT came did, too: how long that takes is a
    matter of the machine.
    """
    if process.exited_ns is None:
        return False
    if process.stopped_by != "itself":
        return process.exited_ns >= recording.stop_ns and _was_leaving(recording, process)
    return recording.ending is Ending.EXITED or process.exited_ns < recording.stop_ns


def _was_leaving(recording: Recording, process: Process) -> bool:
    """Whether it said that it ends before it was asked to."""
    exiting_ns = declarations.exiting_ns(recording, process.name)
    return exiting_ns is not None and exiting_ns < recording.stop_ns


def exited(recording: Recording) -> tuple[Process, ...]:
    """Processes that ended early; those that failed before those that just returned."""
    ended = [process for process in recording.processes if ended_early(recording, process)]
    return tuple(sorted(ended, key=lambda process: process.exit_code == 0))


def crashed(recording: Recording) -> list[Process]:
    """Processes that ended early with a failure."""
    return [process for process in exited(recording) if process.exit_code != 0]


def exit_words(exit_code: int | None) -> str:
    """Say how a process ended: ``exit code 1`` or ``SIGSEGV (segmentation fault)``."""
    if exit_code is None:
        return "an unknown exit code"
    number = signal_of(exit_code)
    if number is None:
        return f"exit code {exit_code}"
    words = f" ({_SIGNALS[number]})" if number in _SIGNALS else ""
    through_shell = f", reported as exit code {exit_code}" if exit_code > 0 else ""
    return f"{number.name}{words}{through_shell}"


def signal_of(exit_code: int) -> signal.Signals | None:
    """The signal that ended a process, also where a shell between reported 128 + signal."""
    number = -exit_code if exit_code < 0 else exit_code - 128
    try:
        found = signal.Signals(number)
    except ValueError:
        return None
    return found if exit_code < 0 or found in _SIGNALS else None


def why_ended(recording: Recording, seen: str = "") -> Cause | None:
    """The cause if a process ended early, after what was seen of it; None if none did."""
    ended = exited(recording)
    cause = why_it_exited(recording, ended[0]) if ended else None
    return cause.after(seen) if cause is not None and seen else cause


@dataclass(frozen=True)
class ProcessExit(Symptom[Cause]):
    """A process ended before it was asked to."""

    recording: Recording
    process: Process

    @property
    def _is_leaving(self) -> bool:
        return self.process.stopped_by != "itself"

    @property
    def _when_s(self) -> float:
        recording = self.recording
        leaving_ns = declarations.exiting_ns(recording, self.process.name)
        exited_ns = leaving_ns if self._is_leaving else self.process.exited_ns
        return recording.since_launch_s(exited_ns or recording.stop_ns)

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return f"the process {code(self.process.name)} ended {self._when_s:.2f} s after launch"

    @property
    def evidence(self) -> Evidence:
        """When it ended, and its last lines of output."""
        return Evidence(
            moments=(Moment(f"{self.process.name} ended", self._when_s),),
            log=_last_lines(self.recording, self.process),
        )

    @property
    def killed(self) -> signal.Signals | None:
        """The signal that ended it."""
        exit_code = self.process.exit_code
        return None if exit_code is None else signal_of(exit_code)

    @property
    def failure(self) -> Failure | None:
        """The exception that ended it."""
        return None if self.killed else fatal_failure(self.recording, self.process.name)

    @property
    def place(self) -> SourceError | None:
        """The student's line that raised it."""
        failure = self.failure
        return student_place(failure, self.recording.submission) if failure else None

    @property
    def where(self) -> str:
        """The same in words, with a space before."""
        return f" ({self.place.file}:{self.place.line})" if self.place else ""

    @property
    def returned(self) -> bool:
        """Whether it ended without a failure."""
        failed = fatal_failure(self.recording, self.process.name)
        return self.process.exit_code == 0 or (self._is_leaving and failed is None)


def why_it_exited(recording: Recording, process: Process) -> Cause:
    """Why a process ended early, with its exception and the student's line if there is one."""
    return cause_of(ProcessExit(recording, process))


@explanation(ProcessExit)
def broken_off(symptom: ProcessExit) -> Cause | None:
    """os._exit() or os.exec() ends the program in the middle of main()."""
    process = symptom.process.name
    if not symptom.returned or not declarations.broke_off(symptom.recording, process):
        return None
    return Cause(
        f"{symptom.seen} with exit code 0, but main() did not return: Python was broken off, as "
        "os._exit() does",
        "Look for os._exit() or os.exec...(): they end the program wherever it is. A node "
        "runs until rclpy.spin(node) returns, at Ctrl-C.",
        symptom.evidence,
    )


@explanation(ProcessExit)
def returned_without_node(symptom: ProcessExit) -> Cause | None:
    """main() returns before it creates a node."""
    recording, process = symptom.recording, symptom.process.name
    traced = declarations.traced(recording, process)
    if not symptom.returned or not traced or declarations.said(recording, "node", process):
        return None
    return Cause(
        f"{symptom.seen} with exit code 0: main() returned before a node was created",
        "The function that setup.py names in console_scripts must call rclpy.init(), create "
        "the node and call rclpy.spin(node).",
        symptom.evidence,
    )


@explanation(ProcessExit)
def returned_without_spin(symptom: ProcessExit) -> Cause | None:
    """main() returns without rclpy.spin()."""
    never_spun = declarations.never_spun(symptom.recording, symptom.process.name)
    if not symptom.returned or not never_spun:
        return None
    return Cause(
        f"{symptom.seen} with exit code 0: main() returned without rclpy.spin()",
        "rclpy.spin(node) keeps a node alive and runs its callbacks until Ctrl-C: call it in "
        "main() after the node was created.",
        symptom.evidence,
    )


@explanation(ProcessExit)
def returned(symptom: ProcessExit) -> Cause | None:
    """main() returns early: spin_once(), a daemon thread, rclpy.shutdown() or sys.exit()."""
    if not symptom.returned:
        return None
    return Cause(
        f"{symptom.seen} with exit code 0: main() returned, or something called sys.exit()",
        "rclpy.spin(node) keeps a node alive until Ctrl-C. Look for what ends it: spin_once() "
        "handles one round only, a daemon thread ends with main(), rclpy.shutdown() and sys.exit() "
        "end everything.",
        symptom.evidence,
    )


@explanation(ProcessExit)
def limit_exceeded(symptom: ProcessExit) -> Cause | None:
    """It used too much memory, CPU time or output, or did what no node may do."""
    breach = next((item for item in symptom.recording.breaches if item.ended), None)
    if symptom.killed is not signal.SIGKILL or breach is None:
        return None
    return Cause(f"{symptom.seen}: {breach}", _BREACH_HINTS[breach.what], symptom.evidence)


@explanation(ProcessExit)
def ended_by_signal(symptom: ProcessExit) -> Cause | None:
    """A signal ended it, such as SIGSEGV, or it ended with an exit code and no traceback."""
    if symptom.failure is not None:
        return None
    killed, evidence = symptom.killed, symptom.evidence
    hint = ""
    if killed is signal.SIGABRT:
        hint = _wrong_class(evidence.log) or _wrong_field(evidence.log)
    hint = hint or (_SIGNAL_HINTS.get(killed, "") if killed else "")
    hint = hint or "Run it by hand with `ros2 run` and look at its last lines of output."
    return Cause(f"{symptom.seen} with {exit_words(symptom.process.exit_code)}", hint, evidence)


@explanation(ProcessExit)
def service_without_response(symptom: ProcessExit) -> Cause | None:
    """The callback of a service does not return its response."""
    failure = symptom.failure
    if not failure or failure.type != "TypeError" or failure.frames[-1].where != "send_response":
        return None
    # The deepest line of the student's is that of spin(), which is right.
    return Cause(
        f"{symptom.seen} with {failure}: a service's callback did not return a response",
        "A service's callback ends with `return response`, the object that it was called with.",
        symptom.evidence,
    )


@explanation(ProcessExit)
def package_not_installed(symptom: ProcessExit) -> Cause | None:
    """It imports a ROS 2 package that the machine lacks; an error, and never a lost point."""
    failure, recording = symptom.failure, symptom.recording
    if not failure or failure.type != "ModuleNotFoundError":
        return None
    installed = recording.environment.get("ros_imports", "").split()
    lacking = lacking_package(failure.message, recording.submission, installed)
    if lacking is None:
        return None
    apt_name = f"ros-jazzy-{lacking.replace('_', '-')}"
    return Cause(
        f"{symptom.seen}: it imports {code(lacking)}{symptom.where}, a ROS 2 package that is not "
        "installed where this is graded",
        f"No point is lost by it. Tell your instructor: `sudo apt install {apt_name}`.",
        symptom.evidence,
        ours=True,
    )


@explanation(ProcessExit)
def newer_python(symptom: ProcessExit) -> Cause | None:
    """It uses a name of a newer Python than the machine has; an error, and never a lost point."""
    newer = symptom.failure and newer_name(symptom.failure, symptom.recording)
    if not newer:
        return None
    return Cause(
        f"{symptom.seen}: it uses {code(newer.name)}{symptom.where}, which is not there where "
        "this is graded",
        f"It is right in ROS 2 Jazzy, which has {newer.home}, and no point is lost by it. Tell "
        f"your instructor: it needs {newer.home}. Or do without this name.",
        symptom.evidence,
        ours=True,
    )


@explanation(ProcessExit, general=True)
def raised(symptom: ProcessExit) -> Cause | None:
    """An exception ended it: see below what exceptions mean."""
    failure, evidence = symptom.failure, symptom.evidence
    if failure is None:
        return None
    return Cause(
        f"{symptom.seen} with {failure}{symptom.where}",
        cause_of(Raised(failure, symptom.recording)),
        replace(evidence, places=(symptom.place,) if symptom.place else ()),
    )


def offence(recording: Recording) -> Cause | None:
    """What the processes did that is never allowed, also where they ended before it was seen."""
    for breach in recording.breaches:
        if not breach.allowed:
            when_s = recording.since_launch_s(breach.time_ns)
            moment = Moment(breach.what, when_s)
            return Cause(str(breach), _BREACH_HINTS[breach.what], Evidence(moments=(moment,)))
    return None


def _wrong_class(lines: Sequence[str]) -> str:
    """What to try where ROS was given an object of another class, or nothing."""
    found = next((match for line in lines if (match := _OTHER_CLASS.search(line))), None)
    if found is None:
        return ""
    # A part of a service or an action: Fibonacci_Result is Fibonacci.Result in Python.
    name = re.sub(r"_(?=(Request|Response|Goal|Result|Feedback)$)", ".", found[1])
    return (
        f"ROS was given something that is no {code(name)}: return or publish one. A callback "
        "without `return` returns None."
    )


def _wrong_field(lines: Sequence[str]) -> str:
    """What to try where a field of a message held what it cannot."""
    found = next((match for line in lines if (match := _OTHER_FIELD.search(line))), None)
    return _FIELD_HINTS[found[1]] if found else ""


def _last_lines(recording: Recording, process: Process) -> tuple[str, ...]:
    lines = [
        line.text
        for line in recording.log
        if line.process == process.name and line.stream in ("stdout", "stderr")
    ]
    # Where colcon's script loads the entry point, Python does not leave its own frames out.
    lines = [line for line in lines if '"<frozen importlib' not in line]
    return tuple(lines[-_LOG_LINES:])
