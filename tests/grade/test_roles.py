"""Names that an assignment describes instead of saying them: who does what in the graph."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.findings.finding import Status
from grader.grade import Grade, judge_all
from grader.grade.naming import with_chosen_names
from grader.recording.model import Kind, Node, Owner, Recording
from grader.recording.submission import (
    Definition,
    PackageRecord,
    SourceCall,
    SourceFile,
    SubmissionRecord,
)
from tests.checks.builder import TWIST, endpoint, node, package, recording, submission

SCAN, FLOAT = "sensor_msgs/msg/LaserScan", "std_msgs/msg/Float32"
YAML = """\
rosgrade: 1
id: roles
title: Layers
variables:
  driver:
    {match: any, in: executables, where: {publishes: geometry_msgs/msg/Twist}, example: bot_pub}
  near:
    match: any
    in: nodes
    where: {subscribes: sensor_msgs/msg/LaserScan, publishes: nearest}
    example: /perception
  nearest:
    {match: any, in: publishers, of: std_msgs/msg/Float32, where: {node: "{near}"}, example: /near}
  first: &robot {match: any, in: nodes, where: {publishes: cmd_vel}, example: /a}
  second: *robot
packages: [{name: bot_publisher, executables: ["{driver}"]}]
scenarios:
  - id: main
    launch: [{executable: "{driver}"}]
    record: [{topic: "{nearest}", type: std_msgs/msg/Float32}]
    timeout: 5 s
checks:
  - {id: sees, uses: node.exists, with: {name: "{near}"}, points: 1}
  - {id: one, uses: node.exists, with: {name: "{first}"}, points: 1}
  - {id: two, uses: node.exists, with: {name: "{second}"}, points: 1}
"""


@pytest.fixture
def loaded(tmp_path: Path) -> LoadedAssignment:
    folder = tmp_path / "roles"
    folder.mkdir()
    (folder / "assignment.yaml").write_text(YAML, encoding="utf-8")
    return load_assignment(folder)


def ends(name: str, subscribes: dict[str, str], publishes: dict[str, str]) -> Recording:
    """What one node has."""
    made = [
        endpoint(topic=topic, type=type_, node=name, kind=kind)
        for kind, topics in ((Kind.SUBSCRIPTION, subscribes), (Kind.PUBLISHER, publishes))
        for topic, type_ in topics.items()
    ]
    return recording(nodes=(node(name),), endpoints=tuple(made))


EYES = ends("/eyes", {"/scan": SCAN}, {"/nearest": FLOAT})
RIGHT = (
    EYES,
    ends("/one/brain", {}, {"/one/cmd_vel": TWIST}),
    ends("/two/brain", {}, {"/two/cmd_vel": TWIST}),
)


def source(name: str, *types: str) -> SourceFile:
    calls = (SourceCall("self.create_publisher", 7, "topic"),)
    return SourceFile(
        f"bot_publisher/{name}.py",
        f"bot_publisher.{name}",
        names=tuple((one.rpartition(".")[2], one) for one in types),
        calls=calls,
    )


def own(**changes: object) -> SubmissionRecord:
    made: PackageRecord = package(
        entry_points=(("go", "bot_publisher.go:main"), ("look", "bot_publisher.look:main")),
        executables=("go", "look"),
        sources=(source("go", "geometry_msgs.msg.Twist"), source("look", "std_msgs.msg.Float32")),
    )
    return dataclasses.replace(submission(made), **changes)


def graded(loaded: LoadedAssignment, record: SubmissionRecord, *seen: Recording) -> Grade:
    run = dataclasses.replace(
        recording(),
        scenario="main",
        submission=record,
        nodes=tuple(one for run in seen for one in run.nodes),
        endpoints=tuple(one for run in seen for one in run.endpoints),
    )
    return judge_all(loaded, record, {"main": run})


def values(grade: Grade) -> dict[str, str]:
    return dict(grade.loaded.values)


def test_each_role_is_taken_by_what_does_it_under_any_name(loaded: LoadedAssignment) -> None:
    grade = graded(loaded, own(), *RIGHT)
    assert values(grade) == {
        "driver": "go",
        "near": "/eyes",
        "nearest": "/nearest",
        "first": "/one/brain",
        "second": "/two/brain",
    }
    assert grade.full_points
    assert next(one for one in grade.chosen if one.name == "near").why == (
        f"the only node that publishes on `nearest` and subscribes to `{SCAN}`"
    )


def test_the_order_in_which_nodes_are_seen_changes_nothing(loaded: LoadedAssignment) -> None:
    there, back = graded(loaded, own(), *RIGHT), graded(loaded, own(), *reversed(RIGHT))
    assert values(there) == values(back)
    assert [one.status for one in there.results] == [one.status for one in back.results]


def test_which_of_two_has_a_role_is_asked_and_costs_nothing(loaded: LoadedAssignment) -> None:
    other = ends("/spy", {"/scan": SCAN}, {"/spy/nearest": FLOAT})
    grade = graded(loaded, own(), *RIGHT, other)
    result = grade.result("sees")
    assert result.status is Status.ERROR and result.decisive.finding.asks
    assert "`/eyes` and `/spy`" in result.decisive.finding.observed
    assert "`near: /eyes`" in result.decisive.finding.hint
    assert not grade.graded
    # What is known is judged.
    assert grade.result("one").status is Status.PASSED


def test_the_submission_itself_says_which_is_meant(loaded: LoadedAssignment) -> None:
    other = ends("/spy", {"/scan": SCAN}, {"/spy/nearest": FLOAT})
    grade = graded(loaded, own(answers=(("near", "/spy"),)), *RIGHT, other)
    assert grade.full_points
    assert values(grade)["nearest"] == "/spy/nearest"
    assert [one.why for one in grade.chosen if one.name == "near"] == ["as `rosgrade.yaml` says"]


def test_of_two_of_one_role_the_submission_may_say_one(loaded: LoadedAssignment) -> None:
    grade = graded(loaded, own(answers=(("first", "/two/brain"),)), *RIGHT)
    assert (values(grade)["first"], values(grade)["second"]) == ("/two/brain", "/one/brain")


def test_a_role_that_nothing_has_is_told_with_what_the_nearest_lacks(
    loaded: LoadedAssignment,
) -> None:
    grade = graded(loaded, own(), ends("/eyes", {"/scan": SCAN}, {"/near": FLOAT}), *RIGHT[1:])
    finding = grade.result("sees").decisive.finding
    assert finding.status is Status.FAILED
    assert finding.expected == (
        f"one node that publishes on `nearest` and subscribes to `{SCAN}`, under any name"
    )
    assert finding.observed.endswith(
        "`/eyes` comes nearest, and lacks this: publishes on `nearest`"
    )
    assert "`ros2 node info /eyes`" in finding.hint
    assert grade.graded


def test_where_there_is_no_node_the_check_itself_says_why(loaded: LoadedAssignment) -> None:
    foreign = Node("/probe", Owner.PROBE, appeared_ns=0)
    finding = graded(loaded, own(), recording(nodes=(foreign,), endpoints=())).result("sees")
    assert finding.status is Status.FAILED
    assert "comes nearest" not in finding.decisive.finding.observed


@pytest.mark.parametrize(
    ("answers", "told"),
    [
        ((("naer", "/eyes"),), "there is no name 'naer' to choose. Did you mean 'near'?"),
        ((("near", ""),), "'near' cannot be '': its form is any"),
        (
            (("first", "one/brain"), ("second", "/one/brain")),
            "'second' and 'first' cannot both be '/one/brain'",
        ),
    ],
)
def test_a_wrong_line_of_the_file_is_told_and_costs_nothing(
    loaded: LoadedAssignment, answers: tuple[tuple[str, str], ...], told: str
) -> None:
    grade = graded(loaded, own(answers=answers), *RIGHT)
    assert not grade.graded
    assert {one.decisive.finding.observed for one in grade.results} == {told}


@pytest.mark.parametrize(
    ("answers", "told"),
    [
        ((("driver", "nosuch"),), "`rosgrade.yaml` says `nosuch`, and there is `go` and `look`"),
        ((("near", "two words"),), "'/two words' is not"),
    ],
)
def test_an_answer_that_names_nothing_is_asked_again_and_costs_nothing(
    loaded: LoadedAssignment, answers: tuple[tuple[str, str], ...], told: str
) -> None:
    grade = graded(loaded, own(answers=answers), *RIGHT)
    assert not grade.graded
    assert any(told in one.decisive.finding.observed for one in grade.results)
    assert all(one.status is not Status.FAILED for one in grade.results)


def test_of_two_of_one_role_one_is_found_where_only_one_is_there(loaded: LoadedAssignment) -> None:
    grade = graded(loaded, own(), *RIGHT[:2])
    assert values(grade)["first"] == "/one/brain"
    assert grade.result("one").status is Status.PASSED
    finding = grade.result("two").decisive.finding
    assert finding.expected == (
        "one node that publishes on `cmd_vel` beside `/one/brain`, under any name"
    )
    assert finding.observed == (
        "found only `/eyes`; `/eyes` comes nearest, and lacks this: publishes on `cmd_vel`"
    )


def test_a_node_that_has_only_the_name_of_the_example_has_no_role(loaded: LoadedAssignment) -> None:
    same = ends("/perception", {"/scan": SCAN}, {"/near": FLOAT})
    result = graded(loaded, own(), same, *RIGHT[1:]).result("sees")
    assert result.status is Status.FAILED
    assert "`/perception` comes nearest, and lacks this" in result.decisive.finding.observed


FREE = """\
rosgrade: 1
id: free
title: A team
variables:
  talk: {match: any, in: interfaces, example: team_msgs/msg/Talk}
  ask: {match: any, in: interfaces, example: team_msgs/srv/Ask}
  talker: {match: any, in: executables, where: {publishes: ["{talk}"]}, example: talker}
  asker: {match: any, in: executables, where: {serves: ["{ask}"]}, example: asker}
  node: {match: any, in: nodes, where: {publishes: ["{talk}"]}, example: /talker}
contract:
  packages:
    bot_publisher:
      executables:
        "{talker}": {ids: talker, publishes: {/talk: {type: "{talk}"}}}
        "{asker}": {ids: asker, serves: {/ask: {type: "{ask}"}}}
  points: {package: 1, talker_executable: 1, asker_executable: 1, talker_topic: 1, asker_service: 1}
scenarios:
  - id: main
    launch: [{file: team.launch.py}]
    record: [{topic: /talk, type: "{talk}"}]
    timeout: 5 s
checks:
  - {id: fields, uses: interface.fields, with: {interface: "{ask}", definition: "---"}, points: 1}
  - {id: node, uses: node.exists, with: {name: "{node}"}, points: 1}
"""


@pytest.fixture
def free(tmp_path: Path) -> LoadedAssignment:
    folder = tmp_path / "free"
    folder.mkdir()
    (folder / "assignment.yaml").write_text(FREE, encoding="utf-8")
    return load_assignment(folder)


def team(*definitions: Definition, **programs: tuple[str, ...]) -> SubmissionRecord:
    """A package with interfaces, and one with programs of these types."""
    interfaces = PackageRecord("own", "own", "ament_cmake", generated=definitions)
    mine: PackageRecord = package(
        entry_points=tuple((name, f"bot_publisher.{name}:main") for name in programs),
        executables=tuple(programs),
        sources=tuple(
            dataclasses.replace(
                source(name, *types),
                calls=(SourceCall("create_publisher", 7), SourceCall("create_service", 8)),
            )
            for name, types in programs.items()
        ),
    )
    return dataclasses.replace(submission(mine), packages=(mine, interfaces))


WORD = Definition("msg/Word.msg", "string text\n")
QUESTION = Definition("srv/Question.srv", "---\n")


def test_a_message_and_a_service_of_any_name_are_told_apart_by_their_kind(
    free: LoadedAssignment,
) -> None:
    record = team(WORD, QUESTION, say=("own.msg.Word",), hear=("own.srv.Question",))
    found = values(graded(free, record, ends("/me", {}, {"/talk": "own/msg/Word"})))
    assert (found["talk"], found["ask"]) == ("own/msg/Word", "own/srv/Question")
    # Also what a list says may be a variable.
    assert (found["talker"], found["asker"], found["node"]) == ("say", "hear", "/me")


def compiled(**files: tuple[str, ...]) -> SubmissionRecord:
    """A package in C++: each program has a source, and its types are included by its header."""
    sources, headers = [], []
    for name, types in files.items():
        source_file, header = f"src/bot_publisher/{name}.cpp", f"src/bot_publisher/{name}.hpp"
        calls = (SourceCall("create_publisher", 7), SourceCall("create_service", 8))
        sources.append(SourceFile(source_file, "", calls=calls))
        included = tuple((one, line, False) for line, one in enumerate(types, start=1))
        sources.append(SourceFile(header, "", includes=included))
        headers.append((source_file, header))
    mine = dataclasses.replace(
        package(executables=tuple(files), sources=tuple(sources)),
        entry_points=(),
        own_headers=tuple(headers),
        build_type="ament_cmake",
        cmake="".join(f"add_executable({name} {name}.cpp)\n" for name in files),
    )
    return dataclasses.replace(
        submission(mine), packages=(mine, *team(WORD, QUESTION).packages[1:])
    )


def test_the_type_of_a_role_may_be_included_by_a_header(free: LoadedAssignment) -> None:
    record = compiled(say=("own/msg/word.hpp",), hear=("own/srv/question.hpp",))
    found = values(graded(free, record))
    assert (found["talker"], found["asker"]) == ("say", "hear")


def test_a_helper_in_another_file_may_create_it(free: LoadedAssignment) -> None:
    base, creates = "bot_publisher.base", ("create_publisher", "create_service")
    record = team(WORD, QUESTION, say=("own.msg.Word", base), hear=("own.srv.Question", base))
    mine = record.packages[0]
    users = (dataclasses.replace(one, calls=()) for one in mine.sources)
    calls = tuple(SourceCall(one, 7) for one in creates)
    helper = SourceFile("bot_publisher/base.py", base, calls=calls)
    mine = dataclasses.replace(mine, sources=(*users, helper))
    record = dataclasses.replace(record, packages=(mine, *record.packages[1:]))
    found = values(graded(free, record))
    assert (found["talker"], found["asker"]) == ("say", "hear")


def test_which_program_is_meant_is_asked_where_its_files_are_not_known(
    free: LoadedAssignment,
) -> None:
    record = compiled(say=("own/msg/word.hpp",), hear=("own/srv/question.hpp",))
    cmake = "add_executable(say ${SAY})\nadd_executable(hear ${HEAR})\n"
    mine = dataclasses.replace(record.packages[0], cmake=cmake)
    record = dataclasses.replace(record, packages=(mine, *record.packages[1:]))
    finding = graded(free, record).result("talker_executable").decisive.finding
    assert finding.asks and "`hear` and `say`" in finding.observed


def test_one_program_may_have_two_roles_of_the_contract(free: LoadedAssignment) -> None:
    record = team(WORD, QUESTION, all=("own.msg.Word", "own.srv.Question"))
    grade = graded(free, record, ends("/me", {}, {"/talk": "own/msg/Word"}))
    assert (values(grade)["talker"], values(grade)["asker"]) == ("all", "all")
    passed = {one.id for one in grade.results if one.status is Status.PASSED}
    assert passed >= {"package", "talker_executable", "asker_executable", "node"}


def test_what_is_not_there_is_lost_with_what_is_described_by_it_and_nothing_else(
    free: LoadedAssignment,
) -> None:
    # Without a message no run can be recorded.
    named = with_chosen_names(free, team(QUESTION, hear=("own.srv.Question",)))
    assert {one for why in named.unnamed for one in why.variables} == {"talk", "talker", "node"}
    assert not all(why.can_run for why in named.unnamed)
    assert named.loaded.values["ask"] == "own/srv/Question"
    # An executable that no launch names is not needed for a run.
    named = with_chosen_names(free, team(WORD, QUESTION, say=("own.msg.Word",)))
    assert [(why.variables, why.can_run) for why in named.unnamed] == [(frozenset({"asker"}), True)]


def test_the_submission_cannot_say_what_has_not_the_role(loaded: LoadedAssignment) -> None:
    grade = graded(loaded, own(answers=(("second", "/eyes"),)), *RIGHT)
    finding = grade.result("two").decisive.finding
    assert finding.asks and not grade.graded
    assert finding.observed == (
        "`rosgrade.yaml` says `/eyes`, and there is `/one/brain` and `/two/brain`"
    )
    # Where nothing has it, this is no question.
    grade = graded(loaded, own(answers=(("near", "/eyes"),)), ends("/eyes", {"/scan": SCAN}, {}))
    assert grade.result("sees").status is Status.FAILED


def test_the_submission_may_leave_out_the_slash(loaded: LoadedAssignment) -> None:
    grade = graded(loaded, own(answers=(("first", "two/brain"),)), *RIGHT)
    assert grade.full_points
    assert (values(grade)["first"], values(grade)["second"]) == ("/two/brain", "/one/brain")
