"""What compiled programs leave when a failure ends them, and what students read of it."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.diagnosis.process.crash import parse_crashes
from grader.recording.model import Ending
from tests.checks.builder import (
    declared,
    died,
    failing,
    judge,
    nodeless,
    output,
    package,
    submission,
)

SOURCE = "src/bot_publisher/src/bot_publisher.cpp"
STARTED = declared("started", language="C++")
HANDED_IN = submission(package(build_type="ament_cmake"), files=(SOURCE, "src/other/src/bot.cpp"))
NO_SYMBOLS = "Find the line with a debugger"


def ended(exit_code: int, text: str, **changes: Any) -> str:
    """What a student reads of a compiled program that wrote this and ended so."""
    run = {
        "processes": (died(exit_code),),
        "ending": Ending.EXITED,
        "log": output(text),
        "declarations": (STARTED,),
        "submission": HANDED_IN,
    }
    return failing("node.alive", nodeless(**{**run, **changes}))


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no compiler")
    built = tmp_path_factory.mktemp("crash") / "bot_pub"
    source = Path(__file__).with_name("crashing.cpp")
    command = [compiler, "-std=c++17", "-O0", "-w", "-pthread", str(source), "-o", str(built)]
    subprocess.run(command, check=True, timeout=600)
    yield built


@pytest.mark.parametrize(
    ("way", "observed", "hint"),
    [
        ("throws", "with std::runtime_error: no scan yet", NO_SYMBOLS),
        ("throws again", "with std::runtime_error: outer", NO_SYMBOLS),
        ("throws a number", "with int", NO_SYMBOLS),
        ("leaves a thread", "terminate called without an active exception", "call join()"),
        ("asks for all memory", "with std::bad_alloc", "a size that is negative"),
        ("calls nothing", "with std::bad_function_call", "std::bind"),
        ("shares itself", "with std::bad_weak_ptr", "shared_from_this() fails"),
        ("reads beyond", "with std::out_of_range: vector", "The vector is empty"),
        ("reads no file", "with std::filesystem::filesystem_error", "${PROJECT_NAME}"),
        ("asserts", "with SIGABRT: abort", NO_SYMBOLS),
        ("frees twice", "free(): double free detected", "std::make_shared<Bot>()"),
        ("calls a pure function", "with SIGABRT: pure virtual method called", "the constructor"),
        ("aborts", "with SIGABRT: abort", NO_SYMBOLS),
        ("writes to null", "with SIGSEGV: segmentation fault", "memory that is not its own"),
    ],
)
def test_how_a_real_program_ended(program: Path, way: str, observed: str, hint: str) -> None:
    done = subprocess.run([program, way], capture_output=True, text=True, check=False, timeout=600)
    found = ended(done.returncode, done.stderr)
    assert observed in found
    assert hint in found


CRASHED = """\
terminate called after throwing an instance of 'std::out_of_range'
  what():  vector::_M_range_check: __n (which is 360) >= this->size() (which is 360)
rosgrade: SIGABRT (abort) in bot_pub
rosgrade:   #0 Bot::nearest() at /w/src/bot_publisher/src/bot_publisher.cpp:31
rosgrade:   #1 main at /w/src/bot_publisher/src/bot_publisher.cpp:52
"""


def test_the_deepest_function_of_the_student_is_the_place() -> None:
    run = nodeless(
        processes=(died(-6),), log=output(CRASHED), declarations=(STARTED,), submission=HANDED_IN
    )
    finding = judge("node.alive", run)
    assert finding.evidence.places[0].file == SOURCE
    assert finding.evidence.places[0].line == 31
    assert "(which is 360) (src/bot_publisher/src/bot_publisher.cpp:31)" in finding.observed
    assert "The index 360 is too large: there are 360 elements" in finding.hint


def test_a_crash_without_words_has_its_place() -> None:
    text = "rosgrade: SIGSEGV (segmentation fault) in bot_pub\n"
    found = ended(-11, text + "rosgrade:   #0 main at src/bot_publisher.cpp:7")
    assert f"with SIGSEGV: segmentation fault ({SOURCE}:7)" in found


def test_without_debugging_information_the_function_is_named() -> None:
    text = "rosgrade: SIGSEGV (segmentation fault) in bot_pub\n"
    found = ended(-11, text + "rosgrade:   #0 Bot::nearest() at ??:?")
    assert "with SIGSEGV: segmentation fault in `Bot::nearest()`" in found


def test_a_name_that_rclcpp_refuses_is_shown() -> None:
    text = (
        "terminate called after throwing an instance of 'rclcpp::exceptions::InvalidTopicNameError'"
        "\n  what():  Invalid topic name: topic name token must not start with a number:\n"
        "  '/1st'\n    ^\n\n"
    )
    found = ended(-6, text)
    assert "must not start with a number: '/1st'" in found
    assert "No part begins with a digit." in found


def test_an_exception_that_both_languages_have_has_one_explanation() -> None:
    text = "terminate called after throwing an instance of 'tf2::LookupException'\n"
    text += '  what():  "map" passed to lookupTransform argument target_frame does not exist. '
    assert "tf2 knows no frame `map` yet" in ended(-6, text)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        (
            "/w/install/lib/bot_publisher/bot_pub: error while loading shared libraries: "
            "libdrive.so: cannot open shared object file: No such file or directory",
            "install(TARGETS drive DESTINATION lib)",
        ),
        (
            "/w/install/lib/bot_publisher/bot_pub: symbol lookup error: "
            "/w/install/lib/bot_publisher/bot_pub: undefined symbol: _ZN5Drive4stopEv",
            "name the source file that defines it",
        ),
    ],
)
def test_a_program_that_cannot_be_loaded(text: str, hint: str) -> None:
    # The tracer never came to speak.
    assert hint in ended(127, text, declarations=())


def test_what_ends_a_program_in_python_is_read_as_before() -> None:
    found = ended(-6, CRASHED, declarations=(declared("started"),))
    assert "with SIGABRT (abort)" in found


def test_an_assertion_of_a_message_ends_a_program_in_python() -> None:
    said = "python: _set_pen_s.c:58: convert_from_py: Assertion `PyLong_Check(field)' failed."
    found = ended(-6, said, declarations=(declared("started"),))
    assert "An integer field of a message got something else" in found


def test_a_compiled_program_that_returns_at_once() -> None:
    found = ended(0, "", declarations=(STARTED, declared("node", node="/bot_publisher")))
    assert "with exit code 0: main() returned without" in found


@given(st.lists(st.sampled_from(CRASHED.splitlines()) | st.text(max_size=40), max_size=12))
def test_no_output_upsets_the_parser(lines: list[str]) -> None:
    for failure in parse_crashes(lines):
        assert failure.type and failure.compiled
