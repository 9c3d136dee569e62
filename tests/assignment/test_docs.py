"""The documentation is made from the code, and is never behind it."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

from grader.assignment.lesson_checks import all_checks
from grader.assignment.own_check import load_own_check
from grader.authoring import documentation
from grader.checks.check import Check
from grader.dev import docs
from grader.findings.finding import Evidence, Finding
from grader.machine import resources
from grader.recording.interaction import Goal
from grader.recording.model import Endpoint, Message, Recording
from grader.recording.simulated import Scene, Truth

PAGE = documentation.assignment_markdown()["assignment-yaml.md"]


def test_the_files_in_docs_are_up_to_date(capsys: pytest.CaptureFixture[str]) -> None:
    assert docs.main(["--check"]) == 0, capsys.readouterr().err


def test_a_stale_or_missing_file_is_reported_and_mended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--folder", str(tmp_path)]
    assert docs.main(["--check", *arguments]) == 1
    assert f"{tmp_path / 'checks.md'} is stale: run python -m grader.dev.docs" in (
        capsys.readouterr().err
    )
    assert not list(tmp_path.iterdir())
    assert docs.main(arguments) == 0
    assert docs.main(["--check", *arguments]) == 0
    (tmp_path / "checks.md").write_text("old")
    assert docs.main(["--check", *arguments]) == 1


def test_every_check_is_described_with_all_its_parameters() -> None:
    text = "\n".join(documentation.checks_markdown().values())
    for check in all_checks().values():
        section = text.split(f"## {check.name}\n")[1].split("\n## ")[0]
        for name, field in check.parameters.model_fields.items():
            assert f"| `{field.alias or name}` |" in section


def test_links_lead_to_headings() -> None:
    pages = documentation.assignment_markdown()
    headings = {
        f"{name}#{re.sub(r'[^a-z0-9_ -]', '', line.lstrip('# ').lower()).replace(' ', '-')}"
        for name, text in pages.items()
        for line in re.sub(r"```.*?```", "", text, flags=re.DOTALL).splitlines()
        if line.startswith("#")
    }
    links = {link for text in pages.values() for link in re.findall(r"\]\((\S+\.md#\S*?)\)", text)}
    assert links
    assert {link for link in links if link.partition("#")[0] in pages} <= headings


def test_a_link_to_a_check_still_leads_to_it() -> None:
    pages = documentation.checks_markdown()
    for check in all_checks().values():
        anchor = check.name.replace(".", "").lower()
        found = re.search(rf'<a id="{anchor}"></a>\[.*?\]\(([^)#]*)#{anchor}\)', pages["checks.md"])
        assert found and f"## {check.name}\n" in pages[found[1]]


def test_a_value_is_described_in_the_words_of_yaml(catalogue: dict[str, Check]) -> None:
    text = documentation.check_markdown(catalogue["timing.period"])
    assert "| `topic` | topic, such as `/cmd_vel` | required |  |" in text
    assert "| `period` | time, such as `300 ms` | required |" in text
    text = PAGE
    assert "| `discovery` | time, such as `300 ms` | `10 s` |" in text
    assert "| `ament_python`, `ament_cmake`, or a list of both | `[ament_python]` |" in text
    assert "| `launch` | list of [launch](assignment-yaml.md#launch) |  |" in text


def test_the_example_of_an_own_check_works(tmp_path: Path) -> None:
    (code,) = re.findall(
        r"```python\n(.*?)```",
        PAGE,
        flags=re.DOTALL,
    )
    (tmp_path / "checks.py").write_text(code)
    check = load_own_check("checks.py:drives_straight", tmp_path)

    class Straight:
        def on(self, topic: str) -> tuple[Message, ...]:
            value = {"angular": {"z": 0.2}}
            return (Message(topic, "geometry_msgs/msg/Twist", value, 0, 0, 1),)

    loose = check.parameters.model_validate({"topic": "/cmd_vel", "tolerance": "20 deg"})
    strict = check.parameters.model_validate({"topic": "/cmd_vel"})
    assert check.judge(Straight(), loose).status == "passed"
    assert check.judge(Straight(), strict).observed == "turns with 0.2 rad/s"


def test_the_example_in_the_documentation_is_the_shipped_assignment() -> None:
    file = resources.assignments() / "timed_publisher" / "assignment.yaml"
    assert file.read_text(encoding="utf-8").strip() in PAGE


def test_the_page_of_the_recording_describes_every_part_of_it() -> None:
    text = "\n".join(documentation.classes_markdown().values())
    for one in (Recording, Message, Endpoint, Goal, Truth, Scene, Finding, Evidence):
        section = text.partition(f"\n## {one.__name__}\n")[2].partition("\n## ")[0]
        for field in fields(one):
            assert f"| `{field.name}` |" in section, f"{one.__name__}.{field.name}"


def test_every_table_of_keys_has_rows() -> None:
    header = "| key | value | default | meaning |\n| --- | --- | --- | --- |\n"
    for name, text in documentation.documents().items():
        for part in text.split(header)[1:]:
            assert part.startswith("| `"), f"{name}: an empty table"
