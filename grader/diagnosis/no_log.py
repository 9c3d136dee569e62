"""Why the log does not show what the node was sent: one cause, the deepest that can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grader.checks.field import number_at
from grader.checks.finding import Evidence, Moment, Table
from grader.checks.first_seen import first_seen
from grader.checks.log.echo import Echo, Wanted, echoes, output_lines, shown
from grader.checks.log.printed import exchanged, logged_text, numbers, quote, unfilled
from grader.checks.wording import code, codes, counted, listing, value_text
from grader.diagnosis.cause import Cause
from grader.diagnosis.delivery import why_no_history, why_not_delivered
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.misread_log import explain
from grader.diagnosis.process.blocked_executor import why_blocked, why_never_spun, why_slow
from grader.diagnosis.process.process_exit import why_ended
from grader.recording.model import NS, Kind, LogLine, Recording
from grader.spec.unit import format_duration

_LOG_LINES = 5
# Who may log less often than a message comes needs lines for no more than this share of them.
_SOME = 0.5
# Share of the time that the host may take before silence says nothing any more.
_STARVED = 0.5


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
    """Why fewer messages than needed were followed by log lines with their values.

    Args:
        decimals: How many decimals must be right.
        within_ns: How soon after its message a line must have come.
    """
    cause = why_not_delivered(recording, topic) or why_ended(recording, _seen(topic, found))
    if cause is not None:
        return cause
    if wanted and wanted[-1].message.stamp_ns < recording.launched_ns:
        cause = why_no_history(recording, topic, _seen(topic, found))
        if cause is not None:
            return cause
    if len(wanted) < needed:
        sent = f"only {counted(len(wanted), 'message was', 'messages were')} sent on {code(topic)}"
        return why_unsubscribed(recording, topic, sent) or Cause.to_repeat(sent)
    nodes = {item.node for item in recording.student_endpoints(Kind.SUBSCRIPTION, topic)}
    begin_ns = recording.carried(topic)[0].stamp_ns
    blocked = why_blocked(recording, _seen(topic, found), nodes, begin_ns)
    cause = (
        _disturbed(recording, topic, wanted, needed, decimals, within_ns, blocked)
        or why_unsubscribed(recording, topic, _seen(topic, found))
        or why_never_spun(
            recording,
            f"the callback is never called: the subscription to {code(topic)} is there and its "
            "QoS matches",
            nodes,
        )
        or blocked
        or _dropped(recording, topic)
    )
    if cause is not None:
        return cause
    if found:
        return _few(recording, topic, wanted, found, needed, nodes)
    near = _near(recording, wanted, within_ns)
    return (
        _behind(recording, topic, wanted, near, decimals, within_ns)
        # What a late line shows may look like something else of the message that came before it.
        or why_slow(recording, _late(topic, within_ns), nodes)
        or _elsewhere(recording, topic, wanted, near, decimals)
        or _other_values(recording, topic, wanted, near, decimals)
        or _silent(recording, topic)
    )


def _seen(topic: str, found: Sequence[Echo]) -> str:
    if found:
        return f"log lines follow {counted(len(found), 'message')} on {code(topic)}"
    return f"no log line shows a message on {code(topic)}"


def _late(topic: str, within_ns: int) -> str:
    limit = format_duration(within_ns / NS)
    return f"no log line shows a message on {code(topic)} within {limit} of it"


def _disturbed(
    recording: Recording,
    topic: str,
    wanted: Sequence[Wanted],
    needed: int,
    decimals: int,
    within_ns: int,
    blocked: Cause | None,
) -> Cause | None:
    begin_ns, end_ns = wanted[0].message.stamp_ns, wanted[-1].due_ns + within_ns
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    if len(echoes(recording, wanted, decimals, within_ns, forgive=True)) < needed:
        if stolen_s < _STARVED * (end_ns - begin_ns) / NS:
            return None
        if blocked is not None:
            return replace(blocked, disturbed=True)
    return Cause.to_repeat(
        f"log lines for {code(topic)} are late or missing, but the machine took "
        f"{format_duration(stolen_s)} from the process meanwhile"
    )


def _dropped(recording: Recording, topic: str) -> Cause | None:
    """Output that was not kept may have held what is missing."""
    dropped = sum(process.dropped_bytes for process in recording.processes)
    if not dropped:
        return None
    return Cause(
        f"nothing about {code(topic)} is in the output that was kept, but the process wrote "
        f"{dropped} bytes more",
        "Write less: a line for each message is enough.",
        ours=True,
    )


def _few(
    recording: Recording,
    topic: str,
    wanted: Sequence[Wanted],
    found: Sequence[Echo],
    needed: int,
    nodes: set[str],
) -> Cause:
    times_s = [recording.since_launch_s(echo.lines[-1].time_ns) for echo in found]
    written = listing(f"{time_s:.2f} s" for time_s in times_s)
    seen = (
        f"log lines follow only {len(found)} of {counted(len(wanted), 'message')} on "
        f"{code(topic)}, written {written} after launch"
    )
    slow = why_slow(recording, seen, nodes)
    if slow is not None:
        return slow
    seldom_is_right = needed <= _SOME * len(wanted)
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


def _near(recording: Recording, wanted: Sequence[Wanted], within_ns: int) -> list[LogLine]:
    """Lines that could have been an answer to a message."""
    begin_ns, end_ns = wanted[0].message.stamp_ns, wanted[-1].due_ns + within_ns
    return [line for line in output_lines(recording) if begin_ns <= line.time_ns <= end_ns]


def _behind(
    recording: Recording,
    topic: str,
    wanted: Sequence[Wanted],
    near: Sequence[LogLine],
    decimals: int,
    within_ns: int,
) -> Cause | None:
    """The lines show messages that had come long before: the callback takes too long for them."""
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
            and shown(printed, item, decimals) == set(item.values)
        ]
        if not old:
            continue
        late_ns = line.time_ns - old[-1].due_ns
        if late_ns <= within_ns:
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


def _elsewhere(
    recording: Recording,
    topic: str,
    wanted: Sequence[Wanted],
    near: Sequence[LogLine],
    decimals: int,
) -> Cause | None:
    """The values are logged, but not when the messages come."""
    last = wanted[-1]
    for line in output_lines(recording):
        if line in near or shown(numbers(line.text), last, decimals) != set(last.values):
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


def _other_values(
    recording: Recording,
    topic: str,
    wanted: Sequence[Wanted],
    near: Sequence[LogLine],
    decimals: int,
) -> Cause | None:
    """Lines come, but they show something else."""
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


def _fields(paths: Sequence[str]) -> str:
    return listing(code(f"msg.{path}") for path in paths)


def _rounded(value: float, decimals: int) -> str:
    return f"{value:.0f}" if value.is_integer() else f"{value:.{max(decimals, 1)}f}"


def _silent(recording: Recording, topic: str) -> Cause:
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
