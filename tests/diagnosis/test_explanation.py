"""The catalogue of explanations: found by itself, asked in order, readable."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest

from grader.authoring.documentation import explanations_markdown
from grader.diagnosis.explanation import Explanation, cause_of, explanations, in_order
from grader.diagnosis.no_messages import FewMessages, NoMessages
from grader.diagnosis.process.exception_table import CPP_ROWS, TABLE, KnownException
from grader.diagnosis.process.exceptions import Raised
from grader.diagnosis.process.failure import Failure, Frame
from grader.diagnosis.process.process_exit import why_it_exited
from grader.recording.submission import SourceFile
from tests.checks.builder import (
    INSTALLED,
    SOURCE,
    declared,
    died,
    output,
    package,
    recording,
    submission,
)

ALL = [(symptom, entry) for symptom, entries in explanations().items() for entry in entries]


def name(case: tuple[type, Explanation]) -> str:
    return f"{case[0].__name__}: {case[1].sentence[:40]}"


@pytest.mark.parametrize(("symptom", "entry"), ALL, ids=map(name, ALL))
def test_every_explanation_is_one_plain_sentence(symptom: type, entry: Explanation) -> None:
    assert re.fullmatch(r"\S.*[.]", entry.sentence), entry.sentence
    assert len(entry.sentence) <= 110
    assert not re.search(r"\b(whoever|nobody|slip|of ours)\b", entry.sentence)


def test_every_explanation_stands_once_below_each_symptom_that_a_check_sees() -> None:
    page = "\n".join(explanations_markdown().values())
    for symptom, entry in [one for one in ALL if not one[0].__subclasses__()]:
        heading = (symptom.__doc__ or "").partition("\n")[0].rstrip(".")
        section = page.split(f"## {heading}\n")[1].split("\n## ")[0]
        assert (
            len(
                re.findall(
                    rf"^- {re.escape(entry.sentence)}( \*\(.+\)\*)?( \[.*)?(<br>.*)?$",
                    section,
                    re.M,
                )
            )
            == 1
        )


@pytest.mark.parametrize("symptom", [NoMessages, FewMessages, Raised])
def test_general_explanations_are_asked_last(symptom: type) -> None:
    order = [entry.is_general for entry in explanations()[symptom]]
    assert order == sorted(order) and order[-1]


def failure(type_: str, message: str, file: str = "/w/node.py", source: str = "") -> Raised:
    frames = (Frame(file, 3, "tick", source),)
    return Raised(Failure(type_, message, frames), recording())


def row(**fields: str) -> KnownException:
    return KnownException(mistake="x.", example="", **fields)


@pytest.mark.parametrize(
    ("row", "raised", "hint"),
    [
        (
            row(message=r"no (?P<what>\w+)", hint="Give it $what, $5 and $other."),
            failure("ValueError", "there is no value"),
            "Give it value, $5 and $other.",
        ),
        (row(type="TypeError", hint="h"), failure("ValueError", ""), None),
        (row(raised_in="rclpy/", hint="h"), failure("ValueError", ""), None),
        (
            row(raised_in="rclpy/", hint="h"),
            failure("ValueError", "", "/opt/rclpy/node.py"),
            "h",
        ),
        (
            row(message=r"(?P<name>\w+)\(\)", source=r"$name\(", hint="h"),
            failure("TypeError", "go() takes", source="self.go(1)"),
            "h",
        ),
        (
            row(message=r"(?P<name>\w+)\(\)", source=r"$name\(", hint="h"),
            failure("TypeError", "go() takes", source="self.come(1)"),
            None,
        ),
    ],
)
def test_a_row_of_the_table_matches_all_that_it_says(
    row: KnownException, raised: Raised, hint: str | None
) -> None:
    assert row.hint_for(raised.failure) == hint


@pytest.mark.parametrize(
    "entry", (*TABLE.exceptions, *CPP_ROWS), ids=lambda entry: entry.example[:60]
)
def test_every_row_of_the_tables_answers_for_its_example(entry: KnownException) -> None:
    type_, _, message = entry.example.partition(": ")
    frame = Frame(f"/opt/ros/jazzy/{entry.raised_in or 'bot/node.py'}", 1, "f", entry.line)
    compiled = entry in CPP_ROWS
    raised = Raised(Failure(type_, message, (frame,), compiled=compiled), recording())
    answer = next(one for one in explanations()[Raised] if one.apply(raised) is not None)
    assert answer.sentence == entry.mistake


@pytest.mark.parametrize(
    ("type_", "message", "files", "hint"),
    [
        (
            "ImportError",
            "cannot import name 'Twist' from 'std_msgs.msg' (/opt/ros/jazzy/std_msgs/msg)",
            (),
            "Write `from geometry_msgs.msg import Twist`, and `<depend>geometry_msgs</depend>` in "
            "package.xml.",
        ),
        (
            "ModuleNotFoundError",
            "No module named 'node'",
            (),
            "`node.py` lies in your package: write `from bot_publisher import node` or "
            "`from bot_publisher.node import ...`.",
        ),
        (
            "ModuleNotFoundError",
            "No module named 'helper'",
            ("src/bot_publisher/helper.py",),
            "The build did not install `src/bot_publisher/helper.py`. Move it into the folder "
            "`bot_publisher`, beside `__init__.py`, and write `from bot_publisher import helper`.",
        ),
        (
            "FileNotFoundError",
            "[Errno 2] No such file or directory: '/home/ada/src/bot_publisher/config/speed.txt'",
            ("src/bot_publisher/config/speed.txt",),
            "Programs run in another folder, and on other machines than yours. Install the file, "
            "`('share/bot_publisher/config', ['config/speed.txt'])` in data_files of setup.py, and "
            "open `os.path.join(get_package_share_directory('bot_publisher'), "
            "'config/speed.txt')` (of ament_index_python.packages).",
        ),
    ],
)
def test_the_hint_names_what_to_write_in_this_submission(
    type_: str, message: str, files: tuple[str, ...], hint: str
) -> None:
    run = recording(submission=submission(files=files))
    assert cause_of(Raised(Failure(type_, message, ()), run)) == hint


def test_the_fields_that_a_message_has_are_listed() -> None:
    run = recording(declarations=(declared("exiting", 2.0, fields="x y z"),))
    raised = Raised(Failure("AttributeError", "'Vector3' object has no attribute 'w'", ()), run)
    assert cause_of(raised) == "`Vector3` has the fields `x`, `y` and `z`."


def test_a_stamp_without_to_msg_is_told_at_the_line_that_sets_it() -> None:
    sources = SourceFile(
        SOURCE,
        "bot_publisher.node",
        sets=(("msg.header.stamp", 8), ("self.time", 9), ("self.out.header.stamp", 12)),
    )
    lines = (
        *("Traceback (most recent call last):", f'  File "{INSTALLED}", line 14, in tick'),
        *(
            "    self.publisher.publish(self.out)",
            '  File "/opt/rclpy/publisher.py", line 70, in p',
        ),
        *("    publish(msg)", "AttributeError: 'Time' object has no attribute 'sec'"),
    )
    told = declared("exiting", 2.0, fields="sec nanosec", field="header.stamp")
    run = recording(
        submission=submission(package(sources=(sources,))),
        declarations=(told,),
        processes=(died(1),),
        log=output("\n".join(lines)),
    )
    cause = why_it_exited(run, run.processes[0])
    assert f"({SOURCE}:12)" in cause.observed
    assert [place.line for place in cause.evidence.places] == [12]
    assert "now().to_msg()" in cause.hint


def test_a_module_of_nobody_is_not_looked_for_in_a_package_at_the_top() -> None:
    run = recording(submission=submission(package(path="."), files=("bot_publisher/node.py",)))
    hint = cause_of(Raised(Failure("ModuleNotFoundError", "No module named 'pydantic'", ()), run))
    assert hint.startswith("Python does not find this module: check its spelling")


def in_turn(*entries: Explanation) -> list[str]:
    return [entry.name for entry in in_order(entries)]


def found(name: str, module: str = "here", **changes: Any) -> Explanation:
    entry = Explanation(NoMessages, name, changes.pop("apply", str), module, "It is so.")
    return replace(entry, **changes)


def test_two_explanations_that_could_both_apply_have_a_declared_order() -> None:
    one, other = found("one", "a", apply=abs), found("other", "b", apply=len)
    with pytest.raises(LookupError, match=r"before= or after= .+ a\.one, b\.other"):
        in_turn(one, other)
    assert in_turn(one, replace(other, before=(abs,))) == ["other", "one"]
    assert in_turn(one, replace(other, after=(abs,))) == ["one", "other"]
    assert in_turn(replace(one, is_general=True), other) == ["other", "one"]


def test_explanations_of_one_module_are_asked_as_they_stand_there() -> None:
    entries = [found(name, apply=abs if name == "b" else str) for name in "abc"]
    assert in_turn(*entries) == ["a", "b", "c"]
    between = found("between", "elsewhere", apply=len, after=(abs,))
    with pytest.raises(LookupError):
        in_turn(between, *entries)


def test_an_explanation_serves_the_symptoms_that_are_derived_from_its_own() -> None:
    for symptom, entries in explanations().items():
        for base in symptom.__mro__[1:]:
            assert set(explanations().get(base, ())) <= set(entries)
