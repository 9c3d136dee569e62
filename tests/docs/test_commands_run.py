"""Commands of the pages run as they are printed, one after the other, in the folder of the pages.

What is not run here is named in ``ELSEWHERE`` with the reason; ``test_commands`` still sees that
the command exists and has the options.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from grader.assignment.changed_reference import apply
from grader.assignment.load import load_assignment
from grader.assignment.mutant_file import load_mutants
from grader.dev.demo import ASSIGNMENT, BROKEN
from grader.machine import resources

ROOT = resources.root()
# They are followed step by step in tests of their own.
WALKED = {"tutorial.md", "own-checks.md", "contributing.md"}
# Those that make what the others take for given come first.
FIRST = ["docs/students.md", "docs/instructors.md", "README.md"]
REST = [
    str(page.relative_to(ROOT))
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if "reference" not in page.parts and page.name not in WALKED
]
PAGES = list(dict.fromkeys([*FIRST, *REST]))
FENCE = re.compile(r"^```console\n(.*?)^```", re.DOTALL | re.MULTILINE)
ELSEWHERE = {
    r"rosgrade (watch|review|sim) ": "runs until Ctrl-C",
    r"rosgrade (underlay (add|remove|export|import)|export .*--underlays)": (
        "fetches from github.com and compiles, or needs what was compiled"
    ),
    r"rosgrade selftest": "takes minutes; each assignment has a test of it",
    r"rosgrade replay": "runs until the recording ends; has its own tests",
    r"rosgrade check .*--sandbox bwrap": "the machine may have no sandbox",
    r"rosgrade .*(--cpp|--scheduler|my_other_lesson)": "needs a compiler, a cluster, a lesson",
    r"(?!rosgrade )": "is no command of rosgrade",
}
ROSTER = "id,name,login,email\n1,Ana Abe,ana,ana@example.org\n2,Ben Boll,ben,ben@example.org\n"
GRADEBOOK = """\
Student,ID,SIS User ID,SIS Login ID,Section,ROS 2 publisher (7)
    Points Possible,,,,,10
"Abe, Ana",1,1,ana,Sec 1,
"Boll, Ben",2,2,ben,Sec 1,
"""


def commands(page: str) -> list[str]:
    """Lines after a prompt in sessions, and bare ones as in the README."""
    blocks = FENCE.findall((ROOT / page).read_text(encoding="utf-8"))
    lines = [line for block in blocks for line in block.splitlines()]
    prompted = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
    bare = [line for line in lines if line.startswith("rosgrade ")]
    return [re.split(r"\s+# ", line)[0].strip() for line in (*prompted, *bare)]


def block(page: str, language: str, containing: str) -> str:
    found = re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    return next(text for text in found if containing in text)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A clone, a home with a workspace, and a class, as the pages take for given."""
    clone = tmp_path / "clone"
    clone.mkdir()
    for item in ("assignments", "docs", "reference", "tests"):
        (clone / item).symlink_to(ROOT / item)
    loaded = load_assignment(ASSIGNMENT)
    mutants = load_mutants(loaded.assignment, loaded.folder)
    broken = clone / "rosgrade-report" / "broken-submission"
    apply(next(one for one in mutants.mutants if one.id == BROKEN), mutants.reference, broken)
    shutil.copytree(mutants.reference, clone / "submissions" / "ana")
    shutil.copytree(broken, clone / "submissions" / "ben")
    (clone / "roster.csv").write_text(ROSTER)
    (clone / "gradebook.csv").write_text(GRADEBOOK)
    (clone / "course.yaml").write_text(block("docs/course.md", "yaml", "extensions:"))
    (tmp_path / "home" / "ros2_ws" / "src").mkdir(parents=True)
    return clone


@pytest.mark.ros
@pytest.mark.slow
def test_every_command_runs_as_printed(folder: Path) -> None:
    venv = Path(sys.executable).parent
    environment = {
        **os.environ,
        "HOME": str(folder.parent / "home"),
        "PATH": f"{venv}:{os.environ['PATH']}",
        "XDG_CACHE_HOME": str(resources.cache_folder().parent),
        "PYTHONPATH": str(ROOT),
    }
    unused, done, failed = dict(ELSEWHERE), set(), []
    for page in PAGES:
        for line in commands(page):
            reasons = [one for one in ELSEWHERE if re.match(one, line)]
            for one in reasons:
                unused.pop(one, None)
            # Graded once: a report somewhere else or an opened browser changes nothing.
            plain = re.sub(r" --(open|report \S+|sandbox auto|sandbox none)\b", "", line)
            if reasons or plain in done:
                continue
            done.add(plain)
            ended = subprocess.run(
                ["bash", "-c", plain.replace("rosgrade ", f"{sys.executable} -m grader ", 1)],
                # `.` is a student's repository.
                cwd=folder / "submissions" / "ana" if " . " in plain else folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=1200,
                check=False,
            )
            # A submission may lose points, and a class may have students without one.
            well = (0, 1) if plain.startswith("rosgrade check") else (0,)
            if ended.returncode not in well:
                failed.append(f"{page}: $ {line}\n{ended.returncode}\n{ended.stdout[-1500:]}")
    assert not failed, "\n\n".join(failed)
    assert len(done) > 30
    assert not unused, "nothing is like this any more"
