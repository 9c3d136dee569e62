"""mutants.yaml is checked against the assignment and the reference; mutants become folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.assignment.changed_reference import apply
from grader.assignment.model import Assignment
from grader.assignment.mutant_file import load_mutants
from grader.assignment.reference import CPP, reference_of
from grader.errors import AssignmentError, UsageError
from grader.spec.source import parse_source
from tests.assignment.lessons import HEAD

LESSON = parse_source(
    HEAD
    + "  - {id: node, uses: x, points: 1}\n"
    + "  - {id: topic, uses: x, points: 1, requires: [node]}\n"
    + "  - {id: values, uses: x, points: 1, requires: [topic]}\n",
    Path("assignment.yaml"),
).read(Assignment)


@pytest.fixture
def reference(tmp_path: Path) -> Path:
    folder = tmp_path / "reference"
    for name, content in {
        "bot/setup.py": "name = 'bot'\n",
        "bot/bot/node.py": "topic = '/cmd_vel'\n",
        "bot/bot/__pycache__/node.pyc": "x",
        "build/bot/x": "x",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content)
    return folder


def write(tmp_path: Path, text: str) -> Path:
    (tmp_path / "mutants.yaml").write_text(text)
    return tmp_path


GOOD = """\
rosgrade: 1
mutants:
  - id: cmdvel
    title: The topic is called /cmdvel
    edits: [{file: bot/bot/node.py, replace: /cmd_vel, with: /cmdvel}]
    loses: [topic]
variants:
  - id: moved
    title: In a workspace
    move: {bot: src/bot}
"""


def test_mutants_are_loaded_and_applied(tmp_path: Path, reference: Path) -> None:
    mutants = load_mutants(LESSON, write(tmp_path, GOOD), reference)
    assert [mutant.loses for mutant in mutants.mutants] == [("topic",)]
    apply(mutants.mutants[0], mutants.reference, tmp_path / "one")
    assert (tmp_path / "one/bot/bot/node.py").read_text() == "topic = '/cmdvel'\n"
    assert (tmp_path / "one/bot/setup.py").read_text() == "name = 'bot'\n"
    apply(mutants.variants[0], mutants.reference, tmp_path / "two")
    assert (tmp_path / "two/src/bot/bot/node.py").read_text() == "topic = '/cmd_vel'\n"


def test_what_a_build_left_in_the_reference_is_not_handed_in(
    tmp_path: Path, reference: Path
) -> None:
    mutants = load_mutants(LESSON, write(tmp_path, GOOD), reference)
    apply(mutants.mutants[0], reference, tmp_path / "one")
    files = sorted(path.name for path in (tmp_path / "one").rglob("*") if path.is_file())
    assert files == ["node.py", "setup.py"]


def test_all_mistakes_are_reported_with_their_lines(tmp_path: Path, reference: Path) -> None:
    folder = write(
        tmp_path,
        """\
rosgrade: 1
mutants:
  - id: a
    title: An edit that does not apply
    edits:
      - file: bot/setup.py
        replace: name
        with: title
      - file: bot/setup.py
        replace: name
        with: title
    loses: [topics]
  - id: b
    title: Names a check that is skipped
    files: {bot/bot/node.py: null}
    loses: [values, node]
variants:
  - id: a
    title: Changes nothing
""",
    )
    with pytest.raises(AssignmentError) as caught:
        load_mutants(LESSON, folder, reference)
    file = folder / "mutants.yaml"
    assert str(caught.value).splitlines() == [
        f"{file}:10: mutants[0].edits[1].replace: the text occurs 0 times in bot/setup.py, not 1",
        f"{file}:12: mutants[0].loses[0]: there is no check 'topics'. Did you mean 'topic'?",
        f"{file}:16: mutants[1].loses[0]: 'values' requires 'node', so it is skipped: leave it out",
        f"{file}:18: variants[0].id: 'a' stands twice (first in line 3)",
        f"{file}:18: variants[0]: changes nothing",
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("loses: [topic]", "lose: [topic]", "6: mutants[0].lose: unknown key 'lose'. Did you mean"),
        ("loses: [topic]", "loses: []", "6: mutants[0].loses: expected at least 1 entry"),
        ("    title: In a", "    loses: [topic]\n    title: In a", "9: variants[0].loses: unknown"),
        ("with: /cmdvel", "with_: /cmdvel", "5: mutants[0].edits[0].with_: unknown key 'with_'"),
        (
            "file: bot",
            "file: /bot",
            "5: mutants[0].edits[0].file: '/bot/bot/node.py' is not a path",
        ),
    ],
)
def test_a_mistake_in_the_form_is_reported(
    tmp_path: Path, reference: Path, old: str, new: str, said: str
) -> None:
    with pytest.raises(AssignmentError) as caught:
        load_mutants(LESSON, write(tmp_path, GOOD.replace(old, new)), reference)
    assert str(caught.value).startswith(f"{tmp_path / 'mutants.yaml'}:{said}")


def test_a_missing_file_is_wrong_use(tmp_path: Path, reference: Path) -> None:
    with pytest.raises(UsageError, match=r"mutants\.yaml: No such file or directory"):
        load_mutants(LESSON, tmp_path, reference)


def test_the_solution_in_cpp_has_mutants_of_its_own(tmp_path: Path, reference: Path) -> None:
    write(tmp_path, GOOD)
    cpp = tmp_path / "reference_cpp"
    (cpp / "bot/src").mkdir(parents=True)
    (cpp / "bot/src/node.cpp").write_text('auto topic = "/cmd_vel";\n')
    (tmp_path / "mutants_cpp.yaml").write_text(GOOD.replace("bot/node.py", "src/node.cpp"))
    mutants = load_mutants(LESSON, tmp_path, language=CPP)
    assert mutants.reference == cpp
    apply(mutants.mutants[0], mutants.reference, tmp_path / "one")
    assert (tmp_path / "one/bot/src/node.cpp").read_text() == 'auto topic = "/cmdvel";\n'


BOTH = """\
rosgrade: 1
mutants:
  - id: cmdvel
    title: The topic is called /cmdvel
    python:
      edits: [{file: bot/bot/node.py, replace: /cmd_vel, with: /cmdvel}]
    cpp:
      edits: [{file: bot/src/node.cpp, replace: /cmd_vel, with: /cmdvel}]
    loses: [topic]
  - id: only_python
    title: The topic is empty
    edits: [{file: bot/bot/node.py, replace: /cmd_vel, with: ''}]
    loses: [topic]
  - id: only_cpp
    title: The file is empty
    cpp:
      files: {bot/src/node.cpp: ''}
    loses: [topic]
"""


def test_one_entry_is_a_mutant_in_each_language_that_it_names(
    tmp_path: Path, reference: Path
) -> None:
    cpp = tmp_path / "reference_cpp"
    (cpp / "bot/src").mkdir(parents=True)
    (cpp / "bot/src/node.cpp").write_text('auto topic = "/cmd_vel";\n')
    python = load_mutants(LESSON, write(tmp_path, BOTH), reference)
    compiled = load_mutants(LESSON, tmp_path, language=CPP)
    assert [one.id for one in python.mutants] == ["cmdvel", "only_python"]
    assert [one.id for one in compiled.mutants] == ["cmdvel", "only_cpp"]
    apply(compiled.mutants[0], cpp, tmp_path / "one")
    assert (tmp_path / "one/bot/src/node.cpp").read_text() == 'auto topic = "/cmdvel";\n'


def test_the_file_of_most_edits_is_said_once(tmp_path: Path, reference: Path) -> None:
    short = GOOD.replace("file: bot/bot/node.py, ", "")
    said = "rosgrade: 1\nfile: {python: bot/bot/node.py}"
    mutants = load_mutants(LESSON, write(tmp_path, short.replace("rosgrade: 1", said)), reference)
    apply(mutants.mutants[0], mutants.reference, tmp_path / "one")
    assert (tmp_path / "one/bot/bot/node.py").read_text() == "topic = '/cmdvel'\n"
    with pytest.raises(AssignmentError, match=r"mutants\[0\]\.edits\[0\]: says no `file`"):
        load_mutants(LESSON, write(tmp_path, short), reference)


def test_a_change_with_one_edit_needs_no_list(tmp_path: Path, reference: Path) -> None:
    one = GOOD.replace("edits: [{file: bot/bot/node.py, replace: /cmd_vel, with: /cmdvel}]", "{}")
    one = one.replace(
        "    {}\n", "    file: bot/bot/node.py\n    replace: /cmd_vel\n    with: /cmdvel\n"
    )
    mutants = load_mutants(LESSON, write(tmp_path, one), reference)
    apply(mutants.mutants[0], mutants.reference, tmp_path / "one")
    assert (tmp_path / "one/bot/bot/node.py").read_text() == "topic = '/cmdvel'\n"
    with pytest.raises(AssignmentError, match=r"\[0\]: `replace` and `with` belong together"):
        load_mutants(LESSON, write(tmp_path, one.replace("    with: /cmdvel\n", "")), reference)
    with pytest.raises(AssignmentError, match=r"mutants\[0\]\.replace: the text occurs 0 times"):
        load_mutants(LESSON, write(tmp_path, one.replace("e: /cmd_vel", "e: /cmd_val")), reference)


def test_an_edit_of_one_language_that_does_not_apply_is_reported_there(
    tmp_path: Path, reference: Path
) -> None:
    folder = write(tmp_path, BOTH.replace("py, replace: /cmd", "py, replace: x", 1))
    with pytest.raises(AssignmentError, match=r"\[0\]\.python\.edits\[0\]\.replace: the text"):
        load_mutants(LESSON, folder, reference)


def test_an_id_in_the_files_of_both_languages_is_refused(tmp_path: Path) -> None:
    cpp = tmp_path / "reference_cpp"
    (cpp / "bot/src").mkdir(parents=True)
    (cpp / "bot/src/node.cpp").write_text('auto topic = "/cmd_vel";\n')
    write(tmp_path, BOTH)
    (tmp_path / "mutants_cpp.yaml").write_text(GOOD.replace("bot/node.py", "src/node.cpp"))
    with pytest.raises(AssignmentError, match=r"cmdvel stands in mutants\.yaml as well"):
        load_mutants(LESSON, tmp_path, language=CPP)


def test_what_is_said_of_a_standard_mutant_names_checks_that_there_are(
    tmp_path: Path, reference: Path
) -> None:
    text = f"{GOOD}derived:\n  depth_wrong: {{loses: [topics]}}\n  best_effort: false\n"
    with pytest.raises(AssignmentError, match=r"depth_wrong\.loses\[0\]: there is no check"):
        load_mutants(LESSON, write(tmp_path, text), reference)


def test_a_missing_reference_is_reported() -> None:
    with pytest.raises(UsageError, match="the assignment 'lesson' has no reference solution"):
        reference_of("lesson")


def test_a_reference_that_changed_since_is_reported(tmp_path: Path, reference: Path) -> None:
    mutants = load_mutants(LESSON, write(tmp_path, GOOD), reference)
    (reference / "bot/bot/node.py").write_text("")
    with pytest.raises(AssignmentError, match="'cmdvel' does not apply: the text occurs 0 times"):
        apply(mutants.mutants[0], reference, tmp_path / "one")
    assert not (tmp_path / "one").exists()
