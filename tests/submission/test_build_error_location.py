"""Logs as colcon 0.18 to 0.21 writes them, cut to what matters."""

from __future__ import annotations

from textwrap import dedent

import pytest

from grader.submission.build.build_error_location import Sources, find_build_error, last_started

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
    texts={"src/c/msg/Bot.msg": ["uint8 model", "unit8 x"]},
)
RUN_SETUP = """\
Traceback (most recent call last):
  File "<string>", line 1, in <module>
  File "/venv/setuptools/_distutils/core.py", line 267, in run_setup
    exec(code, g)
"""


def culprit(log: str, *failed: str, sources: Sources = SOURCES) -> str:
    return str(find_build_error(dedent(log), failed or ("bot", "c"), sources))


LOGS = {
    "setup.py raises": (
        f'Starting >>> bot\n{RUN_SETUP}  File "<string>", line 5, in <module>\nValueError: boom\n',
        "src/bot/setup.py:5: ValueError: boom",
    ),
    "syntax of setup.py": (
        f'Starting >>> bot\n{RUN_SETUP}  File "<string>", line 7\n'
        "    version='0.0.0'\n            ^^^^^^\nSyntaxError: invalid syntax\n",
        "src/bot/setup.py:7: SyntaxError: invalid syntax",
    ),
    "deepest frame": (
        """\
        Starting >>> bot
        Traceback (most recent call last):
          File "src/bot/setup.py", line 3, in <module>
            import bot.node
          File "src/bot/bot/node.py", line 9, in <module>
            open("x")
          File "/usr/lib/python3.12/somewhere.py", line 1, in inner
        FileNotFoundError: [Errno 2] No such file or directory: 'x'
        """,
        "src/bot/bot/node.py:9: FileNotFoundError: [Errno 2] No such file or directory: 'x'",
    ),
    "colcon's own traceback": (
        """\
        Starting >>> bot
        Traceback (most recent call last):
          File "/venv/colcon_core/executor/__init__.py", line 91, in __call__
            rc = await self.task(*args, **kwargs)
        subprocess.CalledProcessError: Command returned non-zero exit status 1.
        """,
        "None",
    ),
    "no setup.py": (
        """\
        Starting >>> bot
        AssertionError: Expected [...]: python: can't open file '/s/src/bot/setup.py': [Errno 2]
        """,
        "src/bot/setup.py: there is no setup.py",
    ),
    "setuptools": (
        "Starting >>> bot\nerror: can't copy 'resource/bot': doesn't exist\n",
        "src/bot/setup.py: can't copy 'resource/bot': doesn't exist",
    ),
    "CMake": (
        """\
        Starting >>> c
        CMake Error at CMakeLists.txt:4 (ament_packag):
          Unknown CMake command
          "ament_packag".


        -- Configuring incomplete, errors occurred!
        """,
        'src/c/CMakeLists.txt:4: Unknown CMake command "ament_packag".',
    ),
    "CMake's parser": (
        "Starting >>> c\nCMake Error at CMakeLists.txt:4:\n  Parse error.  End of file reached.\n",
        "src/c/CMakeLists.txt:4: Parse error.  End of file reached.",
    ),
    "CMake inside of ROS": (
        """\
        Starting >>> c
        CMake Error at /opt/ros/jazzy/share/x/cmake/x.cmake:95 (message):
          x() was called without a name
        Call Stack (most recent call first):
          /opt/ros/jazzy/share/x/cmake/y.cmake:63 (x)
          CMakeLists.txt:5 (y)
        """,
        "src/c/CMakeLists.txt:5: x() was called without a name",
    ),
    "interface": (
        """\
        Starting >>> c
        CMake Error at /opt/ros/share/rosidl_adapter/cmake/adapt.cmake:57 (message):
          execute_process(python3 -m rosidl_adapter) returned error code 1:

            Traceback (most recent call last):
              File "/opt/ros/rosidl_adapter/parser.py", line 206, in __init__

          rosidl_adapter.parser.InvalidResourceName: 'unit8' is an invalid message
          name.

        Call Stack (most recent call first):
          CMakeLists.txt:5 (rosidl_generate_interfaces)
        """,
        "src/c/msg/Bot.msg:2: rosidl_adapter.parser.InvalidResourceName: "
        "'unit8' is an invalid message name.",
    ),
    "no CMakeLists.txt": (
        'Starting >>> c\nCMake Error: The source "c" does not appear to contain CMakeLists.txt.\n',
        "src/c/package.xml: there is no CMakeLists.txt beside it, which this build type needs",
    ),
    "no build type": (
        'Starting >>> bot\nCMake Error: "bot" does not appear to contain CMakeLists.txt.\n',
        "src/bot/package.xml: names no <build_type>; a Python package has ament_python in its "
        "<export>",
    ),
    "package.xml": (
        """\
        Starting >>> c
        catkin_pkg.package.InvalidPackage: Error(s) in package 'src/c/package.xml':
        Invalid email "a@b.c" for person "Ada"
        """,
        'src/c/package.xml: Invalid email "a@b.c" for person "Ada"',
    ),
    "a template of others, gcc": (
        """\
        Starting >>> c
        In file included from src/c/src/x.cpp:2:
        /usr/include/c++/12/functional: In instantiation of ‘struct std::_Bind_check_arity<void (B::*)(int), B*>’:
        /usr/include/c++/12/functional:836:12:   required from ‘struct std::_Bind_helper<false, void (B::*)(int), B*>’
        src/c/src/x.cpp:16:83:   required from here
        /usr/include/c++/12/functional:820:21: error: static assertion failed: Wrong number of arguments
        """,  # noqa: E501
        "src/c/src/x.cpp:16: static assertion failed: Wrong number of arguments",
    ),
    "a template of others, clang": (
        """\
        Starting >>> c
        In file included from src/c/src/x.cpp:2:
        /usr/include/c++/12/bits/stl_construct.h:119:25: error: no matching constructor for 'B'
              ::new((void*)__p) _Tp(std::forward<_Args>(__args)...);
        /usr/include/c++/12/bits/alloc_traits.h:518:4: note: in instantiation of function template specialization 'std::_Construct<B, int>' requested here
        src/c/src/x.cpp:35:21: note: in instantiation of function template specialization 'std::make_shared<B, int>' requested here
        src/c/src/x.cpp:40:1: error: unknown type name 'foo'
        """,  # noqa: E501
        "src/c/src/x.cpp:35: no matching constructor for 'B'",
    ),
    "a header of others": (
        """\
        Starting >>> c
        In file included from src/c/src/x.cpp:6:
        /opt/ros/jazzy/include/a/c.hpp:9:2: error: #error Define A
        """,
        "src/c/src/x.cpp:6: #error Define A",
    ),
    "linker": (
        """\
        Starting >>> c
        /usr/bin/ld: CMakeFiles/x.dir/src/x.cpp.o: in function `main':
        src/c/src/x.cpp:6: undefined reference to `drive()'
        collect2: error: ld returned 1 exit status
        """,
        "src/c/src/x.cpp:6: undefined reference to `drive()'",
    ),
    "linker, without lines": (
        """\
        Starting >>> c
        /usr/bin/ld: CMakeFiles/x.dir/src/x.cpp.o: in function `main':
        x.cpp:(.text+0x9): undefined reference to `drive()'
        """,
        "src/c/CMakeLists.txt: undefined reference to `drive()'",
    ),
    "no main": (
        """\
        Starting >>> c
        /usr/bin/ld: /usr/lib/gcc/x86_64-linux-gnu/12/../../../x86_64-linux-gnu/Scrt1.o: in function `_start':
        (.text+0x17): undefined reference to `main'
        """,  # noqa: E501
        "src/c/CMakeLists.txt: undefined reference to `main'",
    ),
    "twice": (
        """\
        Starting >>> c
        /usr/bin/ld: CMakeFiles/x.dir/src/x.cpp.o: in function `drive()':
        src/c/src/x.cpp:2: multiple definition of `drive()'; CMakeFiles/x.dir/src/b.cpp.o:b.cpp:2: first defined here
        """,  # noqa: E501
        "src/c/src/x.cpp:2: multiple definition of `drive()'; "
        "CMakeFiles/x.dir/src/b.cpp.o:b.cpp:2: first defined here",
    ),
    "a message of CMake in parts": (
        """\
        Starting >>> c
        CMake Error at CMakeLists.txt:11 (target_link_libraries):
          Target "x" links to:

            geometry_msgs::geometry_msgs

          but the target was not found.  Possible reasons include:

            * There is a typo in the target name.
        """,
        'src/c/CMakeLists.txt:11: Target "x" links to: geometry_msgs::geometry_msgs '
        "but the target was not found.  Possible reasons include:",
    ),
    "install": (
        """\
        Starting >>> c
        CMake Error at cmake_install.cmake:66 (file):
          file INSTALL cannot find "src/c/launch": No such file or directory.
        """,
        'src/c/CMakeLists.txt: file INSTALL cannot find "src/c/launch": No such file or directory.',
    ),
}


@pytest.mark.parametrize(("log", "found"), LOGS.values(), ids=LOGS.keys())
def test_the_first_place_that_a_log_names_is_found(log: str, found: str) -> None:
    assert culprit(log) == found


def test_a_package_that_was_finished_is_no_reason() -> None:
    log = """\
        Starting >>> bot
        error: a warning, in fact
        Finished <<< bot
        Starting >>> c
        src/c/src/x.cpp:2:9: error: 'foo' was not declared in this scope
    """
    assert culprit(log, "c") == "src/c/src/x.cpp:2: 'foo' was not declared in this scope"
    assert culprit(log, "bot") == "src/bot/setup.py: a warning, in fact"


def test_a_message_is_printable_and_not_endless() -> None:
    log = f"Starting >>> bot\nerror: \x1b[31m{'x' * 10_000}\n"
    found = find_build_error(log, ("bot",), SOURCES)
    assert found is not None
    assert found.message.isprintable()
    assert len(found.message) == 500


def test_a_log_that_quotes_thousands_of_names_is_read_at_once() -> None:
    texts = {"src/c/msg/Bot.msg": ["x"] * 100_000}
    quoted = " ".join(f"'a{number}'" for number in range(10_000))
    log = f"{LOGS['interface'][0]}".replace("'unit8'", quoted)
    assert culprit(log, sources=Sources(FILES, SOURCES.folders, texts)).startswith(
        "src/c/CMakeLists.txt:5: rosidl_adapter.parser.InvalidResourceName: 'a0' 'a1'"
    )
    assert find_build_error(f"Starting >>> bot\n{'setup.py' * 16_000}\n", ("bot",), SOURCES) is None


def test_without_a_message_the_package_that_was_being_built_is_named() -> None:
    log = "Starting >>> bot\nFinished <<< bot\nStarting >>> c\n"
    assert str(last_started(log, SOURCES, "too late")) == "src/c/CMakeLists.txt: too late"
    assert last_started("", SOURCES, "too late") is None


def test_where_a_compiler_is_ended_its_file_is_named() -> None:
    log = "Starting >>> c\n[ 50%] Building CXX object CMakeFiles/x.dir/src/x.cpp.o\n"
    assert str(last_started(log, SOURCES, "too much")) == "src/c/src/x.cpp: too much"
    assert str(last_started(log, SOURCES, None)).startswith("src/c/CMakeLists.txt: ")


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("the robot is not there", "the robot is not there"),
        (
            "/usr/bin/ld: x.o: undefined reference to `drive'\ncollect2: error: ld returned 1",
            "/usr/bin/ld: x.o: undefined reference to `drive'",
        ),
        (
            "Traceback (most recent call last):\n"
            "RuntimeError: 'distutils.core.setup()' was never called\n"
            "subprocess.CalledProcessError: Command '[...]' failed",
            "RuntimeError: 'distutils.core.setup()' was never called",
        ),
        ("", "there is no error message"),
    ],
)
def test_where_no_file_is_blamed_the_log_s_own_words_are_shown(said: str, words: str) -> None:
    log = (
        f"Starting >>> c\n--- stderr: c\n{said}\n"
        "gmake[1]: *** [CMakeFiles/Makefile2:183: all] Error 2\n---\n"
        "Failed   <<< c [0.5s, exited with code 2]\nCommand 'c' ended with an error\n"
    )
    assert str(last_started(log, SOURCES, None)) == f"src/c/CMakeLists.txt: {words}"
