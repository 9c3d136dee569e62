"""A bag of a real robot is judged as a run is: what is in it, and what is wrong with it."""

from __future__ import annotations

import math
import shutil
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from grader.assignment.changed_reference import apply, mutate
from grader.assignment.load import load_assignment
from grader.assignment.mutant import Edits
from grader.assignment.mutant_file import load_mutants
from grader.assignment.reference import read_files
from grader.assignment.selection import select
from grader.dev.bag import bag_of
from grader.errors import AssignmentError
from grader.findings.finding import Status
from grader.grade.model import CheckResult
from grader.grading.files import write_graded
from grader.grading.graded import Graded
from grader.grading.grading import Grading
from grader.grading.regrading import find_recordings, regrade
from grader.grading.spine import HandedIn, grade
from grader.machine import resources, ros
from grader.recording.bag_writer import read_bag, write_bag
from grader.recording.model import Kind
from grader.report.model.facts import Clock
from grader.run.runner import Runner

EXAMPLE = resources.root() / "docs" / "examples" / "real_robot_bag"
ODOMETRY, COMMANDS = "/robot1/odom", "/robot1/cmd_vel"


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    with Runner(ros.find()) as made:
        yield made


Judge = Callable[..., Graded]


@pytest.fixture
def judge(tmp_path: Path, runner: Runner) -> Judge:
    """Grade files of a submission; by default those of the reference, with some of them changed."""

    def graded(
        changes: Mapping[str, object] | None = None,
        files: Mapping[str, bytes] | None = None,
        assignment: Path = EXAMPLE,
    ) -> Graded:
        made = dict(reference() if files is None else files)
        if changes is not None:
            made, problems = mutate(Edits.model_validate(changes), made)
            assert not problems
        submission = tmp_path / "submission"
        shutil.rmtree(submission, ignore_errors=True)
        for name, content in made.items():
            file = submission / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        submission.mkdir(exist_ok=True)
        grading = Grading(load_assignment(assignment), runner, resources.cache_folder())
        return grade(HandedIn(submission, tmp_path / "report"), grading)

    return graded


def reference() -> dict[str, bytes]:
    return read_files(EXAMPLE / "reference")


def variant(root: Path, storage: str, compression: str = "") -> dict[str, bytes]:
    """The bag of the reference, stored in another way."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    messages, definitions = read_bag(EXAMPLE / "reference" / "square")
    writer = Writer(root / "square", version=8, storage_plugin=StoragePlugin[storage.upper()])
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        made = {}
        for one in messages:
            channel = one.channel
            if channel not in made:
                made[channel] = writer.add_connection(
                    channel.name,
                    channel.type,
                    msgdef=definitions[channel.type],
                    rihs01=channel.hash,
                )
            writer.write(made[channel], one.recorded_ns, one.cdr)
    return read_files(root)


def result(graded: Graded, check: str) -> CheckResult:
    return graded.grade.result(check)


def seen(graded: Graded, check: str = "odometry") -> str:
    finding = result(graded, check).decisive.finding
    return f"{finding.expected} | {finding.observed} | {finding.hint}"


def test_a_bag_gets_full_points_and_says_that_its_odometry_is_the_truth(judge: Judge) -> None:
    graded = judge()
    assert graded.grade.full_points
    assert "odometry counts as where the robot is" in seen(graded, "corners")
    assert "in the bag `square`" in seen(graded, "rate")
    recording = graded.recordings["square"]
    assert recording.processes == recording.nodes == recording.disturbance == ()
    published = recording.student_endpoints(Kind.PUBLISHER)
    assert {one.topic for one in published} == {"/odom", "/cmd_vel"}


@pytest.mark.parametrize(
    ("storage", "compression"),
    [("mcap", ""), ("sqlite3", ""), ("sqlite3", "file"), ("sqlite3", "message")],
)
def test_a_bag_is_judged_however_it_is_stored(
    judge: Judge, tmp_path: Path, storage: str, compression: str
) -> None:
    graded = judge(files=variant(tmp_path / "made", storage, compression))
    assert graded.grade.full_points, seen(graded)
    # Only the times at which it was recorded are known.
    assert "times when it was recorded" in seen(graded, "rate")
    assert "times when it was recorded" not in seen(graded, "corners")


def test_a_bag_is_judged_again_from_its_recording(judge: Judge, tmp_path: Path) -> None:
    graded = judge({"bag": {"folder": "square", "without": [COMMANDS]}})
    report = tmp_path / "report"
    write_graded(graded, report, Clock())
    again = regrade(load_assignment(EXAMPLE), find_recordings(report))
    statuses = [(one.id, one.status, one.points) for one in graded.grade.results]
    assert [(one.id, one.status, one.points) for one in again.grade.results] == statuses
    assert Status.FAILED in {status for _, status, _ in statuses}


def test_a_topic_that_is_not_in_the_bag_is_said_with_those_that_are(judge: Judge) -> None:
    graded = judge({"bag": {"folder": "square", "rename": {ODOMETRY: "/robot2/odom"}}})
    assert result(graded, "odometry").status is Status.FAILED
    assert "no message on `/robot1/odom`; it has `/robot1/cmd_vel` and `/robot2/odom`" in seen(
        graded
    )
    assert "Record `/robot1/odom`" in seen(graded)
    assert result(graded, "rate").status is Status.PASSED


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"files": {"square/metadata.yaml": None}}, "no metadata.yaml, which is written when"),
        ({"files": {"square/metadata.yaml": "a: ["}}, "square`: it cannot be read"),
        ({"files": {"square/square.mcap": None}}, "there is no bag, a folder with"),
        ({"files": {"square/square.mcap": "no MCAP"}}, "square`: it cannot be read"),
        ({"files": {"square/square.db3-wal": "x"}}, "square.db3-wal lies in it"),
        ({"files": {"square": None, "README.md": "x"}}, "there is no bag, a folder with"),
        ({"files": {"square": None}}, "there is no bag, a folder with"),
        (
            {"bag": {"folder": "square", "without": [ODOMETRY, COMMANDS]}},
            "has no message on `/robot1/odom`; it is empty",
        ),
    ],
)
def test_a_bag_that_cannot_be_judged_costs_the_points_and_says_why(
    judge: Judge, changes: dict[str, object], words: str
) -> None:
    graded = judge(changes)
    assert result(graded, "odometry").status is Status.FAILED, seen(graded)
    assert graded.grade.graded
    assert words in seen(graded)
    assert result(graded, "odometry").decisive.finding.hint


def test_a_bag_in_mcap_without_its_end_cannot_be_read(judge: Judge) -> None:
    files = reference()
    files["square/square.mcap"] = files["square/square.mcap"][:-3000]
    graded = judge(files=files)
    assert result(graded, "odometry").status is Status.FAILED
    assert "cannot be read" in seen(graded)


def test_a_bag_with_more_than_can_be_judged_costs_the_points_and_nothing_else(
    judge: Judge, tmp_path: Path
) -> None:
    """It is small where it lies: 80 MiB of zeros, compressed."""
    messages, definitions = read_bag(EXAMPLE / "reference" / "square")
    bloated = [
        replace(one, cdr=bytes(8 * 2**20)) if index < 10 else one
        for index, one in enumerate(messages)
    ]
    write_bag(tmp_path / "big" / "square", bloated, definitions)
    graded = judge(files=read_files(tmp_path / "big"))
    assert "more than 500,000 messages or 64 MiB of what is judged" in seen(graded)
    assert (result(graded, "odometry").status, graded.grade.graded) == (Status.FAILED, True)


def test_of_two_bags_the_submission_says_which_is_meant(judge: Judge) -> None:
    files = dict(reference())
    other, _ = mutate(Edits.model_validate({"bag": {"folder": "square", "until": "9 s"}}), files)
    files |= {path.replace("square/", "second/"): content for path, content in other.items()}
    # The name of the file in it stays.
    asked = judge(files=files)
    assert result(asked, "odometry").status is Status.ERROR
    assert "`square: second`" in seen(asked)
    answered = judge(files={**files, "rosgrade.yaml": b"square: square\n"})
    assert answered.grade.full_points
    wrong = judge(files={**files, "rosgrade.yaml": b"square: third\n"})
    assert "there is `second` and `square`" in seen(wrong)


def test_a_bag_that_was_handed_in_twice_is_one_bag(judge: Judge) -> None:
    files = reference()
    files |= {f"copy/{path}": content for path, content in files.items()}
    graded = judge(files=files)
    assert graded.grade.full_points
    (note,) = graded.recordings["square"].bag_notes
    assert note == "it was handed in more than once, as `square` too"


def test_messages_that_are_in_a_bag_twice_count_once(judge: Judge, tmp_path: Path) -> None:
    messages, definitions = read_bag(EXAMPLE / "reference" / "square")
    write_bag(tmp_path / "made" / "square", [*messages, *messages], definitions)
    graded = judge(files=read_files(tmp_path / "made"))
    recording = graded.recordings["square"]
    assert len(recording.on("/cmd_vel")) == 350
    assert any("are in it more than once, and count once" in note for note in recording.bag_notes)


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_bag_of_topics_without_a_message_is_the_students_and_costs_the_points(
    judge: Judge, tmp_path: Path, storage: str
) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer

    messages, definitions = read_bag(EXAMPLE / "reference" / "square")
    with Writer(
        tmp_path / "made" / "square", version=9, storage_plugin=StoragePlugin[storage]
    ) as bag:
        for one in {one.channel for one in messages}:
            bag.add_connection(one.name, one.type, msgdef=definitions[one.type], rihs01=one.hash)
    graded = judge(files=read_files(tmp_path / "made"))
    assert (graded.grade.graded, graded.grade.score) == (True, 0.0)
    assert "no message on `/robot1/cmd_vel`; it is empty" in seen(graded, "commands")


def test_a_recording_that_begins_or_ends_while_the_robot_drives_is_told_so(judge: Judge) -> None:
    late = judge({"bag": {"folder": "square", "since": "8 s"}})
    assert "the robot drives already when it begins" in seen(late, "corners")
    early = judge({"bag": {"folder": "square", "until": "26 s"}})
    assert "End the recording when the robot stands" in seen(early, "back")
    assert "drove on" not in seen(early, "back")


def test_two_publishers_a_cut_and_other_clocks_are_said(judge: Judge, tmp_path: Path) -> None:
    messages, definitions = read_bag(EXAMPLE / "reference" / "square")
    late = [
        replace(
            one,
            channel=replace(one.channel, publishers=one.channel.publishers * 2),
            published_ns=one.published_ns + 5 * 10**9,
            recorded_ns=one.recorded_ns + 5 * 10**9,
        )
        for one in messages
    ]
    write_bag(tmp_path / "made" / "square", late, definitions)
    files = read_files(tmp_path / "made")
    text = files["square/metadata.yaml"].replace(b"message_count: 1050", b"message_count: 1060")
    files["square/metadata.yaml"] = text
    notes = " | ".join(judge(files=files).recordings["square"].bag_notes)
    assert "2 publishers were on `/odom` while it was recorded" in notes
    assert "the stamps in the headers of `/odom` are 5 s behind the times of the bag" in notes
    assert "it is cut: its metadata.yaml counts 10 messages more than are in it" in notes


def test_another_definition_of_a_type_is_said(judge: Judge, tmp_path: Path) -> None:
    messages, definitions = read_bag(EXAMPLE / "reference" / "square")
    other = [
        replace(one, channel=replace(one.channel, hash="RIHS01_" + "0" * 64), cdr=one.cdr[:20])
        if one.channel.name == ODOMETRY
        else one
        for one in messages
    ]
    write_bag(tmp_path / "made" / "square", other, definitions)
    graded = judge(files=read_files(tmp_path / "made"))
    assert result(graded, "corners").status is Status.FAILED
    assert "another definition of `nav_msgs/msg/Odometry`" in seen(graded, "corners")


def test_what_comes_after_the_timeout_is_not_judged(judge: Judge, tmp_path: Path) -> None:
    copy = with_yaml(tmp_path, "timeout: 2 min", "timeout: 12 s")
    graded = judge(assignment=copy)
    assert result(graded, "corners").status is Status.FAILED
    assert "only the first 12 s" in seen(graded, "corners")


def with_yaml(tmp_path: Path, old: str, new: str) -> Path:
    copy = tmp_path / "real_robot_bag"
    shutil.copytree(EXAMPLE, copy)
    file = copy / "assignment.yaml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    return copy


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "uses: timing.rate\n    with: {topic: /cmd_vel, at_least: 5 Hz}",
            "uses: node.alive",
            "'node.alive' looks at more than a bag holds",
        ),
        (
            "uses: motion.visits\n    with: {places: [[1, 0], [1, 1], [0, 1]], position: 15 cm}",
            "uses: motion.no_contact",
            "'motion.no_contact' looks at more than a bag holds",
        ),
        (
            "uses: motion.visits\n    with: {places: [[1, 0], [1, 1], [0, 1]], position: 15 cm}",
            "uses: motion.follows_line",
            "'motion.follows_line' looks at more than a bag holds",
        ),
        ("at_least: 5 Hz}", "at_least: 5 Hz}\n    after: {log: ready}", "which does not show this"),
        ("timeout: 2 min", "timeout: 2 min\n    world: worlds/a.yaml", "leave 'world' out"),
        ("timeout: 2 min", "timeout: 2 min\n    odometry: {enabled: false}", "is not enabled"),
        ("/robot1/odom: /odom", "/robot1/odom: /odometry", "'/odometry' is not recorded"),
        (
            "bag:\n      rename",
            "launch: [{executable: a}]\n    bag:\n      rename",
            "leave 'launch' out",
        ),
    ],
)
def test_what_a_bag_does_not_have_is_refused(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    with pytest.raises(AssignmentError, match=words.replace("(", r"\(")):
        load_assignment(with_yaml(tmp_path, old, new))


def test_a_scenario_needs_something_to_launch_or_a_bag(tmp_path: Path) -> None:
    file = with_yaml(tmp_path, "    bag:\n      rename", "    topics:\n      rename")
    with pytest.raises(AssignmentError):
        load_assignment(file)


MIXED = """\
rosgrade: 1
id: mixed
title: A run and a bag
packages: [{name: bot, executables: [bot]}]
scenarios:
  - id: run
    launch: [{executable: bot}]
    record: [{topic: /odom, type: nav_msgs/msg/Odometry}]
    timeout: 5 s
  - id: bag
    bag: {name: sq*, rename: {/robot1/odom: /odom}}
    timeout: 2 min
checks:
  - {id: alive, uses: node.alive, points: 1}
  - {id: sent, uses: messages.count, with: {topic: /odom, at_least: 1}, points: 1}
  - id: driven
    uses: messages.count
    with: {topic: /odom, at_least: 700}
    scenarios: [bag]
    points: 1
"""


def test_beside_runs_a_bag_is_judged_only_by_checks_that_name_it(
    judge: Judge, tmp_path: Path
) -> None:
    (tmp_path / "mixed").mkdir()
    file = tmp_path / "mixed" / "assignment.yaml"
    file.write_text(MIXED)
    loaded = load_assignment(file)
    judged = {one.spec.id: [run.id for run in loaded.scenarios_of(one)] for one in loaded.checks}
    assert judged == {"alive": ["run"], "sent": ["run"], "driven": ["bag"]}
    # Without a package nothing can be run, and the bag is judged nevertheless.
    statuses = {one.id: one.status for one in judge(assignment=file).grade.results}
    assert statuses.pop("driven") is Status.PASSED
    assert set(statuses.values()) == {Status.FAILED}


def test_commands_that_no_robot_can_follow_are_said(judge: Judge, tmp_path: Path) -> None:
    messages, definitions = read_bag(EXAMPLE / "reference" / "square")
    nan = struct.pack("<4x6d", *(math.nan,) * 6)
    wrong = [
        replace(one, cdr=one.cdr[:4] + nan[4:]) if one.channel.name == COMMANDS else one
        for one in messages
    ]
    write_bag(tmp_path / "made" / "square", wrong, definitions)
    limits = with_yaml(
        tmp_path,
        "uses: timing.rate\n    with: {topic: /cmd_vel, at_least: 5 Hz}",
        "uses: motion.within_limits",
    )
    graded = judge(files=read_files(tmp_path / "made"), assignment=limits)
    assert "350 commands on `/cmd_vel` were not finite" in seen(graded, "rate")
    assert result(graded, "corners").status is Status.PASSED


JUDGED = (
    *("arrives", "aligns", "phases", "often", "proportional", "proportional_align", "limits"),
    *("overshoot", "settles"),
)


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.parametrize(
    ("mutant", "storage"),
    [
        (None, "mcap"),
        (None, "sqlite3"),
        ("bang_bang", "sqlite3"),
        ("theta_ignored", "mcap"),
        ("limit_missing", "sqlite3"),
    ],
)
def test_a_bag_of_a_run_is_judged_as_the_run_itself(
    tmp_path: Path, runner: Runner, mutant: str | None, storage: str
) -> None:
    whole = load_assignment("p_controller")
    loaded = select(whole, JUDGED, ("ahead",))
    submission = resources.reference() / "p_controller"
    if mutant is not None:
        every = load_mutants(whole.assignment, whole.folder).mutants
        apply(next(one for one in every if one.id == mutant), submission, tmp_path / "mutant")
        submission = tmp_path / "mutant"
    grading = Grading(loaded, runner, resources.cache_folder())
    run = grade(HandedIn(submission, tmp_path / "run"), grading)
    bag_of(run.files["ahead"], tmp_path / "handed_in" / "bag", storage)
    folder = tmp_path / "of_bag"
    shutil.copytree(loaded.folder / "checks", folder / "checks")
    (folder / "assignment.yaml").write_text(as_bag())
    read = Grading(load_assignment(folder), runner, resources.cache_folder())
    bag = grade(HandedIn(tmp_path / "handed_in", tmp_path / "report"), read)
    # What the lesson requires first is not required of the bag.
    judged = [name for name in JUDGED if result(run, name).status is not Status.SKIPPED]
    assert {name: seen(bag, name) for name in judged if not same(run, bag, name)} == {}
    failed = {result(run, name).status for name in judged} - {Status.PASSED}
    assert failed == (set() if mutant is None else {Status.FAILED})


def same(run: Graded, bag: Graded, name: str) -> bool:
    return result(run, name).status is result(bag, name).status


def as_bag() -> str:
    goal = "goal: [goal_x, goal_y, goal_theta], position: 0.08 m"
    checks = {
        "arrives": f"motion.path_length, with: {{{goal}, most: 40 %}}",
        "aligns": f"motion.reaches, with: {{{goal}, heading: 0.1 rad}}",
        "phases": f"motion.two_phases, with: {{{goal}}}",
        "often": "timing.rate, with: {topic: /cmd_vel, at_least: 2.5 Hz}",
        "proportional": "motion.proportional, with: "
        "{goal: [goal_x, goal_y, goal_theta], phase: position, r2: 0.9}",
        "proportional_align": "motion.proportional, with: "
        "{goal: [goal_x, goal_y, goal_theta], phase: align, r2: 0.9}",
        "limits": "motion.within_limits",
        "overshoot": f"motion.overshoot, with: {{{goal}, most: 4 cm}}",
        "settles": "motion.settles, with: {within: 22 s}",
    }
    lines = "".join(
        f"  - {{id: {name}, points: 1, uses: {text}}}\n" for name, text in checks.items()
    )
    return f"""\
rosgrade: 1
id: of_bag
title: The run as a bag
scenarios:
  - id: ahead
    bag: {{}}
    values: {{goal_x: 0.4, goal_y: 0.6, goal_theta: 90 deg}}
    timeout: 30 s
checks:
{lines}"""
