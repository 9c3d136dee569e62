"""The HTML report: complete, inert, the same every time."""

import base64
import hashlib
import re
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import pytest
from jinja2 import DictLoader, Environment

from grader.findings.finding import Finding
from grader.machine import resources
from grader.recording.event import Breach
from grader.recording.model import Ending, LogLine
from grader.report.formats import github, gradescope, junit
from grader.report.formats.markdown import render_markdown
from grader.report.html.page import compiled_templates
from tests.grade.sample import FAIL, Told
from tests.report.page import Page
from tests.report.sample import (
    PROCESS,
    Sample,
    at,
    attempts,
    everywhere,
    full_points,
    judged,
    lost_points,
    not_built,
    not_graded,
)

SAMPLES = [full_points, lost_points, not_built, not_graded]
FORMATS = {
    "terminal": Sample.printed,
    "html": Sample.html,
    "markdown": lambda sample: render_markdown(sample.result),
    "junit": lambda sample: junit.render(sample.result),
    "gradescope": lambda sample: gradescope.render(sample.result),
    "github": lambda sample: "\n".join(github.annotation_lines(sample.result)),
}
ATTACKS = [
    "<script>alert(1)</script>",
    "</script><script src=//example.org/x.js></script>",
    "</style><script>alert(1)</script>",
    "</title></head><body onload=alert(1)>",
    '"><img src=x onerror=alert(1)>',
    "' onmouseover='alert(1)' x='",
    "--><iframe src=https://example.org></iframe><!--",
    "]]></desc></svg><svg onload=alert(1)>",
    "</pre></details><form action=https://example.org><input name=a>",
    "`</code><script>alert(1)</script>`",
    "{{ 7 * 7 }}{% include '/etc/passwd' %}",
    "&lt;script&gt;",
    "javascript:alert(1)",
    "<meta http-equiv=refresh content='0;url=https://example.org'>",
    "\x1b]8;;https://example.org\x07<b>\x1b[0m\u202e\x00",
]


def page(sample: Sample) -> Page:
    return Page(sample.html())


def sha256(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def squeezed(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("make", SAMPLES)
class TestEveryReport:
    def test_is_well_formed_and_says_its_language(self, make):
        found = page(make())
        assert found.problems == []
        assert found.all("html", lang="en")
        assert len(found.all("h1")) == len(found.all("main")) == len(found.all("footer")) == 1

    def test_loads_nothing_and_allows_only_its_own_style_and_script(self, make):
        html = make().html()
        found = Page(html)
        assert not found.tags & {"link", "iframe", "object", "embed", "form", "img"}
        (policy,) = found.all("meta", http_equiv="Content-Security-Policy")
        (style,) = re.findall(r"<style>(.*?)</style>", html, re.DOTALL)
        (script,) = re.findall(r"<script>(.*?)</script>", html, re.DOTALL)
        assert policy["content"] == (
            f"default-src 'none'; style-src {sha256(style)}; script-src {sha256(script)}; "
            "base-uri 'none'; form-action 'none'"
        )
        assert all(item["type"] == "application/json" for item in found.all("script") if item)
        assert "url(" not in html and "@import" not in html and "style=" not in html

    def test_is_the_same_every_time(self, make):
        assert make().html() == make().html()

    def test_names_every_drawing_for_a_screen_reader_and_links_only_within_itself(self, make):
        found = page(make())
        ids = [attributes["id"] for _, attributes in found.elements if "id" in attributes]
        assert len(ids) == len(set(ids))
        for drawing in found.all("svg", role="img"):
            assert set(drawing["aria-labelledby"].split()) <= set(ids)
        assert {link["href"][1:] for link in found.all("a") + found.all("use")} <= set(ids)

    def test_has_headings_without_a_gap(self, make):
        levels = [int(tag[1]) for tag, _ in page(make()).elements if re.fullmatch("h[1-6]", tag)]
        assert levels[0] == 1
        assert all(after - before <= 1 for before, after in pairwise(levels))


FIRST = (
    "Fix this first Not yet: It publishes every 300 ms a median of 322.4 ms; 2 of 3 periods are "
    "longer than 315 ms, the longest is 612 ms Try next: The period grows with the work in the "
    "callback. A "
    "timer keeps the period. Also: Let a timer do the waiting: create_timer(0.3, callback). When: "
    "0.750 s a gap of 612 ms begins Where: src/bot_publisher/bot_publisher/node.py:18 "
    "time.sleep(0.3) 1 other check waits for it."
)
REACHED = Breach(at(0.8), "processes", "64 processes and threads", "64")
FLOOD = tuple(LogLine(at(0.1), PROCESS, "stdout", f"line {i} " + "x" * i) for i in range(3000))
WAITS = [Told("a", FAIL), Told("b", FAIL), Told("c", requires=("a", "b"))]
SAYS = {"listen": FAIL, "renamed": Finding.passed("`x`", "a ` and nothing else")}


@pytest.mark.parametrize(
    ("make", "shown"),
    [
        (full_points, ["3 / 3 points", "Full points.", "2 passed"]),
        (
            lost_points,
            [
                "3.02 / 7 points",
                "1 check failed, 1 other waits for it.",
                FIRST,
                "Expected a period of 300 ms within 5 % (285 to 315 ms)",
                "Observed a median of 322.4 ms",
                "loop took 0.31 s",
                "after message period 2 612 ms",
                "never shown to students",
                "What the node printed (1 line) 0.400 stderr [INFO] [bot_publisher]: up",
                "Graded 2026-03-04 09:12:33+01:00",
                "rosgrade 0.1.0",
                "ROS distribution jazzy",
                "ab" * 32,
                "cd" * 32,
                "listen 7 2.00 s 2.1 ms everything that the scenario waits for was seen",
                "recordings/listen.mcap",
            ],
        ),
        (
            not_built,
            ["Output of the build src/bot_publisher/setup.py:24 SyntaxError", "Failed <<< bot"],
        ),
        (
            not_graded,
            [
                "Not graded Something failed in the grader or the machine",
                "This is not a fault of the submission: it can be graded again without changes.",
                "the check itself failed: KeyError: 'depth' the host took 212 ms",
                "Traceback (most recent call last):",
            ],
        ),
        (
            lambda: full_points(log=FLOOD),
            [
                "2700 lines left out here; the recording has all of them.",
                "… (1,009 more characters)",
            ],
        ),
        (
            lambda: full_points(breaches=(REACHED,)),
            [
                "a limit of the sandbox was reached",
                "0.800 s the processes of the submission took 64 processes and threads, 64 are "
                "allowed; anything more is refused",
            ],
        ),
        (
            lambda: judged(WAITS),
            ["skipped Title of c waits for “Title of a” and “Title of b”"],
        ),
        (
            lambda: judged([Told("node", SAYS)], tuple(SAYS)),
            [
                "In several scenarios 0 / 1 points",
                "Scenario listen: failed",
                "Scenario renamed: passed Expected x Observed a ` and nothing else",
            ],
        ),
    ],
)
def test_what_a_reader_finds(make, shown):
    text = squeezed(page(make()).text)
    assert [said for said in shown if said not in text] == []


def test_full_points_leave_nothing_to_fix_and_what_is_not_graded_has_no_score():
    text = squeezed(page(full_points()).text)
    assert "Fix this first" not in text and "sandbox was reached" not in text
    text = squeezed(page(not_graded()).text)
    head, _, rest = text.partition(" points so far, ")
    assert head.endswith("2 of 4") and rest.startswith("2 open") and "/ 4 points" not in head


def test_earlier_attempts_are_shown_with_what_changed():
    sample = replace(full_points(), added={"attempts": attempts(1.0, None, 4.25)})
    text = squeezed(page(sample).text)
    assert "Attempt 3 ; the one before had no score." in text
    assert "3 counts 4.25 / 10 Rate of /chatter: failed → passed, +3" in text
    assert "2 not graded" in text and "1 1 / 10 the first that is known" in text


def test_a_first_attempt_is_not_called_one():
    for added in ({}, {"attempts": attempts(4.0)}):
        assert "Attempt" not in page(replace(full_points(), added=added)).text


@pytest.mark.parametrize("attack", ATTACKS)
class TestHostileText:
    def test_adds_no_element_and_no_attribute(self, attack):
        harmless = page(everywhere("harmless `text`" if "`" in attack else "harmless"))
        found = page(everywhere(attack))
        assert found.problems == []
        assert [(tag, list(attributes)) for tag, attributes in found.elements] == [
            (tag, list(attributes)) for tag, attributes in harmless.elements
        ]

    def test_hostile_text_is_never_active(self, attack):
        for _, attributes in page(everywhere(attack)).elements:
            assert not {"src", "srcdoc", "action", "formaction", "style"} & set(attributes)
            assert not any(name.startswith("on") for name in attributes)
            assert (attributes.get("href") or "#").startswith("#")

    def test_leaves_no_control_character(self, attack):
        html = everywhere(attack).html()
        assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", html)

    def test_hostile_text_is_shown_as_it_is(self, attack):
        visible = "<U+202E>␀" if "\x1b" in attack else attack.replace("`", "")
        assert page(everywhere(attack)).text.count(visible) > 10


def test_text_that_cannot_be_encoded_is_still_a_file(tmp_path):
    (tmp_path / "report.html").write_text(everywhere("\udcff").html(), encoding="utf-8")


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_says_how_many_points_wait_for_a_failed_check(name):
    assert FORMATS[name](lost_points()).count("2 points wait for this") == 1


def test_commands_that_write_no_report_do_not_load_jinja2():
    code = (
        "import sys, grader.report.model.result, grader.report.text.terminal; "
        "import grader.report.html.report; "
        "sys.exit('jinja2' in sys.modules)"
    )
    root = resources.PACKAGE.parent
    assert subprocess.run([sys.executable, "-c", code], cwd=root, check=False).returncode == 0


@pytest.mark.parametrize("ending", Ending)
def test_why_a_run_ended_is_told_in_words(ending):
    sample = full_points()
    runs = {name: replace(run, ending=ending) for name, run in sample.recordings.items()}
    text = squeezed(replace(sample, recordings=runs).html())
    assert re.search(r"ended because (?=[a-z]+ \w)", text)


def compiled(folder, source):
    cache = compiled_templates(folder)
    environment = Environment(loader=DictLoader({"page": source}), bytecode_cache=cache)
    return environment.get_template("page").render(name="bot")


class TestCompiledTemplates:
    def test_a_template_is_kept_and_a_changed_one_is_compiled_anew(self, tmp_path):
        folder = tmp_path / "cache" / "templates"
        assert compiled(folder, "{{ name }} passed") == "bot passed"
        assert list(folder.iterdir())
        assert compiled(folder, "{{ name }} passed") == "bot passed"
        assert compiled(folder, "{{ name }} failed") == "bot failed"

    @pytest.mark.parametrize("content", [b"", b"no bytecode"])
    def test_a_broken_file_does_no_harm(self, tmp_path, content):
        compiled(tmp_path, "{{ name }} passed")
        for file in tmp_path.iterdir():
            file.write_bytes(content)
        assert compiled(tmp_path, "{{ name }} passed") == "bot passed"

    def test_a_folder_that_cannot_be_made_does_no_harm(self, tmp_path):
        (tmp_path / "file").touch()
        assert compiled(tmp_path / "file" / "templates", "{{ name }} passed") == "bot passed"
