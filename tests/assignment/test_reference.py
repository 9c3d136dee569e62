"""validate looks up in the reference solution what the YAML says of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from grader.assignment.load import load_assignment
from grader.assignment.reference import reference_problems
from tests.assignment.lessons import GOOD

MANIFEST = "<package format='3'><name>bot</name></package>"
SETUP = "setup(name='bot', entry_points={'console_scripts': ['bot_pub = bot.node:main']})"


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"package.xml": MANIFEST, "setup.py": SETUP}, []),
        (
            {"package.xml": MANIFEST, "setup.py": SETUP.replace("bot_pub", "bot_pup")},
            [
                "6: packages[0].executables[0]: the reference solution has no executable "
                "'bot_pub' in setup.py. Did you mean 'bot_pup'?"
            ],
        ),
        ({"package.xml": MANIFEST, "CMakeLists.txt": "install(PROGRAMS bot_pub)"}, []),
        (
            {"package.xml": MANIFEST.replace("bot", "bott"), "setup.py": SETUP},
            [
                "5: packages[0].name: the reference solution has no package 'bot'. "
                "Did you mean 'bott'?"
            ],
        ),
    ],
    ids=["as it is", "other script", "cmake", "other package"],
)
def test_a_package_or_executable_that_the_reference_lacks_is_told_with_its_line(
    write: Callable[..., Path], files: dict[str, str], said: list[str]
) -> None:
    folder = write(GOOD)
    (folder / "reference" / "bot").mkdir(parents=True)
    for name, text in files.items():
        (folder / "reference" / "bot" / name).write_text(text)
    problems = reference_problems(load_assignment(folder))
    assert [f"{one.line}: {one.where}: {one.message}" for one in problems] == said
