"""Logs as colcon 0.18 to 0.21 writes them, cut to what matters."""

from __future__ import annotations

from dataclasses import replace
from textwrap import dedent

import pytest

from grader.submission.build.build_error_location import Sources, find_build_error, last_started
from grader.submission.record import SourceError
from tests.submission.samples import SETUP_PY

FILES = {
    "src/bot/setup.py",
    "src/bot/package.xml",
    "src/bot/bot/node.py",
    "src/c/CMakeLists.txt",
    "src/c/package.xml",
    "src/c/src/x.cpp",
    "src/c/msg/Bot.msg",
}
SOURCES = Sources(
    files=FILES,
    folders={"bot": "src/bot", "c": "src/c"},
    texts={
        "src/bot/setup.py": SETUP_PY.splitlines(),
        "src/c/msg/Bot.msg": ["uint8 model", "unit8 x"],
    },
)
RUN_SETUP = """\
Traceback (most recent call last):
  File "<string>", line 1, in <module>
  File "/venv/setuptools/_distutils/core.py", line 267, in run_setup
    exec(code, g)
"""


def culprit(log: str, *failed: str, sources: Sources = SOURCES) -> str:
    return str(find_build_error(dedent(log), failed or ("bot", "c"), sources))


def test_setup_py_that_raises_is_blamed_with_its_line() -> None:
    log = f'Starting >>> bot\n{RUN_SETUP}  File "<string>", line 5, in <module>\nValueError: boom\n'
    assert culprit(log) == "src/bot/setup.py:5: ValueError: boom"


READS_CONFIG = f"""\
Starting >>> bot
{RUN_SETUP}  File "<string>", line 7, in <module>
  File "/venv/setuptools/dist.py", line 448, in _parse_config_files
    parser.read_file(reader)
"""


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            "MissingSectionHeaderError: File contains no section headers.\n"
            "file: 'setup.cfg', line: 1\n'\\ufeff[develop]\\n'",
            "1: begins with a byte order mark (BOM), so its first section is not found: save it "
            "as UTF-8 without BOM",
        ),
        (
            "MissingSectionHeaderError: File contains no section headers.\n"
            "file: 'setup.cfg', line: 1\n'[develop\\n'",
            "1: configparser.MissingSectionHeaderError: File contains no section headers.",
        ),
        (
            "ParsingError: Source contains parsing errors: 'setup.cfg'\n\t[line  2]: 'script_dir'",
            "2: configparser.ParsingError: Source contains parsing errors: 'setup.cfg'",
        ),
        (
            "DuplicateOptionError: While reading from 'setup.cfg' [line  3]: option 'a' in "
            "section 'b' already exists",
            "3: configparser.DuplicateOptionError: While reading from 'setup.cfg' [line  3]: "
            "option 'a' in section 'b' already exists",
        ),
    ],
    ids=["BOM", "bracket", "no value", "twice"],
)
def test_setup_cfg_is_blamed_for_what_is_wrong_in_it_and_not_setup_py(
    error: str, said: str
) -> None:
    sources = replace(SOURCES, files={*FILES, "src/bot/setup.cfg"})
    log = f"{READS_CONFIG}configparser.{error}\n"
    assert str(find_build_error(log, ("bot",), sources)) == f"src/bot/setup.cfg:{said}"
    # Without one of its own it is setup.py that reads something else.
    assert culprit(log).startswith("src/bot/setup.py:7: configparser.")


def test_a_syntax_error_in_setup_py_is_blamed_with_its_line() -> None:
    log = (
        f'Starting >>> bot\n{RUN_SETUP}  File "<string>", line 7\n'
        "    version='0.0.0'\n            ^^^^^^\nSyntaxError: invalid syntax\n"
    )
    assert culprit(log) == "src/bot/setup.py:7: SyntaxError: invalid syntax"


def test_of_a_traceback_the_deepest_frame_of_the_student_is_blamed() -> None:
    log = """\
        Starting >>> bot
        Traceback (most recent call last):
          File "src/bot/setup.py", line 3, in <module>
            import bot.node
          File "src/bot/bot/node.py", line 9, in <module>
            open("x")
          File "/usr/lib/python3.12/somewhere.py", line 1, in inner
        FileNotFoundError: [Errno 2] No such file or directory: 'x'
    """
    assert culprit(log) == (
        "src/bot/bot/node.py:9: FileNotFoundError: [Errno 2] No such file or directory: 'x'"
    )


def test_tracebacks_of_colcon_blame_nobody() -> None:
    log = """\
        Starting >>> bot
        Traceback (most recent call last):
          File "/venv/colcon_core/executor/__init__.py", line 91, in __call__
            rc = await self.task(*args, **kwargs)
        subprocess.CalledProcessError: Command returned non-zero exit status 1.
    """
    assert culprit(log) == "None"


def test_a_missing_setup_py_is_told() -> None:
    log = """\
        Starting >>> bot
        AssertionError: Expected [...]: python: can't open file '/s/src/bot/setup.py': [Errno 2]
    """
    assert culprit(log) == "src/bot/setup.py: there is no setup.py"


def test_what_setuptools_complains_of_is_found_in_setup_py() -> None:
    log = "Starting >>> bot\nerror: package directory 'resource/' does not exist\n"
    found = culprit(log)
    assert found == "src/bot/setup.py:10: package directory 'resource/' does not exist"
    log = "Starting >>> bot\nerror: can't copy 'resource/bot': doesn't exist\n"
    assert culprit(log) == "src/bot/setup.py: can't copy 'resource/bot': doesn't exist"


NEVER_CALLED = (
    f"Starting >>> bot\n{RUN_SETUP}RuntimeError: 'distutils.core.setup()' was never called\n"
)


def test_a_setup_that_setuptools_refuses_is_explained_by_its_entry_points() -> None:
    malformed = {"bot": (SourceError("src/bot/setup.py", 20, "the entry point 'x' is bad"),)}
    sources = Sources(FILES, SOURCES.folders, SOURCES.texts, malformed)
    assert (
        culprit(NEVER_CALLED, sources=sources) == "src/bot/setup.py:20: the entry point 'x' is bad"
    )


def test_a_setup_that_is_never_called_is_told() -> None:
    assert culprit(NEVER_CALLED) == (
        "src/bot/setup.py: setup() is never called, or refuses its arguments"
    )


def test_a_setup_py_that_crashes_is_told() -> None:
    log = "Starting >>> bot\nCommand '['python', 'setup.py']' died with <Signals.SIGSEGV: 11>.\n"
    assert culprit(log) == "src/bot/setup.py: setup.py died with SIGSEGV"


def test_data_files_in_absolute_places_are_told() -> None:
    log = """\
        Starting >>> bot
        Traceback (most recent call last):
          File "/venv/colcon_core/task/python/__init__.py", line 38, in get_data_files_mapping
            assert not os.path.isabs(dest)
        AssertionError
    """
    assert "data_files names an absolute folder" in culprit(log)


def test_a_setup_py_that_prints_is_told() -> None:
    log = """\
        Starting >>> bot
        Traceback (most recent call last):
          File "/venv/colcon_python_setup_py/python_setup_py.py", line 301, in _get_setup
            return ast.literal_eval(output)
          File "<unknown>", line 1
            Hello
        SyntaxError: invalid syntax
    """
    assert culprit(log).startswith("src/bot/setup.py: setup.py prints something")


def test_while_colcon_looks_for_packages_the_folder_comes_after_the_traceback() -> None:
    log = (
        f'{RUN_SETUP}  File "<string>", line 1, in <module>\nZeroDivisionError: division by zero\n'
        "ERROR:colcon.colcon_core.package_identification:Exception in package identification "
        "extension 'python_setup_py' in 'src/bot': Command returned 1\nStarting >>> c\n"
    )
    assert culprit(log, "bot") == "src/bot/setup.py:1: ZeroDivisionError: division by zero"


def test_a_package_that_was_finished_is_not_to_blame() -> None:
    log = """\
        Starting >>> bot
          File "install/lib/python3.11/site-packages/bot/node.py", line 1
            def main(:
                     ^
        SyntaxError: invalid syntax
        Finished <<< bot
        Starting >>> c
        src/c/src/x.cpp:2:9: error: 'foo' was not declared in this scope
    """
    assert culprit(log, "c") == "src/c/src/x.cpp:2: 'foo' was not declared in this scope"
    assert culprit(log, "bot") == "src/bot/bot/node.py:1: SyntaxError: invalid syntax"


def test_an_error_of_cmake_is_blamed_with_its_first_paragraph() -> None:
    log = """\
        Starting >>> c
        CMake Error at CMakeLists.txt:4 (ament_packag):
          Unknown CMake command
          "ament_packag".


        -- Configuring incomplete, errors occurred!
    """
    assert culprit(log) == 'src/c/CMakeLists.txt:4: Unknown CMake command "ament_packag".'


def test_a_parse_error_of_cmake_has_no_command() -> None:
    log = "Starting >>> c\nCMake Error at CMakeLists.txt:4:\n  Parse error.  End of file reached.\n"
    assert culprit(log) == "src/c/CMakeLists.txt:4: Parse error.  End of file reached."


def test_an_error_inside_of_ros_is_blamed_on_who_called_it() -> None:
    log = """\
        Starting >>> c
        CMake Error at /opt/ros/jazzy/share/x/cmake/x.cmake:95 (message):
          x() was called without a name
        Call Stack (most recent call first):
          /opt/ros/jazzy/share/x/cmake/y.cmake:63 (x)
          CMakeLists.txt:5 (y)
    """
    assert culprit(log) == "src/c/CMakeLists.txt:5: x() was called without a name"


def test_a_wrong_message_definition_is_blamed_itself() -> None:
    log = """\
        Starting >>> c
        CMake Error at /opt/ros/share/rosidl_adapter/cmake/adapt.cmake:57 (message):
          execute_process(python3 -m rosidl_adapter) returned error code 1:

            Traceback (most recent call last):
              File "/opt/ros/rosidl_adapter/parser.py", line 206, in __init__

          rosidl_adapter.parser.InvalidResourceName: 'unit8' is an invalid message
          name.

        Call Stack (most recent call first):
          CMakeLists.txt:5 (rosidl_generate_interfaces)
    """
    assert culprit(log) == (
        "src/c/msg/Bot.msg:2: rosidl_adapter.parser.InvalidResourceName: "
        "'unit8' is an invalid message name."
    )


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (FILES | {"src/c/setup.py"}, "names no <build_type>; a Python package has ament_python"),
        (FILES, "there is no CMakeLists.txt beside it"),
    ],
)
def test_a_wrong_build_type_is_blamed_on_package_xml(files: set[str], message: str) -> None:
    log = 'Starting >>> c\nCMake Error: The source "c" does not appear to contain CMakeLists.txt.\n'
    found = culprit(log, sources=Sources(files, SOURCES.folders))
    assert found.startswith(f"src/c/package.xml: {message}")


def test_a_manifest_that_ament_refuses_is_blamed_with_the_line_that_we_know() -> None:
    log = """\
        Starting >>> c
        catkin_pkg.package.InvalidPackage: Error(s) in package 'src/c/package.xml':
        Invalid email "a@b.c" for person "Ada"
    """
    assert culprit(log) == 'src/c/package.xml: Invalid email "a@b.c" for person "Ada"'
    error = SourceError("src/c/package.xml", 6, "Invalid email")
    sources = Sources(FILES, SOURCES.folders, manifest_errors={error.file: error})
    assert culprit(log, sources=sources) == "src/c/package.xml:6: Invalid email"


def test_a_message_is_printable_and_not_endless() -> None:
    log = f"Starting >>> bot\nerror: \x1b[31m{'x' * 10_000}\n"
    found = find_build_error(log, ("bot",), SOURCES)
    assert found is not None
    assert found.message.isprintable()
    assert len(found.message) == 500


def test_a_log_that_quotes_thousands_of_names_is_read_at_once() -> None:
    texts = {"src/bot/setup.py": ["x"] * 100_000}
    quoted = " ".join(f"'a{number}'" for number in range(10_000))
    found = find_build_error(
        f"Starting >>> bot\nerror: {quoted}\n", ("bot",), Sources(FILES, SOURCES.folders, texts)
    )
    assert found is not None
    assert (found.file, found.line) == ("src/bot/setup.py", None)
    assert find_build_error(f"Starting >>> bot\n{'setup.py' * 16_000}\n", ("bot",), SOURCES) is None


def test_where_nothing_is_said_the_package_that_was_being_built_is_named() -> None:
    log = "Starting >>> bot\nFinished <<< bot\nStarting >>> c\n"
    assert str(last_started(log, SOURCES, "too late")) == "src/c/CMakeLists.txt: too late"
    assert last_started("", SOURCES, "too late") is None


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("the robot is not there", "the robot is not there"),
        (
            "/usr/bin/ld: x.o: undefined reference to `drive'\ncollect2: error: ld returned 1",
            "/usr/bin/ld: x.o: undefined reference to `drive'",
        ),
        ("", "it says nothing"),
    ],
)
def test_where_no_file_is_blamed_the_log_s_own_words_are_shown(said: str, words: str) -> None:
    log = (
        f"Starting >>> c\n--- stderr: c\n{said}\n"
        "gmake[1]: *** [CMakeFiles/Makefile2:183: all] Error 2\n---\n"
        "Failed   <<< c [0.5s, exited with code 2]\n"
    )
    assert str(last_started(log, SOURCES, None)) == f"src/c/CMakeLists.txt: {words}"
