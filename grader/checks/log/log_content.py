"""Checks of the records of loggers: at which level, with which words, how often."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, Field, model_validator

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.diagnosis.explanation import explain, mistaken
from grader.diagnosis.no_node import why_no_node, why_not_node
from grader.diagnosis.process.not_called import Uncalled, left_s
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.wrong_rhythm import why_paused
from grader.findings.finding import Evidence, Finding, evidence_at, moment, until_the_end
from grader.findings.text import check_asked, says
from grader.findings.words import code, counted, percent, worded
from grader.measure.printed import logged_text, quote
from grader.recording.model import NS, LogLine, Recording
from grader.spec.name import QualifiedNodeName
from grader.spec.nearest_name import nearest
from grader.spec.quantity import Frequency, Ratio
from grader.spec.unit import format_duration

Level = Literal["DEBUG", "INFO", "WARN", "ERROR", "FATAL"]
LEVELS = get_args(Level)

_SHOWN = 5
# At the end of a run one record may be due, and one on its way.
_SILENT_PERIODS = 2.0
_LINE = re.compile(
    r"\[(?P<level>[A-Z]+)\] \[(?P<s>\d{1,12})\.(?P<ns>\d{9})\] \[(?P<logger>[^\]]*)\]: ?"
)


@dataclass(frozen=True)
class Logged:
    """One record of a logger.

    Attributes:
        logger: Name, such as ``bot`` or ``robot.bot``.
    """

    time_ns: int
    logger: str
    level: str
    text: str


def logged(recording: Recording) -> tuple[Logged, ...]:
    """Every record of a logger until the end of the observation, oldest first."""
    found = [
        Logged(line.time_ns, line.process, line.level, line.text)
        for line in recording.log
        if line.stream == "rosout"
    ]
    known = {(item.time_ns, item.logger) for item in found}
    for line in recording.log:
        match = _LINE.match(line.text) if line.stream != "rosout" else None
        if match is None or match["level"] not in LEVELS:
            continue
        time_ns = int(match["s"]) * 10**9 + int(match["ns"])
        if (time_ns, match["logger"]) not in known:
            text = line.text[match.end() :]
            found.append(Logged(time_ns, match["logger"], match["level"], text))
    kept = (item for item in found if item.time_ns <= recording.stop_ns)
    return tuple(sorted(kept, key=lambda item: item.time_ns))


def _pattern(text: str) -> str:
    check_asked({"matches": text})
    return text


def _number(text: str) -> str:
    check_asked({"number": text})
    return text


def printed(recording: Recording) -> list[LogLine]:
    """Lines of output until the end of the observation that no logger wrote."""
    return [
        line
        for line in recording.log
        if line.stream != "rosout"
        and logged_text(line.text) == line.text
        and line.time_ns <= recording.stop_ns
    ]


class Records(Parameters):
    """Part of the parameters of the checks of log records."""

    node: QualifiedNodeName | None = Field(
        None, description="Node whose log records count; by default all."
    )

    def of(self, recording: Recording) -> list[Logged]:
        """The records of that logger, and of its child loggers, get_child('x')."""
        name = None if self.node is None else self.node.strip("/").replace("/", ".")
        return [
            item
            for item in logged(recording)
            if name is None or item.logger == name or item.logger.startswith(f"{name}.")
        ]

    def why_no_node(self, recording: Recording) -> Finding | None:
        """Why nothing can be logged: the node is not there."""
        missing = why_not_node(recording, self.node) if self.node else None
        return missing or why_no_node(recording)


class Matching(Records):
    """Part of the parameters of log.contains and log.rate."""

    text: str | None = Field(
        None, min_length=1, description="A text in the record; upper and lower case do not matter."
    )
    pattern: Annotated[str, AfterValidator(_pattern)] | None = Field(
        None, description="A regular expression of Python that is found in the record."
    )
    number: Annotated[str, AfterValidator(_number)] | float | None = Field(
        None,
        description="What a number in the record must be, such as `42`, `> 0` or `0.1 .. 0.5`.",
    )
    level: Level | None = Field(None, description="Level of the record; by default any.")

    @property
    def words(self) -> str:
        """Which records, in words."""
        words = f"{self.level} log messages" if self.level else "log messages"
        if self.node:
            words += f" of {code(self.node)}"
        if self.text is not None:
            words += f" with “{self.text}”"
        if self.pattern is not None:
            words += f" that match {code(self.pattern)}"
        if self.number is not None:
            words += f" with a number {self.number}"
        return words

    def says(self, text: str) -> bool:
        """Whether a record has the text."""
        return says(text, self.text, self.pattern, self.number)

    def found(self, recording: Recording) -> list[Logged]:
        """The records with the text at the level."""
        return [
            item
            for item in self.of(recording)
            if self.says(item.text) and self.level in (None, item.level)
        ]


class Contains(Matching):
    """Parameters of log.contains."""

    at_least: int = Field(1, ge=0, description="Least number of such records.")
    at_most: int | None = Field(None, ge=0, description="Largest number of such records.")
    printed: bool = Field(
        False, description="Whether lines that a process prints count, too. They have no level."
    )

    def of(self, recording: Recording) -> list[Logged]:
        """The records, and what was printed if that counts."""
        lines = printed(recording) if self.printed else []
        return sorted(
            [*super().of(recording), *(Logged(one.time_ns, "", "", one.text) for one in lines)],
            key=lambda item: item.time_ns,
        )

    def _asked(self) -> str:
        low, high = self.at_least, self.at_most
        if high is None:
            return f"{low} or more {self.words}"
        return f"{low} to {high} {self.words}" if low < high else f"{low} {self.words}"

    @model_validator(mode="after")
    def _sensible(self) -> Contains:
        if self.text is None and self.pattern is None and self.number is None:
            raise ValueError("say what the records contain: 'text', 'pattern' or 'number'")
        if self.at_most is not None and self.at_most < self.at_least:
            raise ValueError(f"at_least ({self.at_least}) is more than at_most ({self.at_most})")
        return self


@check("log.contains", Subject.RECORDING, Contains)
def contains(recording: Recording, parameters: Contains) -> Finding:
    """The node logs the expected text at the expected level.

    Judged by the log records, on /rosout and in the output. Each record counts once. Printed lines
    do not count, except with `printed: true`.
    """
    low, high = parameters.at_least, parameters.at_most
    found = parameters.found(recording)
    if len(found) < low:
        return _why_lacking(recording, parameters, found)
    if high is not None and len(found) > high:
        seen = f"{len(found)} of them, such as {quote(found[-1].text)}"
        return mistaken("logs_too_often", seen, _evidence(recording, found))
    what = f"{len(found)}, such as {quote(found[0].text)}" if found else "none"
    return Finding.as_asked(what, _evidence(recording, found))


def _why_lacking(recording: Recording, parameters: Matching, found: list[Logged]) -> Finding:
    """Why too few of the records are there."""
    level = parameters.level or "INFO"
    call = worded(
        python=f"self.get_logger().{'warning' if level == 'WARN' else level.lower()}('...')",
        cpp=f'RCLCPP_{level}(get_logger(), "...")',
    )
    records = parameters.of(recording)
    others = [item for item in records if parameters.says(item.text) and item not in found]
    if others:
        observed = f"{quote(others[0].text)} is logged as {others[0].level}, not as {level}"
        return mistaken("other_level", observed, _evidence(recording, others), call=call)
    seen = f"only {len(found)} of them" if found else "none"
    cause = _why_not_run(recording, parameters, seen)
    if cause is not None:
        return cause
    lines = [line for line in printed(recording) if parameters.says(line.text)]
    if lines and not found:
        log = (line.text for line in lines[:_SHOWN])
        shown = evidence_at(recording, "printed", lines[0].time_ns, log=log)
        seen = f"{quote(lines[0].text)} is printed, not logged"
        return mistaken("printed", seen, shown, call=call)
    prints = isinstance(parameters, Contains) and parameters.printed
    mistake = "not_shown" if prints else "not_logged"
    if not records:
        nothing = until_the_end(recording, "nothing logged when the observation ended")
        return mistaken(mistake, "the node logs nothing", Evidence(moments=(nothing,)), call=call)
    if not found:
        seen = f"{counted(len(records), 'log message')}, but none of these"
        near = nearest(parameters.text or "", [item.text for item in records])
        if near:
            seen += f"; similar is {quote(near)}"
    return mistaken(mistake, seen, _evidence(recording, found or records[-_SHOWN:]), call=call)


def _why_not_run(recording: Recording, parameters: Matching, seen: str) -> Finding | None:
    """Why what logs did not run, or its output was not kept; None if neither is so."""
    cause = parameters.why_no_node(recording) or why_ended(recording, seen)
    if cause is not None:
        return cause
    lost = sum(process.dropped_bytes for process in recording.processes)
    if lost:
        return Finding.ours(f"{seen}, but {lost} bytes of output were not kept", "Log less.")
    nodes = {node.name for node in recording.student_nodes}
    return explain(Uncalled(recording, seen, nodes))


class Worst(Records):
    """Parameters of log.level."""

    at_most: Level = Field("INFO", description="The most severe level that may be logged.")

    def _asked(self) -> str:
        return f"nothing logged{f' by {code(self.node)}' if self.node else ''} above {self.at_most}"


@check("log.level", Subject.RECORDING, Worst)
def level(recording: Recording, parameters: Worst) -> Finding:
    """The node logs nothing more severe than allowed.

    Judged by the log records, on /rosout and in the output, until SIGINT.
    """
    stop_if(parameters.why_no_node(recording))
    records = parameters.of(recording)
    above = LEVELS[LEVELS.index(parameters.at_most) + 1 :]
    severe = [item for item in records if item.level in above]
    if not severe:
        seen = f"{counted(len(records), 'log message')}, none above it"
        return Finding.as_asked(seen)
    observed = f"{counted(len(severe), 'log message')} above it, the first {severe[0].level}"
    seen = f"{observed}: {quote(severe[0].text)}"
    return mistaken("severe", seen, _evidence(recording, severe))


class Rate(Matching):
    """Parameters of log.rate."""

    rate: Frequency | None = Field(None, description="Expected mean rate.")
    tolerance: Ratio = Field(0.1, description="How far the mean rate may be from `rate`.")
    at_most: Frequency | None = Field(None, description="Highest mean rate.")
    at_least: Frequency | None = Field(None, description="Lowest mean rate.")

    @model_validator(mode="after")
    def _sensible(self) -> Rate:
        given = (self.at_most, self.at_least)
        if self.rate is None and given == (None, None):
            raise ValueError("say how often: rate, at_least or at_most")
        if self.rate is not None and given != (None, None):
            raise ValueError("'rate' cannot be used with 'at_least' or 'at_most'")
        return self

    @property
    def bounds_hz(self) -> tuple[float, float]:
        """Lowest and highest rate."""
        if self.rate is not None:
            return self.rate * (1.0 - self.tolerance), self.rate * (1.0 + self.tolerance)
        return self.at_least or 0.0, math.inf if self.at_most is None else self.at_most

    def _asked(self) -> str:
        if self.rate is not None:
            return f"{self.words} at {self.rate:g} Hz (within {percent(self.tolerance)})"
        bounds = {"at least": self.at_least, "at most": self.at_most}
        texts = [f"{name} {hz:g} Hz" for name, hz in bounds.items() if hz is not None]
        return f"{self.words} at {' and '.join(texts)}"


@check("log.rate", Subject.RECORDING, Rate)
def rate(recording: Recording, parameters: Rate) -> Finding:
    """The node logs at the expected rate.

    Judged by the timestamps of the records: their mean rate from the first to the last. With fewer
    than three records, judged by their number in the observed time. With a lowest rate the node
    must log until the end of the observation: the last two periods may be silent.
    """
    low_hz, high_hz = parameters.bounds_hz
    found = parameters.found(recording)
    if len(found) >= 3:
        begin_ns, end_ns = found[0].time_ns, found[-1].time_ns
        periods = len(found) - 1
    else:
        begin_ns, end_ns = recording.matched_ns or recording.launched_ns, recording.stop_ns
        periods = len(found)
    rate_hz = periods * NS / max(end_ns - begin_ns, 1)
    seen = f"{counted(len(found), 'log message')}, {rate_hz:.3g} Hz"
    if low_hz <= rate_hz <= high_hz:
        stop_if(_why_stopped(recording, found, low_hz))
        return Finding.as_asked(f"{rate_hz:.3g} Hz", _evidence(recording, found))
    if not found:
        return _why_lacking(recording, parameters, found)
    if rate_hz < low_hz and left_s(recording, begin_ns, end_ns) <= len(found) / low_hz:
        return Finding.held_up(seen, recording.stolen_s(begin_ns, end_ns))
    return mistaken("other_log_rate", seen, _evidence(recording, found))


def _why_stopped(recording: Recording, found: list[Logged], low_hz: float) -> Finding | None:
    """Why nothing more was logged at the end of the observation; None if it was not too long."""
    if not found or not low_hz:
        return None
    last_ns = found[-1].time_ns
    return why_paused(
        recording,
        (last_ns, recording.stop_ns),
        _SILENT_PERIODS / low_hz,
        f"{counted(len(found), 'log message')}, but none in the last "
        f"{format_duration((recording.stop_ns - last_ns) / NS)}",
        "stops_logging",
    )


def _evidence(recording: Recording, records: list[Logged]) -> Evidence:
    shown = records[:_SHOWN]
    moments = (
        moment(recording, f"{item.level} logged" if item.level else "printed", item.time_ns)
        for item in shown
    )
    log = (
        f"[{item.level}] [{item.logger}]: {item.text}" if item.level else item.text
        for item in shown
    )
    return Evidence(moments=tuple(moments), log=tuple(log))
