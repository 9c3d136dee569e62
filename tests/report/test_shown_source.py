"""The student's source beside the findings: the lines around a place, once, with a link."""

from __future__ import annotations

from dataclasses import replace

import pytest

from grader.findings.finding import Evidence, Finding
from grader.recording.submission import SourceError
from grader.report.model.excerpt import excerpt
from tests.grade.sample import Told
from tests.report.page import Page
from tests.report.sample import PLACE, judged, lost_points

NODE = "\n".join(f"        line_{number} = {number}" for number in range(1, 31)) + "\n"
SOURCE = {PLACE.file: NODE}
SETUP = """from setuptools import setup

setup(
    name='bot',
    entry_points={
        'console_scripts': [
            'bot_pub = bot.node:main',
        ],
    },
)
"""


def test_lines_around_a_place_are_shown_with_the_one_that_is_meant():
    found = excerpt(PLACE, SOURCE)
    assert (found.line, found.first, len(found.texts)) == (18, 15, 7)
    assert found.texts[3] == "line_18 = 18"
    page = Page(lost_points().html(source=SOURCE))
    assert "15 line_15 = 15" in " ".join(page.text.split())
    assert len(page.all("li", class_="is-meant")) == 1
    (box,) = page.all("div", class_="scroll code-box")
    assert box["aria-label"] == f"{PLACE.file}, lines 15 to 21"


def test_the_same_lines_are_shown_once_and_linked_after_that():
    html = lost_points().html(source=SOURCE)
    assert html.count('class="is-meant"') == 1
    assert '<a class="soft" href="#code-first">(shown above)</a>' in html


def test_only_a_report_for_the_own_machine_has_links_that_open_an_editor(tmp_path):
    file = tmp_path / PLACE.file
    file.parent.mkdir(parents=True)
    file.write_text(NODE)
    assert "vscode://" not in lost_points().html(source=SOURCE)
    assert f'href="vscode://file{file}:18"' in lost_points().html(source=SOURCE, root=tmp_path)


def test_a_submission_in_one_more_folder_is_found(tmp_path):
    file = tmp_path / "handed in" / PLACE.file
    file.parent.mkdir(parents=True)
    file.write_text(NODE)
    html = lost_points().html(source=SOURCE, root=tmp_path)
    assert "/handed%20in/src/bot_publisher" in html


@pytest.mark.parametrize(
    ("place", "line"),
    [
        (SourceError("src/bot/setup.py", None, "bot_pub = bot.node:main"), 7),
        (SourceError("src/bot/setup.py", None, "no executable"), 6),
        (SourceError("src/bot/package.xml", None, "build type ament_cmake"), 2),
        (SourceError("src/bot/setup.py", 99, "beyond its end"), None),
        (SourceError("src/bot/other.py", 3, "not kept"), None),
        (SourceError("src/bot/node.py", None, "somewhere"), None),
    ],
)
def test_a_place_without_a_line_is_found_where_the_file_says_it(place, line):
    manifest = "<package>\n  <export><build_type>ament_python</build_type></export>\n</package>\n"
    source = {
        "src/bot/setup.py": SETUP,
        "src/bot/package.xml": manifest,
        "src/bot/node.py": "x = 1\n",
    }
    found = excerpt(place, source)
    assert (found and found.line) == line


def test_colours_at_the_begin_of_a_line_are_no_text():
    # Without an indent: the first tag of the line stands at its very begin.
    html = lost_points().html(source={PLACE.file: "def main():\n    pass\n" * 15})
    assert '<span class="k">def</span>' in html and "&lt;span" not in html
    text = " ".join(Page(html).text.split())
    assert "17 def main(): 18 pass" in text


def test_source_is_text_whatever_it_holds():
    attack = "</code><script>alert(1)</script>\x1b[2J\u202e"
    html = lost_points().html(source={PLACE.file: f"{attack}\n" * 20})
    assert "<script>alert" not in html and "\x1b" not in html and "\u202e" not in html


def test_a_terminal_shows_the_lines_too():
    text = lost_points().printed(source=SOURCE)
    assert "❱ 18 line_18 = 18\n" in text and "  15 line_15 = 15\n" in text
    assert "❱" not in lost_points().printed()


def test_the_same_mistake_is_told_once():
    seen = Finding.failed("a", "it crashed", "Try.", Evidence(places=(PLACE,)))
    checks = [Told("node", seen), Told("topic", replace(seen, expected="b")), Told("alive", seen)]
    sample = judged(checks)
    assert sample.printed().count("it crashed") == 1
    assert sample.printed().count("the same as “Title of node”") == 2
    page = Page(sample.html(source=SOURCE))
    assert page.text.count("the same mistake as “Title of node”") == 2
    assert len(page.all("article", class_="check card is-failed")) == 1


def test_a_wide_table_names_a_cause_once():
    checks = [
        Told("node", Finding.failed("a", "b")),
        *(Told(f"c{number}", requires=("node",)) for number in range(15)),
    ]
    assert judged(checks).printed(120).count("waits for Title of node") == 1
    page = Page(judged(checks).html())
    assert "15 checks wait for another check" in page.text


def test_steps_of_a_hint_are_given_one_at_a_time():
    hints = ["Look at the name.", "It ends with `low`.", "It is `/battery_low`."]
    sample = judged([Told("topic", Finding.failed("a", "b"), hint=hints)])
    (check,) = sample.result.checks
    assert (check.author_hint, check.further_hints) == (hints[0], tuple(hints[1:]))
    text = sample.printed()
    assert hints[0] in text and hints[1] not in text and "2 more steps in the report" in text
    html = sample.html()
    assert html.count("<summary>Another hint</summary>") == 2
    assert html.index("It ends with") < html.index("/battery_low</code>.")
    passed = judged([Told("topic", hint=hints)]).result.checks[0]
    assert (passed.author_hint, passed.further_hints) == ("", ())
