"""Why the log does not show what the node was sent, or what it publishes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.explanation import explanation, mistaken, remedy
from grader.diagnosis.no_messages import why_few, why_not_delivered
from grader.diagnosis.process.not_called import (
    CalledLate,
    blocked_executor,
    callback_raised,
    no_cpu_time,
    slow_callbacks,
)
from grader.diagnosis.process.process_exit import process_ended
from grader.diagnosis.process.raised import defined_at
from grader.diagnosis.wrong_value import factor_words
from grader.findings.finding import Evidence, Finding, Moment, endpoints_seen, first_seen, moment
from grader.findings.words import code, counted, listing
from grader.measure.printed import (
    UNFILLED,
    Echo,
    Wanted,
    echoes,
    exchanged,
    logged_text,
    numbers,
    output_lines,
    quote,
    shown,
)
from grader.recording.model import NS, Kind, LogLine
from grader.recording.submission import SourceError
from grader.spec.expression import Expression
from grader.spec.unit import format_duration

_LOG_LINES = 5
# Lines with the same wrong factor: a single number may be like another by chance.
_LEAST_ALIKE = 2
# What a subscription must request for the messages from before it was there.
_KEEPS = ("transient_local", "unknown")
_RESENDS = ("reliable", "unknown")


@dataclass(frozen=True)
class NotLogged(CalledLate):
    """The log does not show what the node received or publishes.

    Attributes:
        wanted: What the log should show of each message.
        logged: Messages that log lines follow.
        needed: How many there must be.
        decimals: How many decimals must be right.
        within_ns: How soon after its message a line must have come.
    """

    topic: str
    wanted: Sequence[Wanted]
    logged: Sequence[Echo]
    needed: int
    decimals: int
    within_ns: int
    # Which endpoint of the student has the messages, and how its code comes by them.
    kind: ClassVar[Kind] = Kind.SUBSCRIPTION
    given: ClassVar[str] = "the callback is given"

    @property
    def seen(self) -> str:
        """The symptom in words."""
        if self.logged:
            messages = counted(len(self.wanted), "message")
            return f"log lines follow only {len(self.logged)} of {messages} on {code(self.topic)}"
        return f"no log line shows a message on {code(self.topic)}"

    @property
    def nodes(self) -> set[str]:
        """The nodes with a subscription to the topic, or with a publisher."""
        return {end.node for end in self.recording.student_endpoints(self.kind, self.topic)}

    @property
    def since_ns(self) -> int:
        """When the first message came."""
        return self.recording.carried(self.topic)[0].stamp_ns

    @property
    def late(self) -> str:
        """The symptom in words, where lines may be late."""
        if self.logged:
            return self.seen
        # What a late line shows may look like something else of the message that came before it.
        return f"{self.seen} within {format_duration(self.within_ns / NS)} of it"

    @property
    def excuse(self) -> Finding | None:
        """The machine's doing, if enough lines came but for that, or nothing is proven."""
        begin_ns, end_ns = self.wanted[0].message.stamp_ns, self.wanted[-1].due_ns + self.within_ns
        recording = self.recording
        forgiven = echoes(recording, self.wanted, self.decimals, self.within_ns, forgive=True)
        if len(forgiven) < self.needed:
            return self.starved(begin_ns, end_ns)
        return Finding.held_up(self.late, recording.stolen_s(begin_ns, end_ns))

    @property
    def candidates(self) -> list[LogLine]:
        """Lines that could have been an answer to a message, by their time."""
        begin_ns, end_ns = self.wanted[0].begin_ns, self.wanted[-1].due_ns + self.within_ns
        lines = output_lines(self.recording)
        return [line for line in lines if begin_ns <= line.time_ns <= end_ns]

    @property
    def callbacks(self) -> tuple[SourceError, ...]:
        """The places of the callbacks that get the messages."""
        declared = [item.data for item in self.recording.declared("subscription")]
        names = {str(data.get("callback")) for data in declared if data.get("topic") == self.topic}
        message = f"messages on {code(self.topic)} come here"
        places = [defined_at(name, message, self.recording.submission) for name in sorted(names)]
        return tuple(place for place in places if place is not None)

    def evidence(self, line: LogLine) -> Evidence:
        """A line with other values, and others near the messages."""
        others = [other.text for other in self.candidates if other != line][: _LOG_LINES - 1]
        moments = (moment(self.recording, "other values logged", line.time_ns),)
        return Evidence(moments, self.callbacks, (*others, line.text))


@dataclass(frozen=True)
class ReceivedNotLogged(NotLogged):
    """The log does not show what the node received."""


@dataclass(frozen=True)
class PublishedNotLogged(NotLogged):
    """The log does not show what the node publishes."""

    kind = Kind.PUBLISHER
    given = "is published"
    # No callback must be called for it: what a node publishes it may log anywhere.
    needs_spin = False


@explanation(ReceivedNotLogged, before=(process_ended,))
def not_delivered(symptom: ReceivedNotLogged) -> Finding | None:
    """The messages do not reach the node."""
    return why_not_delivered(symptom.recording, symptom.topic)


@explanation(ReceivedNotLogged, after=(process_ended,), before=(no_cpu_time,), concept="qos")
def no_history(symptom: ReceivedNotLogged) -> Finding | None:
    """A late joiner does not request earlier messages (transient_local)."""
    wanted, recording = symptom.wanted, symptom.recording
    if not wanted or wanted[-1].message.stamp_ns >= recording.launched_ns:
        return None
    for item in recording.student_endpoints(symptom.kind, symptom.topic):
        durability, reliability = item.qos.durability, item.qos.reliability
        if durability in _KEEPS and reliability in _RESENDS:
            continue
        return mistaken(
            "no_history",
            f"{symptom.seen}: the messages were published before the subscription was there, and "
            f"it requests durability {durability} and reliability {reliability}. It matches the "
            "publisher, but gets only what is published from then on",
            Evidence(moments=endpoints_seen(recording, (item,))),
        )
    return None


@explanation(ReceivedNotLogged, before=(no_cpu_time,))
def too_few_sent(symptom: ReceivedNotLogged) -> Finding | None:
    """Too few messages were sent: the program destroyed its subscription, or a fault occurred."""
    number = len(symptom.wanted)
    if number >= symptom.needed:
        return None
    sent = f"only {counted(number, 'message was', 'messages were')} sent on {code(symptom.topic)}"
    return why_unsubscribed(symptom.recording, symptom.topic, sent) or Finding.undecided(sent)


@explanation(PublishedNotLogged, after=(process_ended,), before=(no_cpu_time,))
def too_few_published(symptom: PublishedNotLogged) -> Finding | None:
    """The node published too few messages."""
    if len(symptom.wanted) >= symptom.needed:
        return None
    return why_few(symptom.recording, symptom.topic, symptom.needed)


@explanation(ReceivedNotLogged, after=(no_cpu_time,), before=(callback_raised,))
def subscription_destroyed(symptom: ReceivedNotLogged) -> Finding | None:
    """The program destroyed its subscription."""
    return why_unsubscribed(symptom.recording, symptom.topic, symptom.seen)


@explanation(NotLogged, after=(blocked_executor,), before=(slow_callbacks,))
def output_dropped(symptom: NotLogged) -> Finding | None:
    """The program wrote more than is kept; this is an error and costs no points."""
    dropped = sum(process.dropped_bytes for process in symptom.recording.processes)
    if not dropped:
        return None
    return Finding.ours(
        f"nothing about {code(symptom.topic)} is in the output that was kept, but the process "
        f"wrote {dropped} bytes more",
        remedy("output_dropped"),
    )


@explanation(NotLogged, after=(slow_callbacks,))
def only_some_logged(symptom: NotLogged) -> Finding | None:
    """Only some messages are logged: an if, once=True or throttle_duration_sec skips the others."""
    recording, topic, logged = symptom.recording, symptom.topic, symptom.logged
    if not logged:
        return None
    times_s = [recording.since_launch_s(echo.lines[-1].time_ns) for echo in logged]
    written = listing(f"{time_s:.2f} s" for time_s in times_s)
    return mistaken(
        "only_some_logged",
        f"{symptom.seen}, written {written} after launch",
        Evidence(
            moments=tuple(Moment(f"logged a message on {topic}", time_s) for time_s in times_s),
            log=tuple(line.text for echo in logged for line in echo.lines)[:_LOG_LINES],
        ),
    )


@explanation(NotLogged)
def no_f_string(symptom: NotLogged) -> Finding | None:
    """The lines show `{x}` or `%f` instead of values: no f before the quotes."""
    line = _likely_answer(symptom)
    if line is None:
        return None
    unfilled = UNFILLED.search(logged_text(line.text))
    if unfilled is None:
        return None
    return mistaken(
        "no_f_string",
        f"log lines follow messages on {code(symptom.topic)}, but they show {code(unfilled[0])} "
        f"instead of a value: {quote(line.text)}",
        symptom.evidence(line),
    )


@explanation(NotLogged)
def wrong_sign_or_unit(symptom: NotLogged) -> Finding | None:
    """The lines show a value 10, 100 or 1000 times too large, in degrees, or with a wrong sign."""
    lines_by_mistake = _lines_by_mistaken_factor(symptom)
    if not lines_by_mistake:
        return None
    (path, words), lines = max(lines_by_mistake.items(), key=lambda entry: len(entry[1]))
    if len(lines) < max(_LEAST_ALIKE, symptom.needed):
        return None
    return mistaken(
        "logs_other_unit",
        f"log lines follow messages on {code(symptom.topic)}, but {code(path)} in them {words}: "
        f"{quote(lines[0].text)}",
        symptom.evidence(lines[0]),
        field=code(f"msg.{path}"),
    )


@explanation(NotLogged)
def other_values(symptom: NotLogged) -> Finding | None:
    """The lines show other values: another field, exchanged names, an older message."""
    line, newest, decimals = _likely_answer(symptom), symptom.wanted[-1], symptom.decimals
    if line is None:
        return None
    texts = [candidate.text for candidate in symptom.candidates]
    in_log = {path for text in texts for path in shown(numbers(text), newest, decimals)}
    missing = [path for path in newest.values if path not in in_log] or list(newest.values)
    values = [f"{code(path)} = {_rounded(newest.values[path], decimals)}" for path in missing]
    observed = (
        f"log lines follow messages on {code(symptom.topic)}, but none shows {listing(values)}: "
        f"{quote(line.text)}"
    )
    swapped = exchanged("\n".join(map(logged_text, texts)), newest.values, decimals)
    if swapped:
        observed += f", where {listing(map(code, swapped))} are swapped"
    names = dict.fromkeys(name for path in missing for name in Expression.of(path).fields)
    fields, given = listing(code(f"msg.{name}") for name in names), symptom.given
    evidence = symptom.evidence(line)
    return mistaken("other_values_logged", observed, evidence, given=given, fields=fields)


@explanation(ReceivedNotLogged, general=True)
def nothing_logged(symptom: ReceivedNotLogged) -> Finding:
    """Nothing is logged when a message comes."""
    observed = (
        f"nothing is logged when messages come on {code(symptom.topic)}: the subscription is "
        "there, its type and its QoS match"
    )
    return mistaken("nothing_logged", *_with_output(symptom, observed))


@explanation(PublishedNotLogged, general=True)
def own_not_logged(symptom: PublishedNotLogged) -> Finding:
    """Nothing is logged when a message is published."""
    return mistaken("own_not_logged", *_with_output(symptom, symptom.seen))


def _with_output(symptom: NotLogged, observed: str) -> tuple[str, Evidence]:
    """What was observed, with what the process wrote instead, and the evidence for it."""
    recording, lines = symptom.recording, output_lines(symptom.recording)
    if lines:
        observed += f"; the process wrote {quote(lines[0].text)}"
    return observed, Evidence(
        moments=first_seen(recording, recording.carried(symptom.topic)),
        places=symptom.callbacks,
        log=tuple(line.text for line in lines[:_LOG_LINES]),
    )


def _lines_by_mistaken_factor(symptom: NotLogged) -> Mapping[tuple[str, str], list[LogLine]]:
    """Lines that show a field of their message multiplied, by the field and by what is wrong.

    The field `x` and the words `is 100 times too large` have those that show 137 for x = 1.37.
    """
    lines_by_mistake: defaultdict[tuple[str, str], list[LogLine]] = defaultdict(list)
    candidates = symptom.candidates
    for item in symptom.wanted:
        begin_ns, end_ns = item.message.stamp_ns, item.due_ns + symptom.within_ns
        answers = [line for line in candidates if begin_ns <= line.time_ns <= end_ns]
        for line in answers[:_LOG_LINES]:
            for path, value in item.values.items():
                for number in numbers(line.text):
                    words = factor_words(number, value)
                    if words:
                        lines_by_mistake[path, words].append(line)
    return lines_by_mistake


def _likely_answer(symptom: NotLogged) -> LogLine | None:
    """The candidate that is most likely meant to show a message; None without any."""
    candidates = symptom.candidates
    # What a process writes at Ctrl+C is no answer to a message.
    running = [line for line in candidates if line.time_ns <= symptom.recording.stop_ns]
    candidates = running or candidates
    with_numbers = [line for line in candidates if numbers(line.text)]
    likely = with_numbers or candidates
    return likely[-1] if likely else None


def _rounded(value: float, decimals: int) -> str:
    return f"{value:.0f}" if value.is_integer() else f"{value:.{max(decimals, 1)}f}"
