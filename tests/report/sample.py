"""Grades made by hand for the reports to show."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rich.console import Console

from grader.checks.check import Subject
from grader.findings.finding import Evidence, Finding, Moment, Plot, Table
from grader.grade import Grade, judge_all
from grader.recording.event import Breach, Disturbance
from grader.recording.model import NS, Call, LogLine, Message, Node, Owner, Process, Recording
from grader.recording.submission import BuildRecord, SourceError, SubmissionRecord
from grader.report.html.replay import Replay
from grader.report.html.report import render_report
from grader.report.html.source_code import ShownSource
from grader.report.model.facts import RunFacts
from grader.report.model.result import make_result
from grader.report.model.result_model import AdjustmentPart, AttemptPart, CommentPart, Result
from grader.report.text.terminal import print_grade
from tests.grade.sample import (
    LAUNCHED_NS,
    Told,
    make_loaded,
    make_recording,
    make_submission,
)

PLACE = SourceError("src/bot_publisher/bot_publisher/node.py", 18, "time.sleep(0.3)")
PERIOD = Finding.failed(
    "a period of 300 ms within 5 % (285 to 315 ms)",
    "a median of 322.4 ms; 2 of 3 periods are longer than 315 ms, the longest is 612 ms",
    "The period grows with the work in the callback. A timer keeps the period.",
    Evidence(
        moments=(Moment("a gap of 612 ms begins", 0.75),),
        places=(PLACE,),
        log=("loop took 0.31 s",),
        plots=(
            Plot(
                "Period of /cmd_vel",
                "time since launch (s)",
                "period (ms)",
                (0.75, 1.36, 1.69),
                (300.0, 612.0, 331.0),
                (285.0, 315.0),
            ),
        ),
        tables=(Table("The longest periods", ("after message", "period"), (("2", "612 ms"),)),),
    ),
    credit=0.34,
)
PROCESS = "bot_publisher/bot_pub"


@dataclass(frozen=True)
class Sample:
    """What a report is made from, and what is made from it."""

    grade: Grade
    recordings: dict[str, Recording]
    facts: RunFacts
    added: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the result that are not in the grade."""

    @property
    def result(self) -> Result:
        made = make_result(self.grade, self.recordings, self.facts)
        return made.model_copy(update=dict(self.added))

    def html(
        self,
        references: Mapping[str, Replay] = {},
        before: Mapping[str, Replay] = {},
        source: Mapping[str, str] = {},
        root: Path | None = None,
    ) -> str:
        shown = ShownSource(source, root)
        return render_report(self.grade, self.result, self.recordings, references, before, shown)

    def printed(
        self,
        width: int = 80,
        source: Mapping[str, str] = MappingProxyType({}),
        **options: Any,
    ) -> str:
        """What a terminal of that width shows, without the spaces at the ends of lines."""
        stream = io.StringIO()
        console = Console(file=stream, width=width, highlight=False, emoji=False, **options)
        print_grade(console, self.grade.assignment.title, self.result, source)
        return "\n".join(line.rstrip() for line in stream.getvalue().split("\n"))


def judged(checks: Sequence[Told], scenarios: Sequence[str] = ("listen",), **loaded: Any) -> Sample:
    """A grade by checks of one ordinary run of each scenario."""
    return judged_runs(checks, {name: make_run(scenario=name) for name in scenarios}, **loaded)


def judged_runs(
    checks: Sequence[Told],
    recordings: dict[str, Recording],
    submission: SubmissionRecord | None = None,
    **loaded: Any,
) -> Sample:
    """A grade by checks of these runs, by scenario."""
    made = make_loaded(checks, tuple(recordings) or ("listen",), **loaded)
    return Sample(
        judge_all(made, submission or make_submission(), recordings), recordings, make_facts()
    )


def make_facts(**changes: object) -> RunFacts:
    facts = RunFacts(
        started="2026-03-04T09:12:33+01:00",
        duration_s=5.84,
        environment={"ros_distro": "jazzy", "rmw": "rmw_fastrtps_cpp"},
        rosgrade_version="0.1.0",
        recordings={"listen": "recordings/listen.mcap"},
    )
    return replace(facts, **changes)  # type: ignore[arg-type]


def at(seconds: float) -> int:
    """Nanoseconds of a time since launch."""
    return LAUNCHED_NS + round(seconds * NS)


def make_run(**changes: object) -> Recording:
    stamps = [at(0.45), at(0.75), at(1.36), at(1.69)]
    return make_recording(
        stop_ns=at(1.8),
        end_ns=at(2.0),
        **{
            "matched_ns": at(0.44),
            "nodes": (Node("/bot_publisher", Owner.STUDENT, at(0.39)),),
            "messages": {
                "/cmd_vel": tuple(
                    Message("/cmd_vel", "geometry_msgs/msg/Twist", {}, stamp, stamp, number)
                    for number, stamp in enumerate(stamps, 1)
                )
            },
            "processes": (Process(PROCESS, 4711, at(0.0), at(1.9), 0, "SIGINT", 0.1),),
            "log": (
                LogLine(at(0.40), PROCESS, "stderr", "[INFO] [bot_publisher]: up"),
                LogLine(at(0.40), "bot_publisher", "rosout", "up", "INFO"),
            ),
            "calls": (
                Call("/bot_publisher/list_parameters", "", at(0.5), at(0.51)),
                Call("/bot_publisher/list_parameters", "", at(1.0)),
            ),
            "disturbance": (Disturbance(at(1.0), 400_000, 1_700_000),),
        }
        | changes,
    )


def attempts(*scores: float | None, **changes: Any) -> tuple[AttemptPart, ...]:
    """Attempts with these scores, of which the last counts."""
    change = "Rate of `/chatter`: failed → passed, +3"
    return tuple(
        AttemptPart(
            score=score,
            max_score=10.0,
            counts=index == len(scores) - 1,
            **{
                "sha256": f"{index}" * 64,
                "handed_in": f"2026-03-{index + 1:02}T09:12:33+01:00",
                "changes": (change,) * index,
            }
            | changes,
        )
        for index, score in enumerate(scores)
    )


def reviewed(text: str, *, waits: bool = False) -> dict[str, Any]:
    """What persons and a rule add to a result, each with this text."""
    part, by = AdjustmentPart, {"by": text, "reason": text}
    adjustments = (
        part(kind="manual", title="README", points=1.5, max_points=2.0, item="readme", **by),
        part(kind="forgiven", title=text, points=0.5, check="a", **by),
        part(kind="late", title=text, points=-1.0, reason=text),
    )
    oral = part(kind="manual", title="Oral exam", points=None, max_points=3.0, item="oral")
    comments = (CommentPart(text=text, by=text, file=text, line=3), CommentPart(text=text, by="AB"))
    return {"adjustments": (*adjustments, *(oral,) * waits), "comments": comments}


def lost_points() -> Sample:
    """A period that is too long; one check waits for it, one is not yet for students."""
    checks = [
        Told(
            "builds",
            Finding.passed("`colcon build` to succeed", "built in 1.3 s"),
            subject=Subject.SUBMISSION,
            title="The package builds",
        ),
        Told(
            "period",
            PERIOD,
            points=3,
            title="It publishes every 300 ms",
            hint="Let a timer do the waiting: `create_timer(0.3, callback)`.",
        ),
        Told("steady", requires=("period",), points=2, title="The period is steady"),
        Told("ends", title="The node ends after SIGINT", visibility="hidden"),
    ]
    return judged(checks, titles={"listen": "Listen for two seconds"})


def full_points(**changes: object) -> Sample:
    """Full points, in a run with these changes."""
    return judged_runs([Told("node"), Told("topic", points=2)], {"listen": make_run(**changes)})


def reached_limits() -> Sample:
    """Full points, with a limit of the sandbox reached and thirty remarks on the run."""
    posing = tuple(
        Node(f"/bot_\x1bx{number}/rosgrade_probe", Owner.STUDENT, at(0.4)) for number in range(30)
    )
    reached = Breach(at(0.9), "memory", "1056 MiB of memory", "1024 MiB")
    return full_points(nodes=posing, breaches=(reached,))


def not_built() -> Sample:
    """A build that failed, with its log."""
    culprit = SourceError("src/bot_publisher/setup.py", 24, "SyntaxError: invalid syntax")
    build = BuildRecord(
        False, 0.6, failed_packages=("bot_publisher",), culprit=culprit, log="Failed <<< bot"
    )
    checks = [
        Told(
            "builds",
            Finding.failed("`colcon build` to succeed", "it failed"),
            subject=Subject.SUBMISSION,
            title="The package builds",
        ),
        Told("node", requires=("builds",)),
    ]
    return judged_runs(checks, {}, make_submission(build=build))


def not_graded() -> Sample:
    """One check has a bug, one was disturbed, one passed."""
    checks = [
        Told("node", points=2),
        Told("depth", KeyError("depth"), title="The queue depth is 10"),
        Told("period", Finding.error("300 ms", "the host took 212 ms", disturbed=True)),
    ]
    return judged(checks)


def everywhere(text: str) -> Sample:
    """The same text in every place that a student or an author can write to."""
    place = SourceError(text, 3, text)
    evidence = Evidence(
        moments=(Moment(text, 0.5),),
        places=(place,),
        log=(text,),
        plots=(Plot(text, text, text, (0.0, 1.0), (0.0, 2.0), (0.0, 1.0)),),
        tables=(Table(text, (text,), ((text,),)),),
    )
    failed = Finding.failed(text, text, text, evidence)
    checks = [
        Told("a", failed, title=text, hint=text, subject=Subject.SUBMISSION),
        Told("b", failed, title=text, hint=text),
        Told("c", requires=("a",), title=text),
        Told("d", Finding.passed(text, text, evidence), title=text),
        Told("e", ValueError(text), title=text),
        Told("f", Finding.error(text, text, hint=text), title=text),
    ]
    build = BuildRecord(False, 1.0, failed_packages=(text,), culprit=place, log=text)
    submission = make_submission(id=text, sha256=text, build=build, problem=text)
    run = make_run()
    run = replace(
        run,
        submission=submission,
        messages={text: run.messages["/cmd_vel"]},
        nodes=(replace(run.nodes[0], name=text),),
        processes=(replace(run.processes[0], name=text, dropped_bytes=9, survivors=(text,)),),
        log=tuple(LogLine(at(0.1), text, stream, text) for stream in ("stdout", text)),
        environment={text: text},
        breaches=(Breach(at(0.2), "memory", text, text),),
    )
    facts = make_facts(
        started=text,
        rosgrade_version=text,
        environment={text: text},
        recordings={"listen": text},
    )
    found = judged_runs(checks, {"listen": run}, submission, titles={"listen": text}, title=text)
    tries = attempts(1.0, 2.0, sha256=text, handed_in=text, changes=(text,))
    return replace(found, facts=facts, added={"attempts": tries, **reviewed(text)})
