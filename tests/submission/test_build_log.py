from grader.submission.build.build_log import MAX_BYTES, clean, ending, folded, own_lines


def test_colours_and_control_characters_are_gone() -> None:
    log = "\x1b[31merror\x1b[0m \x1b]0;title\x07here\x08\x00\tand\r\nthere\n"
    assert clean(log, {}) == "error here\tand\nthere\n"


def test_scratch_paths_are_the_students_again() -> None:
    paths = {"/tmp/r/submission": "", "/tmp/r/scratch/build": "build", "/tmp/r/scratch": "scratch"}
    log = 'File "/tmp/r/submission/src/setup.py"\nin /tmp/r/submission\n/tmp/r/scratch/build/b\n'
    assert clean(log, paths) == 'File "src/setup.py"\nin .\nbuild/b\n'


def test_a_warning_about_our_own_installation_is_left_out() -> None:
    warning = (
        "WARNING:colcon.colcon_ros.prefix_path.ament:The path '/x' in the environment variable "
        "AMENT_PREFIX_PATH doesn't contain any 'local_setup.*' files.\n"
    )
    assert clean(f"a\n{warning}b\n", {}) == "a\nb\n"


def test_long_lines_that_nearly_match_are_read_at_once() -> None:
    path = "../" * 40_000
    assert clean(path, {}) == path
    warning = "WARNING:colcon.colcon_ros.prefix_path.ament:The path x"
    assert clean(warning + " doesn't contain any " * 6000, {}) == ""


def test_of_a_long_log_the_end_is_kept_in_whole_lines() -> None:
    log = "".join(f"line {number} größer\n" for number in range(10_000))
    kept = ending(log)
    assert len(kept.encode()) <= MAX_BYTES
    assert kept.startswith("line ")
    assert log.endswith(kept)
    assert ending("short\n") == "short\n"


def test_what_colcon_says_begins_a_line_of_its_own() -> None:
    log = "Starting >>> a\ndoneFinished <<< a [0.1s]\nFailed   <<< Failed   <<< b [0.2s, exited\n"
    assert own_lines(log) == (
        "Starting >>> a\ndone\nFinished <<< a [0.1s]\nFailed   <<< \nFailed   <<< b [0.2s, exited\n"
    )
    assert own_lines(own_lines(log)) == own_lines(log)


WARNED = """\
Starting >>> bot
CMake Warning at /opt/ros/jazzy/share/tracetools/cmake/extras.cmake:116 (message):
  Package 'tracetools' exports library 'lttng-ust' which couldn't be found
Call Stack (most recent call first):
  /opt/ros/jazzy/share/rclcpp/cmake/rclcppConfig.cmake:41 (include)
  CMakeLists.txt:4 (find_package)


CMake Warning (dev) at /usr/share/cmake/Modules/FindPackage.cmake:438 (message):
  The package name passed does not match.
This warning is for project developers.  Use -Wno-dev to suppress it.

CMake Warning at CMakeLists.txt:3 (message):
  my own
CMake Error at /opt/ros/jazzy/share/ament_cmake/target.cmake:77 (message):
  ament_target_dependencies() the passed package name 'x' was not found before
Call Stack (most recent call first):
  /opt/ros/jazzy/share/ament_cmake/other.cmake:9 (inner)
  CMakeLists.txt:5 (ament_target_dependencies)


-- Configuring incomplete, errors occurred!
"""


def test_nothing_of_others_stands_above_the_students_own_error() -> None:
    assert folded(WARNED).splitlines() == [
        "Starting >>> bot",
        "CMake Warning at CMakeLists.txt:3 (message):",
        "  my own",
        "CMake Error at /opt/ros/jazzy/share/ament_cmake/target.cmake:77 (message):",
        "  ament_target_dependencies() the passed package name 'x' was not found before",
        "Call Stack (most recent call first):",
        "  CMakeLists.txt:5 (ament_target_dependencies)",
        "",
        "",
        "-- Configuring incomplete, errors occurred!",
    ]
