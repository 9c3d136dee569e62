"""The pages that only the instructor sees: who is on them, and that nothing in them acts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.batch.ledger import Entry, Ledger
from grader.gradebook.instructor import write_questions, write_similarity
from grader.machine.resources import assignments
from grader.submission.kept_source import SOURCE_FOLDER, keep_source
from tests.gradebook.similarity.copies import renamed
from tests.submission.samples import Tree

NODE = """\
from rclpy.node import Node


class Greeter(Node):
    def __init__(self) -> None:
        super().__init__('greeter')
        self.seen = {}
        for topic in sorted(name for name, kinds in self.get_topic_names_and_types() if kinds):
            self.seen[topic] = [len(topic) % 7, topic.upper()]  # <script>alert(1)</script>

    def greet(self, names: list[str]) -> str:
        found = [self.seen[name][0] for name in names if name in self.seen and name != '\u202e']
        while len(found) > 3 and found[0] < found[-1]:
            found = found[1:] if sum(found) % 2 else found[:-1]
        return 'hello ' + ', '.join(str(one) for one in found or [0, 1])
"""
OTHER = "import math\nprint([math.sin(x / 7) ** 2 for x in range(100) if x % 3])\n"


@pytest.fixture(scope="module")
def loaded() -> LoadedAssignment:
    return load_assignment(str(assignments() / "simple_publisher"))


def graded(tmp_path: Path, programs: Mapping[str, str], *entries: Entry) -> Ledger:
    """A class with the source of each student."""
    ledger = Ledger(tmp_path / "out")
    with ledger.opened():
        for key, text in programs.items():
            root = Tree(tmp_path / key).write({"bot/node.py": text})
            keep_source(root, ledger.folder(key) / SOURCE_FOLDER)
        rows = [*(Entry(key, key.title(), sha256="x") for key in programs), *entries]
        ledger.write(rows, "simple_publisher", "x")
    return ledger


def test_a_pair_is_shown_side_by_side_with_those_who_handed_in_the_same(
    tmp_path: Path, loaded: LoadedAssignment
) -> None:
    twin = Entry("dora", "Dora", sha256="x", same_as="cai")
    old = Entry("emil", "Emil", sha256="x")
    programs = {"ana": NODE, "ben": OTHER, "cai": renamed(NODE)}
    file, pairs = write_similarity(loaded, graded(tmp_path, programs, twin, old))
    page = file.read_text(encoding="utf-8")
    assert file == tmp_path / "out" / "instructor" / "similarity.html" and pairs == 1
    assert "<strong>Ana</strong> and <strong>Cai, Dora</strong>: " in page
    assert "Ben" not in page and "was kept: Emil." in page
    assert page.count(">Passage 1<") >= 2 and "bot/node.py" in page
    assert "cheat" not in page.lower() and "copied" not in page.lower()
    assert "<script" not in page and "&lt;script&gt;" in page and "\u202e" not in page
    assert "script-src &#39;none&#39;" in page


def test_a_class_without_pairs_says_so(tmp_path: Path, loaded: LoadedAssignment) -> None:
    file, pairs = write_similarity(loaded, graded(tmp_path, {"ana": NODE, "ben": OTHER}))
    assert pairs == 0
    assert "No two submissions are more alike than usual." in file.read_text(encoding="utf-8")


def test_each_student_has_three_questions_and_a_damaged_recording_takes_none(
    tmp_path: Path, loaded: LoadedAssignment
) -> None:
    ledger = graded(tmp_path, {"ana": NODE, "ben": OTHER}, Entry("emil", "Emil", sha256="x"))
    recordings = ledger.folder("ana") / "recordings"
    recordings.mkdir()
    (recordings / "run.mcap").write_bytes(b"damaged")
    read: list[str] = []
    file, count = write_questions(loaded, ledger, read.append)
    page = file.read_text(encoding="utf-8")
    assert file == tmp_path / "out" / "instructor" / "questions.html" and count == 3
    ana, _, rest = page.partition(">Ana<")[2].partition(">Ben<")
    assert ana.count("<code>node.py:") == 3
    assert "nothing to ask about" in rest.partition(">Emil<")[2]
    assert "<script" not in page and "\u202e" not in page
    assert read == ["ana", "ben", "emil"]
    overview = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert 'href="instructor/questions.html"' in overview and "similarity.html" not in overview
