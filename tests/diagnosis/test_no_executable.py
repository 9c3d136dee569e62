"""Why `ros2 run` finds no executable: setup.py, setup.cfg, CMakeLists.txt or another package.

Among others built_and_not_installed and not_registered.
"""

import pytest

from grader.diagnosis.no_executable import why_no_executable
from grader.submission.record import SourceError
from tests.checks.builder import package, submission

FOLDER = "$base/lib/bot_publisher"
TARGET = SourceError("src/bot_publisher/setup.py", 22, "no function `main` in node.py")
NO_INIT = "bot_publisher/node.py is not installed: there is no bot_publisher/__init__.py"
CMAKE = {"build_type": "ament_cmake", "entry_points": ()}
BUILT = "add_executable(bot_pub src/a.cpp)\n"
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
        ({**CMAKE, "executables": ("bot_publ",)}, "installed `bot_publ`"),
        ({**CMAKE, "executables": ("x", "y")}, "installed `x` and `y`"),
        (CMAKE, "it was not installed"),
        (CMAKE, f"`{LINE}`, or install(PROGRAMS"),
        ({**CMAKE, "cmake": BUILT}, "CMakeLists.txt builds `bot_pub` and does not install it"),
        ({**CMAKE, "cmake": BUILT + LINE.replace("lib", "share")}, "bot_pub` in `share/${PROJECT"),
        (
            {**CMAKE, "cmake": BUILT, "misplaced_executables": ("bot_pub",)},
            f"bin/, where `ros2 run` does not look | CMakeLists.txt needs `{LINE}`.",
        ),
        (
            {**CMAKE, "cmake": BUILT.replace("pub", "p"), "executables": ("bot_p",)},
            "installed `bot_p` | CMakeLists.txt needs `add_executable(bot_pub src/<file>.cpp)` and "
            f"`{LINE}`.",
        ),
        ({**CMAKE, "executables": ("bot_pub",), "registered": False}, "Write `ament_package()` as"),
    ],
)
def test_what_is_wrong_is_reported_with_what_to_write(changes, words):
    record = submission(package(**{"executables": (), **changes}))
    cause = why_no_executable(record, "bot_publisher", "bot_pub")
    assert words in f"{cause.observed} | {cause.hint}"


def test_another_package_of_the_submission_has_it():
    record = submission(package(executables=(), entry_points=()), package("robot"))
    cause = why_no_executable(record, "bot_publisher", "bot_pub")
    assert cause.observed == "it is in the package `robot`: `ros2 run robot bot_pub`"
    assert cause.evidence.places[0].file == "src/robot/setup.py"
