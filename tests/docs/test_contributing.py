"""The walks of docs/contributing.md are followed literally, in a copy of the code."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from grader.dev.house import floors, imports_between_rooms
from grader.machine import resources

ROOT = resources.root()
PAGE = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r'```python title="([^"]+)"\n(.*?)```', PAGE, re.DOTALL))


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The import packages with every file of the walks written into them."""
    folder = tmp_path_factory.mktemp("copy")
    for name in ("grader", "sim", "assignments", "reference", "templates", "tests"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for path, text in FILES.items():
        assert not (folder / path).exists(), f"{path} is there already"
        (folder / path).write_text(text, encoding="utf-8")
    return folder


def rosgrade(copy: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "grader", *arguments],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def python(copy: Path, code: str) -> None:
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    subprocess.run([sys.executable, "-c", code], cwd=copy, env=environment, check=True, timeout=600)


def test_the_map_shows_every_room_of_the_house_and_no_other() -> None:
    on_the_map = re.findall(r"^  (\w+)/ ", PAGE[PAGE.index("\ngrader/\n") :], re.MULTILINE)
    assert sorted(on_the_map) == sorted(imports_between_rooms())


def test_nothing_lies_loose_in_the_house() -> None:
    loose = {file.stem for file in (ROOT / "grader").glob("*.py")}
    assert loose == {"__init__", "__main__", "errors"}
    assert max(floors(imports_between_rooms()).values()) <= 15


def test_the_walks_are_one_file_each() -> None:
    folders = [path.split("/")[1] for path in FILES]
    assert folders == ["checks", "diagnosis", "report", "assignment", "run"]


def test_a_new_check_is_listed_validated_and_judges(copy: Path) -> None:
    assert "messages.newest" in rosgrade(copy, "checks")
    assert "newest message" in rosgrade(copy, "checks", "messages.newest")
    folder = copy / "timed_publisher"
    shutil.copytree(copy / "assignments/timed_publisher", folder, dirs_exist_ok=True)
    yaml = folder / "assignment.yaml"
    entry = "checks:\n  - id: newest\n    uses: messages.newest\n    points: 0\n"
    entry += "    with: {topic: TOPIC, field: linear.x, value: 1.0}\n"
    before = yaml.read_text(encoding="utf-8")
    yaml.write_text(before + entry.replace("TOPIC", "/cmd_vel"), encoding="utf-8")
    assert "valid" in rosgrade(copy, "validate", str(folder))
    python(
        copy,
        "from grader.findings.finding import Status\n"
        "from tests.checks.builder import every, judge, messages, recording\n"
        "sent = recording(messages=messages(every(0.3, 5)))\n"
        "asked = {'topic': '/cmd_vel', 'field': 'linear.x'}\n"
        "assert judge('messages.newest', sent, **asked, value=1.0).status is Status.PASSED\n"
        "assert judge('messages.newest', sent, **asked, value=2.0).status is Status.FAILED\n",
    )


def test_a_new_explanation_is_listed_and_found_without_a_list(copy: Path) -> None:
    assert "logs the message and does not publish it" in rosgrade(copy, "checks", "--explanations")
    python(
        copy,
        "from grader.diagnosis.explanation import explanations\n"
        "from grader.diagnosis.no_messages import NoMessages\n"
        "names = [entry.module.rpartition('.')[2] for entry in explanations()[NoMessages]]\n"
        "general = [entry.is_general for entry in explanations()[NoMessages]]\n"
        "assert names[-2] == 'throttled' and general[-2:] == [False, True], names\n",
    )


def test_a_new_output_format_is_an_option(copy: Path) -> None:
    assert "--points" in rosgrade(copy, "check", "--help")
    assert "Write the points, a line for each check" in rosgrade(copy, "report", "--help")
    python(
        copy,
        "from grader.report.audience import RENDERERS, Audience\n"
        "from grader.report.formats.points import render\n"
        "from tests.report.sample import lost_points\n"
        "assert RENDERERS[render] is Audience.STUDENT\n"
        "assert render(lost_points().result).startswith('builds ')\n",
    )


def test_a_new_stimulus_is_valid_described_and_played(copy: Path) -> None:
    folder = copy / "simple_publisher"
    shutil.copytree(copy / "assignments/simple_publisher", folder, dirs_exist_ok=True)
    yaml = folder / "assignment.yaml"
    text = yaml.read_text(encoding="utf-8")
    stimuli = "    stimuli:\n      - {wait: 1 s}\n    record:\n"
    yaml.write_text(text.replace("    record:\n", stimuli, 1), encoding="utf-8")
    assert "valid" in rosgrade(copy, "validate", str(folder))
    assert '"Let time pass, so that' in rosgrade(copy, "schema")
    python(
        copy,
        "from grader.authoring.documentation import assignment_markdown\n"
        "from grader.run.stimuli.player import PLAYS\n"
        "assert '## wait' in assignment_markdown()['stimuli.md']\n"
        "assert 'Wait' in [model.__name__ for model in PLAYS]\n",
    )
