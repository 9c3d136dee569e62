"""``rosgrade replay``: what happened at grading, again at home."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from grader.assignment.load import load_assignment
from grader.cli.options import Quiet, recording_argument
from grader.cli.screen.progress import Progress
from grader.errors import UsageError
from grader.grade.judging import why_not_run
from grader.grade.naming import with_chosen_names
from grader.grading.own_interfaces import own_packages
from grader.grading.regrading import find_recordings
from grader.grading.type_support import TypeSupport
from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.recording.mcap_reader import read_recording
from grader.run.replay import replay as replay_recording
from grader.run.replay import replay_scenario
from grader.run.request import RunRequest
from grader.submission.intake.locate import check_path
from grader.submission.prepare import Preparation, prepare


def replay(
    recording: Annotated[
        Path,
        typer.Argument(
            help="A recording, such as recordings/run.mcap.", callback=recording_argument
        ),
    ],
    submission: Annotated[Path, typer.Argument(help="Program to run: a folder or an archive.")],
    assignment: Annotated[
        str | None,
        typer.Argument(help="Id or folder; by default the assignment of the recording."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Send a node the messages of a recording again.

    Shows what the node prints. The messages come at their recorded times: a simulated robot
    does not react to the node. Services and actions are not replayed. The node runs without a
    sandbox, as with `ros2 run`, on its own ROS domain.

    Ends with 0 when all messages were sent, 1 when the node ended early or never subscribed.
    """
    recorded = read_recording(recording)
    if recorded.bag is not None:
        raise UsageError(f"{recording}: is what was in a bag: `ros2 bag play` sends that again")
    found = find_recordings(recording)
    words = ("replay", str(recording), str(submission))
    loaded = load_assignment(assignment or found.assignment_folder(*words))
    check_path(submission)
    progress = Progress(quiet)
    installation = ros.find()
    with progress.shown():
        installation = TypeSupport(loaded, installation, cache_folder()).student(progress.say)
        how = Preparation(ros=installation, cache=cache_folder(), on_progress=progress.say)
        prepared = prepare(submission, how)
        record = replace(prepared.record, given=recorded.submission.given)
        named = with_chosen_names(loaded, record, {recorded.scenario: recorded})
        loaded, own = named.loaded, own_packages(named.loaded, named.submission)
        support = TypeSupport(loaded, ros.find(), cache_folder(), own=own)
        type_support = support.prefixes(progress.say)
    reason = why_not_run(prepared.record, [one.name for one in loaded.assignment.packages])
    if prepared.install is None or reason is not None:
        problem = reason.observed if reason else prepared.record.problem
        raise UsageError(f"{submission}: {problem}")
    request = RunRequest(
        loaded.assignment,
        replay_scenario(recording, recorded, loaded.assignment),
        prepared.record,
        prepared.install,
        recorded.seed,
        underlays=prepared.underlays,
        type_support=tuple(type_support),
    )
    raise typer.Exit(replay_recording(request, installation))
