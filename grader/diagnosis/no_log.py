"""Why the log does not show what the node was sent: one cause, the deepest that can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from grader.checks.field import number_at
from grader.checks.finding import Evidence, Moment, Table
from grader.checks.first_seen import first_seen
from grader.checks.wording import code, codes, counted, listing, value_text
from grader.diagnosis.cause import Cause
from grader.diagnosis.delivery import why_no_history, why_not_delivered
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.misread_log import explain
from grader.diagnosis.process.blocked_executor import why_blocked, why_never_spun, why_slow
from grader.diagnosis.process.process_exit import why_ended
from grader.measure.echo import Echo, Wanted, echoes, output_lines, shown
from grader.measure.printed import exchanged, logged_text, numbers, quote, unfilled
from grader.recording.model import NS, Kind, LogLine, Recording
from grader.spec.unit import format_duration

_LOG_LINES = 5
# Who may log less often than a message comes needs lines for no more than this share of them.
_SOME = 0.5
# Share of the time that the host may take before silence says nothing any more.
_STARVED = 0.5


@dataclass(frozen=True)
class NotLogged(Symptom[Cause]):
    """The log does not show what the node received.

    Attributes:
        found: Messages that log lines follow.
        needed: How many there must be.
        decimals: How many decimals must be right.
        within_ns: How soon after its message a line must have come.
    """

    recording: Recording
    topic: str
    wanted: Sequence[Wanted]
    found: Sequence[Echo]
    needed: int
    decimals: int
    within_ns: int

    @property
    def seen(self) -> str:
        """The symptom in words."""
        if self.found:
            return f"log lines follow {counted(len(self.found), 'message')} on {code(self.topic)}"
        return f"no log line shows a message on {code(self.topic)}"

    @property
    def nodes(self) -> set[str]:
        """The nodes that subscribe to the topic."""
        subscriptions = self.recording.student_endpoints(Kind.SUBSCRIPTION, self.topic)
        return {item.node for item in subscriptions}

    @property
    def begin_ns(self) -> int:
        """When the first message was sent."""
        return self.recording.carried(self.topic)[0].stamp_ns

    @property
    def near(self) -> list[LogLine]:
        """Lines that could have been an answer to a message."""
        begin_ns = self.wanted[0].message.stamp_ns
        end_ns = self.wanted[-1].due_ns + self.within_ns
        lines = output_lines(self.recording)
        return [line for line in lines if begin_ns <= line.time_ns <= end_ns]


def why_not_logged(
    recording: Recording,
    topic: str,
    wanted: Sequence[Wanted],
    found: Sequence[Echo],
    *,
    needed: int,
    decimals: int,
    within_ns: int,
) -> Cause:
    """Why fewer messages than needed were followed by log lines with their values."""
    return cause_of(NotLogged(recording, topic, wanted, found, needed, decimals, within_ns))


@explanation(NotLogged)
def not_delivered(symptom: NotLogged) -> Cause | None:
    """The messages do not reach the node."""
    return why_not_delivered(symptom.recording, symptom.topic)


@explanation(NotLogged)
def process_ended(symptom: NotLogged) -> Cause | None:
    """The process ended."""
    return why_ended(symptom.recording, symptom.seen)


@explanation(NotLogged)
def no_history(symptom: NotLogged) -> Cause | None:
    """A late joiner does not ask for the messages from before it was there (transient_local)."""
    wanted, recording = symptom.wanted, symptom.recording
    if not wanted or wanted[-1].message.stamp_ns >= recording.launched_ns:
        return None
    return why_no_history(recording, symptom.topic, symptom.seen)


@explanation(NotLogged)
def too_few_sent(symptom: NotLogged) -> Cause | None:
    """Too few messages were sent, because the program destroyed its subscription, or by a fault."""
    number = len(symptom.wanted)
    if number >= symptom.needed:
        return None
    sent = f"only {counted(number, 'message was', 'messages were')} sent on {code(symptom.topic)}"
    return why_unsubscribed(symptom.recording, symptom.topic, sent) or Cause.to_repeat(sent)


@explanation(NotLogged)
def no_cpu_time(symptom: NotLogged) -> Cause | None:
    """The machine gave the process too little CPU time; an error, and never a lost point."""
    recording, wanted = symptom.recording, symptom.wanted
    begin_ns, end_ns = wanted[0].message.stamp_ns, wanted[-1].due_ns + symptom.within_ns
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    forgiven = echoes(recording, wanted, symptom.decimals, symptom.within_ns, forgive=True)
    if len(forgiven) < symptom.needed:
        if stolen_s < _STARVED * (end_ns - begin_ns) / NS:
            return None
        blocked = blocked_executor(symptom)
        if blocked is not None:
            return replace(blocked, disturbed=True)
    return Cause.to_repeat(
        f"log lines for {code(symptom.topic)} are late or missing, but the machine took "
        f"{format_duration(stolen_s)} from the process meanwhile"
    )


@explanation(NotLogged)
def subscription_destroyed(symptom: NotLogged) -> Cause | None:
    """The program destroyed its subscription."""
    return why_unsubscribed(symptom.recording, symptom.topic, symptom.seen)


@explanation(NotLogged)
def never_spun(symptom: NotLogged) -> Cause | None:
    """rclpy.spin() is never called, so the callback is never called."""
    return why_never_spun(
        symptom.recording,
        f"the callback is never called: the subscription to {code(symptom.topic)} is there and "
        "its QoS matches",
        symptom.nodes,
    )


@explanation(NotLogged)
def blocked_executor(symptom: NotLogged) -> Cause | None:
    """A callback does not return, and blocks the executor."""
    return why_blocked(symptom.recording, symptom.seen, symptom.nodes, symptom.begin_ns)


@explanation(NotLogged)
def output_dropped(symptom: NotLogged) -> Cause | None:
    """The program wrote more than is kept; an error, and never a lost point."""
    recording, topic = symptom.recording, symptom.topic
    dropped = sum(process.dropped_bytes for process in recording.processes)
    if not dropped:
        return None
    return Cause(
        f"nothing about {code(topic)} is in the output that was kept, but the process wrote "
        f"{dropped} bytes more",
        "Write less: a line for each message is enough.",
        ours=True,
    )


@explanation(NotLogged)
def only_some_logged(symptom: NotLogged) -> Cause | None:
    """Only some messages are logged: an if, once=True or throttle_duration_sec leave others out."""
    recording, topic = symptom.recording, symptom.topic
    wanted, found = symptom.wanted, symptom.found
    if not found:
        return None
    times_s = [recording.since_launch_s(echo.lines[-1].time_ns) for echo in found]
    written = listing(f"{time_s:.2f} s" for time_s in times_s)
    seen = (
        f"log lines follow only {len(found)} of {counted(len(wanted), 'message')} on "
        f"{code(topic)}, written {written} after launch"
    )
    slow = why_slow(recording, seen, symptom.nodes)
    if slow is not None:
        return slow
    seldom_is_right = symptom.needed <= _SOME * len(wanted)
    return Cause(
        seen,
        "Log in every call of the callback"
        + (
            ", or at least once in a second."
            if seldom_is_right
            else ": an `if`, once=True, skip_first=True and throttle_duration_sec=... leave some "
            "out."
        ),
        Evidence(
            moments=tuple(Moment(f"logged a message on {topic}", time_s) for time_s in times_s),
            log=tuple(line.text for echo in found for line in echo.lines)[:_LOG_LINES],
        ),
    )


@explanation(NotLogged)
def log_lags_behind(symptom: NotLogged) -> Cause | None:
    """The log lags behind: a callback takes too long, and newer messages wait."""
    recording, topic = symptom.recording, symptom.topic
    wanted, near = symptom.wanted, symptom.near
    paths = list(wanted[-1].values)
    carried = [
        Wanted(
            message,
            {path: number_at(message.value, path) for path in paths},
            wanted[-1].ready_ns,
        )
        for message in recording.carried(topic)
    ]
    for line in reversed(near):
        printed = numbers(line.text)
        old = [
            item
            for item in carried
            if item.message.stamp_ns <= line.time_ns
            and shown(printed, item, symptom.decimals) == set(item.values)
        ]
        if not old:
            continue
        late_ns = line.time_ns - old[-1].due_ns
        if late_ns <= symptom.within_ns:
            return None
        late = format_duration(late_ns / NS)
        return Cause(
            f"the log lags behind the messages on {code(topic)}: {quote(line.text)} was written "
            f"{late} after that message had come, and newer ones wait",
            "A callback must return at once: look for time.sleep(), input() or a loop in one of "
            "the callbacks. What comes meanwhile waits for its end.",
            Evidence(
                moments=(Moment("logged too late", recording.since_launch_s(line.time_ns)),),
                log=tuple(line.text for line in near[:_LOG_LINES]),
            ),
        )
    return None


@explanation(NotLogged)
def callbacks_wait(symptom: NotLogged) -> Cause | None:
    """The callbacks keep each other waiting, so the lines come too late."""
    # What a late line shows may look like something else of the message that came before it.
    limit = format_duration(symptom.within_ns / NS)
    late = f"no log line shows a message on {code(symptom.topic)} within {limit} of it"
    return why_slow(symptom.recording, late, symptom.nodes)


@explanation(NotLogged)
def logged_elsewhere(symptom: NotLogged) -> Cause | None:
    """The values are logged in another callback, and not when the messages come."""
    recording, topic = symptom.recording, symptom.topic
    near = symptom.near
    last = symptom.wanted[-1]
    for line in output_lines(recording):
        if line in near or shown(numbers(line.text), last, symptom.decimals) != set(last.values):
            continue
        late_s = (line.time_ns - last.message.stamp_ns) / NS
        others = [name for name in recording.messages if name != topic and recording.on(name)]
        came = f" in which messages came on {codes(others)}" if others else ""
        return Cause(
            f"the values of {code(topic)} are logged, but not when its messages come: "
            f"{quote(line.text)} was written {format_duration(late_s)} after the last of them, "
            f"at a time{came}",
            f"Log in the callback of {code(topic)} itself, from the message that it is given.",
            Evidence(
                moments=(Moment("logged too late", recording.since_launch_s(line.time_ns)),),
                log=(line.text,),
            ),
        )
    return None


@explanation(NotLogged)
def other_values(symptom: NotLogged) -> Cause | None:
    """Lines come, but they show other values."""
    recording, topic = symptom.recording, symptom.topic
    wanted, near, decimals = symptom.wanted, symptom.near, symptom.decimals
    if not near:
        return None
    # What a process writes at Ctrl+C is no answer to a message.
    near = [line for line in near if line.time_ns <= recording.stop_ns] or near
    item = wanted[-1]
    printed = [numbers(line.text) for line in near]
    carried = {path for line in printed for path in shown(line, item, decimals)}
    missing = [path for path in item.values if path not in carried] or list(item.values)
    values = listing(f"{code(path)} = {_rounded(item.values[path], decimals)}" for path in missing)
    # A line with numbers is more likely to be meant than one without.
    told = next((line for line in reversed(near) if numbers(line.text)), near[-1])
    braces = unfilled(told.text)
    if braces is not None:
        return Cause(
            f"log lines follow messages on {code(topic)}, but they show {code(braces)} instead of "
            f"a value: {quote(told.text)}",
            "Python fills in braces only where an f stands before the quotes: "
            "f'... {value}' instead of '... {value}'.",
            Evidence(
                moments=(Moment("other values logged", recording.since_launch_s(told.time_ns)),),
                log=tuple(line.text for line in near[:_LOG_LINES]),
            ),
        )
    pair = exchanged("\n".join(logged_text(line.text) for line in near), item.values, decimals)
    reason = (
        f"names the one where it shows the other: {listing(map(code, pair))} are exchanged"
        if pair
        else explain(numbers(told.text), item, missing, decimals)
    )
    rows = tuple((path, value_text(value)) for path, value in item.values.items())
    return Cause(
        f"log lines follow messages on {code(topic)}, but none shows {values}: "
        f"{quote(told.text)}" + (f", which {reason}" if reason else ""),
        f"Log the fields of the message that the callback is given: {_fields(missing)}.",
        Evidence(
            moments=(Moment("other values logged", recording.since_launch_s(told.time_ns)),),
            log=tuple(line.text for line in near[:_LOG_LINES]),
            tables=(Table(f"A message on {topic}", ("field", "value"), rows),),
        ),
    )


@explanation(NotLogged, general=True)
def nothing_logged(symptom: NotLogged) -> Cause:
    """Nothing is logged when a message comes."""
    recording, topic = symptom.recording, symptom.topic
    answers = [call for call in recording.calls if call.answered_ns is not None]
    spins = ", and its executor spins" if answers else ""
    wrote = next(iter(output_lines(recording)), None)
    other = f"; the process wrote {quote(wrote.text)}" if wrote else ""
    return Cause(
        f"nothing is logged when messages come on {code(topic)}: the subscription is there, its "
        f"type and its QoS match{spins}{other}",
        "Is the line reached that logs what the message says? What debug() logs is not shown by "
        "default, an `except: pass` hides an error, and an `if` may leave messages out.",
        Evidence(
            moments=first_seen(recording, recording.carried(topic)),
            log=tuple(line.text for line in output_lines(recording)[:_LOG_LINES]),
        ),
    )


def _fields(paths: Sequence[str]) -> str:
    return listing(code(f"msg.{path}") for path in paths)


def _rounded(value: float, decimals: int) -> str:
    return f"{value:.0f}" if value.is_integer() else f"{value:.{max(decimals, 1)}f}"
