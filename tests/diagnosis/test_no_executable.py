"""Why `ros2 run` finds no executable: setup.py, setup.cfg or CMakeLists.txt."""

import pytest

from grader.diagnosis.no_executable import why_no_executable
from grader.recording.submission import SourceError
from tests.checks.builder import package, submission

FOLDER = "$base/lib/bot_publisher"
TARGET = SourceError("src/bot_publisher/setup.py", 22, "no function `main` in node.py")
NO_INIT = "bot_publisher/node.py is not installed: there is no bot_publisher/__init__.py"
CMAKE = {"build_type": "ament_cmake", "entry_points": ()}
LINE = "install(TARGETS bot_pub DESTINATION lib/${PROJECT_NAME})"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"missing_targets": (("bot_pub", TARGET),)},
            "bot_publisher.node:main` does not work",
        ),
        ({"missing_targets": (("bot_pub", TARGET),)}, "work: src/bot_publisher/setup.py:22"),
        (
            {"missing_targets": (("bot_pub", SourceError("setup.py", 22, NO_INIT)),)},
            "find_packages() in setup.py leaves out a folder without",
        ),
        ({"misplaced_executables": ("bot_pub",)}, "was installed in bin/, where `ros2 run` does"),
        (
            {"misplaced_executables": ("bot_pub",)},
            f"[develop] / script_dir={FOLDER} / [install] / install_scripts={FOLDER}",
        ),
        ({"entry_points": (("bot_publisher", "x:main"),)}, "setup.py defines `bot_publisher`"),
        ({"entry_points": (("bot_publisher", "x:main"),)}, "'bot_pub = ...'"),
        ({"entry_points": ()}, "setup.py defines no console_scripts"),
        ({"entry_points": ()}, "'bot_pub = bot_publisher.<your module>:main'"),
        ({}, "the build did not install it"),
        ({**CMAKE, "executables": ("x", "y")}, "installed `x` and `y`"),
        (CMAKE, "installed no executable"),
        (CMAKE, f"`{LINE}` (of a Python script only install(PROGRAMS"),
        ({**CMAKE, "misplaced_executables": ("bot_pub",)}, "bin/, where `ros2 run` does not look"),
        (
            {**CMAKE, "executables": ("bot_pub",), "registered": False},
            "`ament_package()` as its last",
        ),
    ],
)
def test_what_is_wrong_is_reported_with_what_to_write(changes, words):
    record = submission(package(**{"executables": (), **changes}))
    cause = why_no_executable(record, "bot_publisher", "bot_pub")
    assert words in f"{cause.observed} | {cause.hint}"
