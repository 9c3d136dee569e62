"""Why the log does not show what the node was sent: one cause, the deepest that can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

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
from grader.recording.model import NS, Endpoint, Kind, LogLine
from grader.recording.submission import SourceError
from grader.spec.expression import Expression
from grader.spec.unit import format_duration

_LOG_LINES = 5
# Messages that show the same: a single number may be like another by chance.
_ALIKE = 2
# What a subscription must request for the messages from before it was there.
_KEEPS = ("transient_local", "unknown")
_RESENDS = ("reliable", "unknown")


@dataclass(frozen=True)
class NotLogged(CalledLate):
    """The log does not show what the node received.

    Attributes:
        found: Messages that log lines follow.
        needed: How many there must be.
        decimals: How many decimals must be right.
        within_ns: How soon after its message a line must have come.
        own: The student publishes the messages.
    """

    topic: str
    wanted: Sequence[Wanted]
    found: Sequence[Echo]
    needed: int
    decimals: int
    within_ns: int
    own: bool = False

    @property
    def seen(self) -> str:
        """The symptom in words."""
        if self.found:
            messages = counted(len(self.wanted), "message")
            return f"log lines follow only {len(self.found)} of {messages} on {code(self.topic)}"
        return f"no log line shows a message on {code(self.topic)}"

    @property
    def ends(self) -> tuple[Endpoint, ...]:
        """The student's subscriptions to the topic, or publishers."""
        kind = Kind.PUBLISHER if self.own else Kind.SUBSCRIPTION
        return self.recording.student_endpoints(kind, self.topic)

    @property
    def nodes(self) -> set[str]:
        """The nodes that have them."""
        return {item.node for item in self.ends}

    @property
    def needs_spin(self) -> bool:
        """Whether a callback must be called; what a node publishes it may log anywhere."""
        return not self.own

    @property
    def since_ns(self) -> int:
        """When the first message came."""
        return self.recording.carried(self.topic)[0].stamp_ns

    @property
    def late(self) -> str:
        """The symptom in words, where lines may be late."""
        # What a late line shows may look like something else of the message that came before it.
        limit = format_duration(self.within_ns / NS)
        return self.seen if self.found else f"{self.seen} within {limit} of it"

    @property
    def excuse(self) -> Finding | None:
        """The machine's doing, if enough lines came but for that, or nothing is proven."""
        begin_ns, end_ns = self.wanted[0].message.stamp_ns, self.wanted[-1].due_ns + self.within_ns
        recording = self.recording
        found = echoes(recording, self.wanted, self.decimals, self.within_ns, forgive=True)
        if len(found) < self.needed:
            return self.starved(begin_ns, end_ns)
        return Finding.held_up(self.late, recording.stolen_s(begin_ns, end_ns))

    @property
    def near(self) -> list[LogLine]:
        """Lines that could have been an answer to a message."""
        begin_ns, end_ns = self.wanted[0].begin_ns, self.wanted[-1].due_ns + self.within_ns
        lines = output_lines(self.recording)
        return [line for line in lines if begin_ns <= line.time_ns <= end_ns]

    @property
    def places(self) -> tuple[SourceError, ...]:
        """The callbacks that get the messages."""
        declared = [one.data for one in self.recording.declared("subscription")]
        names = {str(data.get("callback")) for data in declared if data.get("topic") == self.topic}
        message = f"messages on {code(self.topic)} come here"
        places = (defined_at(name, message, self.recording.submission) for name in sorted(names))
        return tuple(filter(None, places))

    def evidence(self, line: LogLine) -> Evidence:
        """A line with other values, and others near the messages."""
        log = [one.text for one in self.near if one != line][: _LOG_LINES - 1]
        moments = (moment(self.recording, "other values logged", line.time_ns),)
        return Evidence(moments, self.places, (*log, line.text))


@explanation(NotLogged, before=(process_ended,))
def not_delivered(symptom: NotLogged) -> Finding | None:
    """The messages do not reach the node."""
    return None if symptom.own else why_not_delivered(symptom.recording, symptom.topic)


@explanation(NotLogged, after=(process_ended,), before=(no_cpu_time,), concept="qos")
def no_history(symptom: NotLogged) -> Finding | None:
    """A late joiner does not request earlier messages (transient_local)."""
    wanted, recording = symptom.wanted, symptom.recording
    if symptom.own or not wanted or wanted[-1].message.stamp_ns >= recording.launched_ns:
        return None
    for item in symptom.ends:
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


@explanation(NotLogged, before=(no_cpu_time,))
def too_few_sent(symptom: NotLogged) -> Finding | None:
    """Too few messages were sent: the program destroyed its subscription, or a fault occurred."""
    number = len(symptom.wanted)
    if number >= symptom.needed:
        return None
    if symptom.own:
        return why_few(symptom.recording, symptom.topic, symptom.needed)
    sent = f"only {counted(number, 'message was', 'messages were')} sent on {code(symptom.topic)}"
    return why_unsubscribed(symptom.recording, symptom.topic, sent) or Finding.undecided(sent)


@explanation(NotLogged, after=(no_cpu_time,), before=(callback_raised,))
def subscription_destroyed(symptom: NotLogged) -> Finding | None:
    """The program destroyed its subscription."""
    if symptom.own:
        return None
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
    recording, topic, found = symptom.recording, symptom.topic, symptom.found
    if not found:
        return None
    times_s = [recording.since_launch_s(echo.lines[-1].time_ns) for echo in found]
    written = listing(f"{time_s:.2f} s" for time_s in times_s)
    return mistaken(
        "only_some_logged",
        f"{symptom.seen}, written {written} after launch",
        Evidence(
            moments=tuple(Moment(f"logged a message on {topic}", time_s) for time_s in times_s),
            log=tuple(line.text for echo in found for line in echo.lines)[:_LOG_LINES],
        ),
    )


@explanation(NotLogged)
def no_f_string(symptom: NotLogged) -> Finding | None:
    """The lines show `{x}` or `%f` instead of values: no f before the quotes."""
    line = _meant(symptom)
    unfilled = UNFILLED.search(logged_text(line.text)) if line else None
    if line is None or unfilled is None:
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
    lines_by_mistake: dict[tuple[str, str], list[LogLine]] = {}
    for item in symptom.wanted:
        end_ns = item.due_ns + symptom.within_ns
        lines = [one for one in symptom.near if item.message.stamp_ns <= one.time_ns <= end_ns]
        for line, path in product(lines[:_LOG_LINES], item.values):
            for number in numbers(line.text):
                words = factor_words(number, item.values[path])
                if words:
                    lines_by_mistake.setdefault((path, words), []).append(line)
    if not lines_by_mistake:
        return None
    (path, words), lines = max(lines_by_mistake.items(), key=lambda entry: len(entry[1]))
    if len(lines) < max(_ALIKE, symptom.needed):
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
    line, item, decimals = _meant(symptom), symptom.wanted[-1], symptom.decimals
    if line is None:
        return None
    in_log = {path for one in symptom.near for path in shown(numbers(one.text), item, decimals)}
    missing = [path for path in item.values if path not in in_log] or list(item.values)
    values = listing(f"{code(path)} = {_rounded(item.values[path], decimals)}" for path in missing)
    lines = "\n".join(logged_text(one.text) for one in symptom.near)
    pair = exchanged(lines, item.values, decimals)
    how = f", where {listing(map(code, pair))} are swapped" if pair else ""
    names = dict.fromkeys(name for path in missing for name in Expression.of(path).fields)
    fields = listing(code(f"msg.{name}") for name in names)
    given = "is published" if symptom.own else "the callback is given"
    return mistaken(
        "other_values_logged",
        f"log lines follow messages on {code(symptom.topic)}, but none shows {values}: "
        f"{quote(line.text)}{how}",
        symptom.evidence(line),
        given=given,
        fields=fields,
    )


@explanation(NotLogged, general=True)
def nothing_logged(symptom: NotLogged) -> Finding:
    """Nothing is logged when a message comes."""
    recording, topic = symptom.recording, symptom.topic
    lines = output_lines(recording)
    if symptom.own:
        mistake, seen = "own_not_logged", symptom.seen
    else:
        mistake = "nothing_logged"
        seen = (
            f"nothing is logged when messages come on {code(topic)}: the subscription is there, "
            "its type and its QoS match"
        )
    if lines:
        seen += f"; the process wrote {quote(lines[0].text)}"
    return mistaken(
        mistake,
        seen,
        Evidence(
            moments=first_seen(recording, recording.carried(topic)),
            places=symptom.places,
            log=tuple(line.text for line in lines[:_LOG_LINES]),
        ),
    )


def _meant(symptom: NotLogged) -> LogLine | None:
    """The line near the messages that is most likely meant to show them; None without any."""
    # What a process writes at Ctrl+C is no answer to a message.
    running = [line for line in symptom.near if line.time_ns <= symptom.recording.stop_ns]
    near = running or symptom.near
    with_numbers = [line for line in near if numbers(line.text)]
    likely = with_numbers or near
    return likely[-1] if likely else None


def _rounded(value: float, decimals: int) -> str:
    return f"{value:.0f}" if value.is_integer() else f"{value:.{max(decimals, 1)}f}"
