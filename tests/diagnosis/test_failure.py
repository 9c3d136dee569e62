"""Tracebacks in a process's output, as CPython 3.10 to 3.13 print them."""

from hypothesis import given
from hypothesis import strategies as st

from grader.diagnosis.process.raised import (
    fatal_failure,
    interrupted_call,
    student_place,
    submission_path,
)
from grader.diagnosis.process.tracebacks import parse_failures
from tests.checks.builder import (
    BOT,
    INSTALLED,
    SOURCE,
    output,
    package,
    recording,
    submission,
)

PLAIN = """\
[INFO] [1700000000.0] [bot_publisher]: ready
Traceback (most recent call last):
  File "/w/install/lib/bot_publisher/bot_pub", line 33, in <module>
    sys.exit(main())
             ^^^^^^
  File "/w/install/lib/python3.12/site-packages/bot_publisher/node.py", line 20, in main
    rclpy.spin(node)
  File "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/__init__.py", line 247, in spin
    executor.spin_once()
  File "/w/install/lib/python3.12/site-packages/bot_publisher/node.py", line 14, in tick
    return 1 / 0
           ~~^~~
ZeroDivisionError: division by zero
[INFO] after"""


def test_type_message_frames_and_source():
    (failure,) = parse_failures(PLAIN.splitlines())
    assert str(failure) == "ZeroDivisionError: division by zero"
    assert [frame.line for frame in failure.frames] == [33, 20, 247, 14]
    assert failure.frames[-1].where == "tick"
    assert failure.frames[-1].source == "return 1 / 0"


def test_the_deepest_frame_of_the_student_is_the_place():
    (failure,) = parse_failures(PLAIN.splitlines())
    place = student_place(failure, submission())
    assert str(place) == f"{SOURCE}:14: ZeroDivisionError: division by zero"


def test_the_class_is_named_without_its_module():
    lines = PLAIN.replace("ZeroDivisionError", "rclpy.exceptions.InvalidHandle").splitlines()
    assert parse_failures(lines)[0].type == "InvalidHandle"


def test_an_exception_without_text():
    lines = PLAIN.replace("ZeroDivisionError: division by zero", "KeyboardInterrupt").splitlines()
    assert str(parse_failures(lines)[0]) == "KeyboardInterrupt"


def test_a_script_that_python_cannot_parse_has_no_header():
    lines = ['  File "/w/src/node.py", line 3', "    def f(:", "          ^", "SyntaxError: bad"]
    (failure,) = parse_failures(lines)
    assert (failure.type, failure.frames[0].line, failure.frames[0].where) == ("SyntaxError", 3, "")


def test_an_ignored_exception_is_not_fatal():
    log = output(PLAIN) + output(
        "Exception ignored in: <function Node.__del__ at 0x7f>\n"
        + PLAIN.replace("ZeroDivisionError: division by zero", "TypeError: late")
    )
    assert fatal_failure(recording(log=log), BOT).type == "ZeroDivisionError"


def test_raise_from_leads_to_the_first_cause():
    link = "\n\nThe above exception was the direct cause of the following exception:\n\n"
    second = PLAIN.replace("ZeroDivisionError: division by zero", "RuntimeError: wrapped")
    log = output(PLAIN + link + second.partition("\n")[2])
    assert fatal_failure(recording(log=log), BOT).type == "ZeroDivisionError"


def test_what_rclpy_says_in_better_words_of_its_own_exception_is_the_cause():
    # As it prints it for Node('bot-publisher'); the first one never was in the student's file.
    first = """\
Traceback (most recent call last):
  File "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/node.py", line 202, in __init__
    self.__node = _rclpy.Node(
ValueError: invalid node name: node name must not contain characters other than alphanumerics

During handling of the above exception, another exception occurred:

"""
    second = PLAIN.replace(
        "ZeroDivisionError: division by zero", "InvalidNodeNameException: Invalid"
    )
    log = output(first + second.partition("\n")[2])
    assert fatal_failure(recording(log=log), BOT).type == "InvalidNodeNameException"


def test_the_last_of_two_unrelated_tracebacks_is_fatal():
    second = PLAIN.replace("ZeroDivisionError: division by zero", "KeyError: 'x'")
    log = output(PLAIN) + output(second)
    assert fatal_failure(recording(log=log), BOT).type == "KeyError"


def test_output_of_another_process_or_on_stdout_is_not_read():
    log = output(PLAIN, name="other/bot") + output(PLAIN, stream="stdout")
    assert fatal_failure(recording(log=log), BOT) is None


def test_a_traceback_that_was_cut_off_is_none():
    assert parse_failures(PLAIN.splitlines()[:7]) == ()
    assert parse_failures(["Traceback (most recent call last):"]) == ()


def test_where_it_was_interrupted():
    text = PLAIN.replace("ZeroDivisionError: division by zero", "KeyboardInterrupt")
    text = text.replace("return 1 / 0", "time.sleep(1)")
    call = interrupted_call(recording(log=output(text)), BOT)
    assert (call.place.file, call.place.line) == (SOURCE, 14)
    assert call.text == "time.sleep(1)"


class TestSubmissionPath:
    def test_installed_files_lead_back_to_the_submission(self):
        assert submission_path(INSTALLED, submission()) == SOURCE

    def test_files_of_rclpy_are_not_the_students(self):
        rclpy = "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/node.py"
        lone = submission(package(files=(("node.py", "src/p/node.py"),)))
        assert submission_path(rclpy, submission()) is None
        assert submission_path(rclpy, lone) is None
        assert submission_path("/w/lib/python3.12/site-packages/node.py", lone) == "src/p/node.py"

    def test_a_name_that_only_ends_alike_is_another_file(self):
        other = "/w/lib/python3.12/site-packages/my_bot_publisher/node.py"
        assert submission_path(other, submission()) is None


LINES = st.lists(
    st.one_of(
        st.sampled_from(PLAIN.splitlines()),
        st.sampled_from(["", "  ", "Exception ignored in: x", '  File "x", line 1']),
        st.text(max_size=30),
    ),
    max_size=40,
)


@given(LINES)
def test_no_output_upsets_the_parser(lines):
    for failure in parse_failures(lines):
        assert failure.type and failure.frames
