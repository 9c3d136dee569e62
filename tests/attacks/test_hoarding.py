"""Limits that all processes of a user share: a submission that hoards takes nothing from others.

The class is graded as most shells start things, with 1024 open files; as root besides, where it
can, as an ordinary user.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from grader.report.model.result import grade_json
from grader.sandbox.sandbox import Sandbox
from tests.attacks.attack import Attack
from tests.attacks.test_hostile import ATTACKS, HONEST, grade_class

pytestmark = [pytest.mark.ros, pytest.mark.slow]

OPEN_FILES = 1024
USER = 61_500
NAMES = ("right", "misnamed", "stops_too_early", "crashes", "does_unusual_things", "does_not_build")
HOARDS = {name: attack for name, attack in ATTACKS.items() if "hoards" in name}
HOARDS |= {f"hoards_{number}": ATTACKS["hoards_descriptors_in_flight"] for number in range(4)}
HOARDS |= {"writes_into_the_init": ATTACKS["writes_into_the_init"]}
HOARDS |= {name: attack for name, attack in ATTACKS.items() if name.startswith("is_stopped")}


def bound() -> None:
    resource.setrlimit(resource.RLIMIT_NOFILE, (OPEN_FILES, OPEN_FILES))


def as_a_user(folder: Path) -> list[str]:
    """What to start a program with, so that it does not run as root; empty where it need not."""
    drop = ["setpriv", f"--reuid={USER}", f"--regid={USER}", "--clear-groups"]
    tried = [*drop, sys.executable, "-c", "import os, sys; os.stat(sys.executable)"]
    if os.geteuid() != 0 or subprocess.run(tried, capture_output=True, check=False).returncode:
        return []
    for place in (folder, *folder.parents):
        if place.owner() == "root" and place != Path("/tmp"):
            place.chmod(place.stat().st_mode | 0o055)
        if place.name.startswith("pytest-of"):
            break
    os.chown(folder, USER, USER)
    return drop


Graded = Callable[[dict[str, Attack]], dict[str, str]]


@pytest.fixture(scope="module")
def graded(sandbox: Sandbox, tmp_path_factory: pytest.TempPathFactory) -> Graded:
    def run(members: dict[str, Attack]) -> dict[str, str]:
        folder = tmp_path_factory.mktemp("class")
        command = [*as_a_user(folder), sys.executable, "-m", "tests.attacks.test_hoarding"]
        done = subprocess.run(
            [*command, str(folder), *members],
            preexec_fn=bound,
            env={**os.environ, "HOME": str(folder)},
            cwd=Path(__file__).parents[2],
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
        )
        assert done.returncode == 0, done.stderr
        found: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
        return found

    return run


def test_six_honest_grades_are_the_same_bits_beside_submissions_that_hoard(graded: Graded) -> None:
    honest = {name: HONEST[name] for name in NAMES}
    calm = graded(honest)
    beside = graded({**honest, **HOARDS})
    for name in NAMES:
        assert beside[name] == calm[name]
    for name, attack in HOARDS.items():
        assert all(text in beside[name] for text in attack.named), (name, beside[name])


def main(folder: str, *names: str) -> None:
    """Grade some of the submissions, and print what came of each."""
    known = {**HONEST, **HOARDS}
    handed = grade_class(Path(folder, "graded"), {name: known[name] for name in names})
    told = {
        name: grade_json(one.result) if name in HONEST else one.told for name, one in handed.items()
    }
    print(json.dumps(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
