"""Checks of what loggers say: at which level, with which words, how often."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.first_seen import until_the_end
from grader.checks.log.logged import LEVELS, Logged, logged, logger_of, printed
from grader.checks.wording import code, counted, percent
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_node import why_no_node, why_not_node
from grader.diagnosis.process.blocked_executor import why_not_called
from grader.diagnosis.process.process_exit import why_ended
from grader.measure.printed import quote
from grader.recording.model import NS, Recording
from grader.spec.name import QualifiedNodeName
from grader.spec.nearest_name import nearest
from grader.spec.quantity import Frequency, Ratio
from grader.spec.unit import format_duration

Level = Literal["DEBUG", "INFO", "WARN", "ERROR", "FATAL"]

_SHOWN = 5
# At the end of a run one record may be due, and one on its way.
_SILENT_PERIODS = 2.0
_METHODS = {"DEBUG": "debug", "INFO": "info", "WARN": "warning", "ERROR": "error", "FATAL": "fatal"}


def _pattern(text: str) -> str:
    try:
        re.compile(text)
    except re.error as error:
        raise ValueError(f"{text!r} is not a regular expression: {error}") from None
    return text


class Records(Parameters):
    """Part of the parameters of the checks of log records."""

    node: QualifiedNodeName | None = Field(
        None, description="Node whose logger is meant; by default every logger."
    )


class Matching(Records):
    """Part of the parameters of log.contains and log.rate."""

    text: str | None = Field(
        None, min_length=1, description="A text in the record, upper and lower case alike."
    )
    pattern: Annotated[str, AfterValidator(_pattern)] | None = Field(
        None, description="A regular expression of Python that is found in the record."
    )
    level: Level | None = Field(None, description="Level of the record; by default any.")

    @property
    def words(self) -> str:
        """Which records, in words."""
        level = f"{self.level} " if self.level else ""
        what = f" with “{self.text}”" if self.text is not None else ""
        what += f" that match {code(self.pattern)}" if self.pattern is not None else ""
        whose = f" of {code(self.node)}" if self.node else ""
        return f"{level}log messages{whose}{what}"

    def says(self, text: str) -> bool:
        """Whether a record's text is meant."""
        if self.text is not None and self.text.casefold() not in text.casefold():
            return False
        return self.pattern is None or re.search(self.pattern, text) is not None


def _of(recording: Recording, node: str | None) -> list[Logged]:
    wanted = None if node is None else logger_of(node)
    return [
        item
        for item in logged(recording)
        # A child logger, get_child('x'), is the node's as well.
        if wanted is None or item.logger == wanted or item.logger.startswith(f"{wanted}.")
    ]


class Contains(Matching):
    """Parameters of log.contains."""

    at_least: int = Field(1, ge=0, description="So many of them at least.")
    at_most: int | None = Field(None, ge=0, description="So many of them at most.")

    @model_validator(mode="after")
    def _sensible(self) -> Contains:
        if self.text is None and self.pattern is None:
            raise ValueError("say what the records contain: 'text' or 'pattern'")
        if self.at_most is not None and self.at_most < self.at_least:
            raise ValueError(f"at_least ({self.at_least}) is more than at_most ({self.at_most})")
        return self


@check("log.contains", Subject.RECORDING, Contains)
def contains(recording: Recording, parameters: Contains) -> Finding:
    """The node logs what it must, at the right level.

    Judged by the records of the loggers, on /rosout and in the lines that they write; each
    counts once, and printed lines do not count.
    """
    low, high = parameters.at_least, parameters.at_most
    bounds = f"{low} or more" if high is None else f"{low} to {high}" if low < high else str(low)
    expected = f"{bounds} {parameters.words}"
    records = _of(recording, parameters.node)
    saying = [item for item in records if parameters.says(item.text)]
    found = [item for item in saying if parameters.level in (None, item.level)]
    shown = _evidence(recording, found)
    if len(found) < low:
        return _why_lacking(recording, parameters, records, saying, found).finding(expected)
    if high is not None and len(found) > high:
        return Finding.failed(
            expected,
            f"{len(found)} of them, such as {quote(found[-1].text)}",
            "Log once where it happens, not in every call of a callback: "
            "self.get_logger().info(..., once=True), or throttle_duration_sec=1.0.",
            shown,
        )
    what = f"{len(found)}, such as {quote(found[0].text)}" if found else "none"
    return Finding.passed(expected, what, shown)


def _why_lacking(
    recording: Recording,
    parameters: Matching,
    records: list[Logged],
    saying: list[Logged],
    found: list[Logged],
) -> Cause:
    missing = why_not_node(recording, parameters.node) if parameters.node else None
    missing = missing or why_no_node(recording)
    if missing is not None:
        return missing
    method = _METHODS[parameters.level or "INFO"]
    hint = f"Is the line reached that calls self.get_logger().{method}('...') with such a text?"
    other = [item for item in saying if item not in found]
    if other:
        level = other[0].level
        return Cause(
            f"{quote(other[0].text)} is logged as {level}, not as {parameters.level}",
            f"Call self.get_logger().{method}('...').",
            _evidence(recording, other),
        )
    seen = f"only {len(found)} of them" if found else "none"
    ended = why_ended(recording, seen)
    if ended is not None:
        return ended
    lost = sum(process.dropped_bytes for process in recording.processes)
    if lost:
        return Cause(f"{seen}, but {lost} bytes of output were not kept", "Log less.", ours=True)
    idle = why_not_called(recording, seen, {node.name for node in recording.student_nodes})
    if idle is not None:
        return idle
    if found:
        return Cause(seen, hint, _evidence(recording, found))
    lines = [line for line in printed(recording) if parameters.says(line.text)]
    if lines:
        return Cause(
            f"{quote(lines[0].text)} is printed, not logged",
            f"Write self.get_logger().{method}('...') in place of print().",
            Evidence(
                moments=(Moment("printed", recording.since_launch_s(lines[0].time_ns)),),
                log=tuple(line.text for line in lines[:_SHOWN]),
            ),
        )
    if not records:
        nothing = until_the_end(recording, "nothing logged when the observation ended")
        return Cause("the node logs nothing", hint, Evidence(moments=(nothing,)))
    near = nearest(parameters.text or "", [item.text for item in records])
    like = quote(near if near is not None else records[-1].text)
    return Cause(
        f"{counted(len(records), 'log message')}, but none of these; "
        f"{'similar is' if near else 'the last is'} {like}",
        hint,
        _evidence(recording, records[-_SHOWN:]),
    )


class Worst(Records):
    """Parameters of log.level."""

    at_most: Level = Field("INFO", description="The most severe level that may be logged.")


@check("log.level", Subject.RECORDING, Worst)
def level(recording: Recording, parameters: Worst) -> Finding:
    """Nothing is logged that is more severe than allowed.

    Judged by the records of the loggers, on /rosout and in the lines that they write, until
    SIGINT.
    """
    whose = f" by {code(parameters.node)}" if parameters.node else ""
    expected = f"nothing logged{whose} above {parameters.at_most}"
    missing = why_not_node(recording, parameters.node) if parameters.node else None
    missing = missing or why_no_node(recording)
    if missing is not None:
        return missing.finding(expected)
    allowed = LEVELS.index(parameters.at_most)
    records = _of(recording, parameters.node)
    severe = [item for item in records if item.level in LEVELS[allowed + 1 :]]
    if not severe:
        return Finding.passed(expected, f"{counted(len(records), 'log message')}, none above it")
    first = severe[0]
    return Finding.failed(
        expected,
        f"{counted(len(severe), 'log message')} above it, the first {first.level}: "
        f"{quote(first.text)}",
        "Correct what it warns about; what is no problem is logged with "
        "self.get_logger().info('...') or debug('...').",
        _evidence(recording, severe),
    )


class Rate(Matching):
    """Parameters of log.rate."""

    rate: Frequency | None = Field(None, description="How often, in the mean.")
    tolerance: Ratio = Field(0.1, description="How far the mean rate may be from `rate`.")
    at_most: Frequency | None = Field(None, description="At most so often, in the mean.")
    at_least: Frequency | None = Field(None, description="At least so often, in the mean.")

    @model_validator(mode="after")
    def _sensible(self) -> Rate:
        given = (self.at_most, self.at_least)
        if self.rate is None and given == (None, None):
            raise ValueError("say how often: rate, at_least or at_most")
        if self.rate is not None and given != (None, None):
            raise ValueError("rate stands alone, without at_least and at_most")
        return self

    @property
    def bounds_hz(self) -> tuple[float, float]:
        """Lowest and highest rate."""
        if self.rate is not None:
            return self.rate * (1.0 - self.tolerance), self.rate * (1.0 + self.tolerance)
        return self.at_least or 0.0, self.at_most if self.at_most is not None else float("inf")


@check("log.rate", Subject.RECORDING, Rate)
def rate(recording: Recording, parameters: Rate) -> Finding:
    """The node logs as often as it must, and no more.

    Judged by the stamps of the records: their mean rate from the first to the last, or, of
    fewer than three, by how many there are in the time that was observed. With a lowest rate the
    node must log until the end of the observation: the last two periods may be silent.
    """
    low_hz, high_hz = parameters.bounds_hz
    if parameters.rate is not None:
        often = f"{parameters.rate:g} Hz (within {percent(parameters.tolerance)})"
    else:
        parts = [f"at least {low_hz:g} Hz"] if parameters.at_least is not None else []
        parts += [f"at most {high_hz:g} Hz"] if parameters.at_most is not None else []
        often = " and ".join(parts)
    expected = f"{parameters.words} at {often}"
    records = _of(recording, parameters.node)
    saying = [item for item in records if parameters.says(item.text)]
    found = [item for item in saying if parameters.level in (None, item.level)]
    begin_ns = recording.matched_ns or recording.launched_ns
    watched_s = (recording.stop_ns - begin_ns) / NS
    if len(found) >= 3:
        begin_ns, end_ns = found[0].time_ns, found[-1].time_ns
        rate_hz = (len(found) - 1) * NS / max(end_ns - begin_ns, 1)
    else:
        end_ns = recording.stop_ns
        rate_hz = len(found) / watched_s if watched_s > 0.0 else 0.0
    if low_hz <= rate_hz <= high_hz:
        silent = _fell_silent(recording, found, low_hz)
        if silent is not None:
            return silent.finding(expected)
        return Finding.passed(expected, f"{rate_hz:.3g} Hz", _evidence(recording, found))
    if not found:
        return _why_lacking(recording, parameters, records, saying, found).finding(expected)
    seen = f"{counted(len(found), 'log message')}, {rate_hz:.3g} Hz"
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    if rate_hz < low_hz and (end_ns - begin_ns) / NS - stolen_s <= len(found) / low_hz:
        return Finding.to_repeat(
            expected, f"{seen}, but the machine took {format_duration(stolen_s)}"
        )
    hint = (
        "Log in a timer of that period, or with throttle_duration_sec=1.0 in a faster callback: "
        "self.get_logger().info('...', throttle_duration_sec=1.0)."
    )
    return Finding.failed(expected, seen, hint, _evidence(recording, found))


def _fell_silent(recording: Recording, found: Sequence[Logged], low_hz: float) -> Cause | None:
    """Why the lowest rate is missed after the last record; None if it is not."""
    if not found or low_hz <= 0.0:
        return None
    last_ns = found[-1].time_ns
    silent_s = (recording.stop_ns - last_ns) / NS
    seen = f"{counted(len(found), 'log message')}, but none in the last {format_duration(silent_s)}"
    allowed_s = _SILENT_PERIODS / low_hz
    if silent_s <= allowed_s:
        return None
    stolen_s = recording.stolen_s(last_ns, recording.stop_ns)
    cause = why_ended(recording, seen)
    if cause is None and silent_s - stolen_s <= allowed_s:
        cause = Cause.to_repeat(f"{seen}: the machine took {format_duration(stolen_s)}")
    return cause or Cause(
        seen,
        "The node must go on logging: look for a counter or a condition that ends it, for a timer "
        "that is cancelled, and for a callback that does not return.",
        Evidence(moments=(Moment("last of them", recording.since_launch_s(last_ns)),)),
    )


def _evidence(recording: Recording, records: list[Logged]) -> Evidence:
    return Evidence(
        moments=tuple(
            Moment(f"{item.level} logged", recording.since_launch_s(item.time_ns))
            for item in records[:_SHOWN]
        ),
        log=tuple(f"[{item.level}] [{item.logger}]: {item.text}" for item in records[:_SHOWN]),
    )
