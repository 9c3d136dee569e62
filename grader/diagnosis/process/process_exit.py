"""Why a process ended before it was asked to: exit code, signal, exception, place."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from grader.diagnosis.explanation import Symptom, cause_of, explanation, mistaken, remedy
from grader.diagnosis.process.exceptions import Raised
from grader.diagnosis.process.failure import Failure
from grader.diagnosis.process.missing_library import lacking_here
from grader.diagnosis.process.newer_names import newer_name
from grader.diagnosis.process.raised import (
    defined_at,
    fatal_failure,
    in_brackets,
    own_frames,
    raised_at,
)
from grader.findings.finding import Evidence, Finding, Moment, evidence_at
from grader.findings.words import SPIN, Words, code
from grader.measure import declarations
from grader.recording.model import Ending, Process, Recording
from grader.recording.submission import PYTHON, SourceError
from grader.spec.source import Model, read_source

_LOG_LINES = 15
# What a failure ends a compiled program by.
_CRASHES = ("SIGSEGV", "SIGABRT", "SIGFPE", "SIGILL", "SIGBUS")
# What rcl says of a file that it is given by --params-file.
_PARAMETER_FILE = re.compile(
    r"Couldn't parse params file: '--params-file (?P<file>[^']+)'\. Error: "
    r"(?P<why>.+?)(?: at line (?P<line>\d{1,6}))?, at \S+:\d+"
)
# As `ros2 launch` says it.
_NO_LAUNCH_FILE = re.compile(
    r"file '(?P<file>[^']+)' was not found in the share directory of package '(?P<package>[^']+)'"
)

# What rclpy.node.Node has and calls, and what no class of a student's may replace.
_OF_NODE = re.compile(
    "clients|context|default_callback_group|executor|get_clock|get_logger|get_name|get_namespace|"
    "get_parameter|guards|handle|publishers|services|subscriptions|timers|waitables"
)
_SET = re.compile(r"self\.(\w+) *(?::.*)?=")


class Table(Model):
    """The whole of ``process_exit.yaml``: signals in words, and hints by signal and by breach."""

    signals: dict[str, str]
    hints: dict[str, str | Words]


TABLE = read_source(Path(__file__).with_suffix(".yaml")).read(Table)


def ended_early(recording: Recording, process: Process) -> bool:
    """Whether a process ended by itself before the end of the observation.

    One that was already on its way out when SIGINT came did, too: how long that takes is a
    matter of the machine.
    """
    if process.exited_ns is None:
        return False
    if process.stopped_by == "itself":
        return recording.ending is Ending.EXITED or process.exited_ns < recording.stop_ns
    exiting_ns = declarations.exiting_ns(recording, process.name)
    was_leaving = exiting_ns is not None and exiting_ns < recording.stop_ns
    return was_leaving and process.exited_ns >= recording.stop_ns


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
    words = f" ({TABLE.signals[number.name]})" if number.name in TABLE.signals else ""
    through_shell = f", reported as exit code {exit_code}" if exit_code > 0 else ""
    return f"{number.name}{words}{through_shell}"


def signal_of(exit_code: int) -> signal.Signals | None:
    """The signal that ended a process, also where a shell between reported 128 + signal."""
    number = -exit_code if exit_code < 0 else exit_code - 128
    try:
        found = signal.Signals(number)
    except ValueError:
        return None
    return found if exit_code < 0 or found.name in TABLE.signals else None


def why_ended(recording: Recording, seen: str = "") -> Finding | None:
    """The cause if a process ended early, after what was seen of it; None if none did."""
    return _why_first(recording, exited(recording), seen)


def why_crashed(recording: Recording) -> Finding | None:
    """The cause if a process ended early with a failure; None if none did."""
    return _why_first(recording, crashed(recording), "")


def _why_first(recording: Recording, ended: Sequence[Process], seen: str) -> Finding | None:
    if not ended:
        return None
    cause = why_it_exited(recording, ended[0])
    return cause.after(seen) if seen else cause


@dataclass(frozen=True)
class ProcessExit(Symptom[Finding], concept="nodes"):
    """A process ended too early."""

    recording: Recording
    process: Process

    @property
    def _is_leaving(self) -> bool:
        return self.process.stopped_by != "itself"

    @property
    def _when_s(self) -> float:
        leaving_ns = declarations.exiting_ns(self.recording, self.process.name)
        exited_ns = leaving_ns if self._is_leaving else self.process.exited_ns
        return self.recording.since_launch_s(exited_ns or self.recording.stop_ns)

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
        """The exception that ended it, or the crash of a compiled program."""
        failure = fatal_failure(self.recording, self.process.name)
        if not declarations.is_compiled(self.recording, self.process.name):
            is_cause = not self.killed or (failure is not None and failure.type == "Assertion")
            return failure if is_cause else None
        if failure is None and self.killed and self.killed.name in _CRASHES:
            words = TABLE.signals[self.killed.name]
            return Failure(self.killed.name, words, (), compiled=True)
        return failure

    @property
    def place(self) -> SourceError | None:
        """The student's line that raised it."""
        failure = self.failure
        return raised_at(failure, self.recording) if failure else None

    @property
    def returned(self) -> bool:
        """Whether it ended without a failure."""
        failed = fatal_failure(self.recording, self.process.name)
        return self.process.exit_code == 0 or (self._is_leaving and failed is None)


def why_it_exited(recording: Recording, process: Process) -> Finding:
    """Why a process ended early, with its exception and the student's line if there is one."""
    return cause_of(ProcessExit(recording, process))


@dataclass(frozen=True)
class NotDone(Symptom[Finding]):
    """A program did not do what was asked for."""

    recording: Recording
    only_failures = False
    """Whether a program that returned is no explanation, for it may have done its part."""

    @property
    def seen(self) -> str:
        """The symptom in words; empty where the end of the process says enough."""
        return ""

    @property
    def ended(self) -> Sequence[Process]:
        """Processes whose early end explains it, the likeliest first."""
        return crashed(self.recording) if self.only_failures else exited(self.recording)


@explanation(NotDone, concept="nodes")
def process_ended(symptom: NotDone) -> Finding | None:
    """The process ended."""
    return _why_first(symptom.recording, symptom.ended, symptom.seen)


@explanation(ProcessExit)
def main_returned(symptom: ProcessExit) -> Finding | None:
    """main() returns: there is no node or no rclpy.spin(), or spin_once() or sys.exit() ends it."""
    recording, name = symptom.recording, symptom.process.name
    if not symptom.returned:
        return None
    how = ", or something ended the program"
    if declarations.traced(recording, name) and not declarations.declares(recording, "node", name):
        how = " before a node was created"
    elif declarations.never_spun(recording, name):
        how = f" without {SPIN}"
    return mistaken(
        "main_returned", f"{symptom.seen} with exit code 0: main() returned{how}", symptom.evidence
    )


@explanation(ProcessExit)
def limit_exceeded(symptom: ProcessExit) -> Finding | None:
    """It used too much memory, CPU time or output, or did something forbidden."""
    breach = next((item for item in symptom.recording.breaches if item.ended), None)
    if symptom.killed is not signal.SIGKILL or breach is None:
        return None
    return Finding(f"{symptom.seen}: {breach}", str(TABLE.hints[breach.what]), symptom.evidence)


@explanation(ProcessExit)
def launch_file_not_installed(symptom: ProcessExit) -> Finding | None:
    """The launch file is not installed: data_files in setup.py or install() in CMake lacks it."""
    match = _first_match(_NO_LAUNCH_FILE, symptom.evidence.log)
    if match is None or symptom.failure is not None:
        return None
    name, package = match["file"], match["package"]
    return mistaken(
        "launch_file_not_installed",
        f"{symptom.seen}: the package {code(package)} installed no {code(name)}",
        symptom.evidence,
        name=code(name),
        package=package,
    )


@explanation(ProcessExit)
def parameter_file_unreadable(symptom: ProcessExit) -> Finding | None:
    """ROS cannot read a parameter file, such as one with `ros_parameters` for `ros__parameters`."""
    match = _first_match(_PARAMETER_FILE, symptom.evidence.log)
    if match is None:
        return None
    installed, why = PurePosixPath(match["file"]), match["why"]
    line = int(match["line"]) if match["line"] else None
    files = [PurePosixPath(path) for path in symptom.recording.submission.files]
    alike = [str(path) for path in files if path.parts[-2:] == installed.parts[-2:]]
    file = alike[0] if alike else installed.name
    return mistaken(
        "no_ros_parameters" if "ros__parameters" in why else "broken_parameters",
        f"{symptom.seen}: ROS cannot read the parameter file {code(file)}: {why}",
        replace(symptom.evidence, places=(SourceError(file, line, why),)),
    )


def _first_match(pattern: re.Pattern[str], lines: Iterable[str]) -> re.Match[str] | None:
    return next(filter(None, map(pattern.search, lines)), None)


@explanation(ProcessExit)
def ended_by_signal(symptom: ProcessExit) -> Finding | None:
    """A signal ended it, such as SIGSEGV, or it ended with an exit code and no traceback."""
    if symptom.failure is not None:
        return None
    killed, evidence = symptom.killed, symptom.evidence
    hint = TABLE.hints.get(killed.name if killed else "", remedy("ended_by_signal"))
    return Finding(
        f"{symptom.seen} with {exit_words(symptom.process.exit_code)}", str(hint), evidence
    )


@explanation(ProcessExit, only=PYTHON)
def service_without_response(symptom: ProcessExit) -> Finding | None:
    """The callback of a service does not return its response."""
    failure = symptom.failure
    if not failure or failure.type != "TypeError" or failure.frames[-1].where != "send_response":
        return None
    # The deepest line of the student's is that of spin(), which is right.
    recording, services = symptom.recording, {one.name for one in symptom.recording.services}
    runs = [one for one in recording.declared("ran") if one.process == symptom.process.name]
    callbacks = [
        str(one.data.get("callback")) for one in runs if one.data.get("serves") in services
    ]
    place = defined_at(callbacks[-1], str(failure), recording.submission) if callbacks else None
    return mistaken(
        "service_without_response",
        f"{symptom.seen} with {failure}: a service's callback did not return a response"
        f"{in_brackets(place)}",
        replace(symptom.evidence, places=(place,) if place else ()),
    )


@explanation(ProcessExit, only=PYTHON)
def hides_what_node_has(symptom: ProcessExit) -> Finding | None:
    """A method or an attribute has a name that Node uses itself, such as handle or executor."""
    failure = symptom.failure
    if not failure or not failure.frames or "/rclpy/" not in failure.frames[-1].file:
        return None
    places = list(_methods_of_nodes(symptom.recording, str(failure)))
    if symptom.place:
        assigned = (_SET.match(frame.source) for frame in failure.frames)
        places += [(match[1], symptom.place) for match in assigned if match]
    for name, place in places:
        if _OF_NODE.fullmatch(name):
            return mistaken(
                "hides_what_node_has",
                f"{symptom.seen} with {failure}: your class replaces {code(name)} of Node"
                f"{in_brackets(place)}",
                replace(symptom.evidence, places=(place,)),
                name=code(name),
            )
    return None


def _methods_of_nodes(recording: Recording, message: str) -> Iterator[tuple[str, SourceError]]:
    """The names of methods in the student's classes of nodes, and where they are."""
    for package in recording.submission.packages:
        for source in package.sources:
            for owner in source.classes:
                if any(base.endswith("Node") for base in owner.bases):
                    for function in source.functions:
                        space, _, name = function.name.rpartition(".")
                        if space == owner.name:
                            yield name, SourceError(source.path, function.line, message)


@explanation(ProcessExit)
def machine_lacks_it(symptom: ProcessExit) -> Finding | None:
    """It needs something of ROS 2 or of its Python that the machine lacks; this costs no points."""
    failure, recording = symptom.failure, symptom.recording
    if failure is None:
        return None
    lacking = newer_name(failure, recording) or lacking_here(failure, recording)
    if lacking is None:
        return None
    name, needs = lacking
    return Finding.ours(
        f"{symptom.seen}: it uses {code(name)}{in_brackets(symptom.place)}: ROS 2 Jazzy has "
        "it, but it is not installed on the machine that grades",
        remedy("machine_lacks_it", needs=needs),
    )


@explanation(ProcessExit, general=True)
def raised(symptom: ProcessExit) -> Finding | None:
    """An exception ended it: see the list of exceptions below."""
    failure = symptom.failure
    if failure is None:
        return None
    where = in_brackets(symptom.place)
    if failure.compiled and failure.frames and not where:
        where = f" in {code(failure.frames[-1].where)}"
    return Finding(
        f"{symptom.seen} with {failure}{where}",
        cause_of(Raised(failure, symptom.recording)),
        replace(symptom.evidence, places=(symptom.place,) if symptom.place else ()),
    )


def offence(recording: Recording) -> Finding | None:
    """What the sandbox ends processes for, also where it was seen only after their end."""
    for breach in recording.breaches:
        if breach.ended:
            shown = evidence_at(recording, breach.what, breach.time_ns)
            return Finding(str(breach), str(TABLE.hints[breach.what]), shown)
    return None


def _last_lines(recording: Recording, process: Process) -> tuple[str, ...]:
    lines = [
        line.text
        for line in recording.log
        if line.process == process.name
        and line.stream in ("stdout", "stderr")
        # Where colcon's script loads the entry point, Python does not leave its own frames out.
        and '"<frozen importlib' not in line.text
    ]
    return tuple(own_frames(lines, recording.submission)[-_LOG_LINES:])
