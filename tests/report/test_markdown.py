"""Markdown, read by a CommonMark parser: what a student chose is never markup."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from grader.findings.finding import Evidence, Finding
from grader.recording.event import Breach
from grader.report.formats.markdown import COMMENT_BYTES, fence, literal, prose, render_markdown
from tests.grade.sample import Told
from tests.report.sample import (
    at,
    everywhere,
    full_points,
    judged,
    lost_points,
    not_graded,
)

PARSER = MarkdownIt("commonmark").enable(["table", "strikethrough"])
HOSTILE = [
    "<script>alert(1)</script>",
    "![x](https://e.org/a.png)",
    "[x](https://e.org)",
    "# heading",
    "a | b | c",
    "```\n# out of the fence\n```",
    "*bold* __bold__ ~~gone~~",
    "&lt;b&gt; &amp;",
    "\\*",
    "line\n\n## another",
    "one ` tick",
    "`code | bar`",
]


def rendered(sample):
    return render_markdown(sample.result)


def kinds(text):
    """Every kind of token, those within a line too."""
    tokens = PARSER.parse(text)
    return [inner.type for token in tokens for inner in [token, *(token.children or [])]]


def shown(text):
    """What a reader sees of one line."""
    (inline,) = (token for token in PARSER.parse(text) if token.type == "inline")
    return "".join(child.content for child in inline.children if child.type != "softbreak")


def test_what_a_student_reads_first():
    text = rendered(lost_points())
    assert text.startswith("## timed_publisher: 3.02 of 7 points\n\n1 check failed, 1 other waits")
    assert "**Fix this first:** It publishes every 300 ms" in text
    assert "| ✗ failed | It publishes every 300 ms | 1.02 / 3 |" in text
    assert "- **also:** Let a timer do the waiting: `create_timer(0.3, callback)`." in text
    assert "```text\nloop took 0.31 s\n```" in text


def test_what_is_not_graded_has_no_score():
    text = rendered(not_graded())
    assert text.startswith("## timed_publisher: Not graded\n\nSomething failed in the grader")
    assert "| ! error | The queue depth is 10 | ? / 1 |" in text


@pytest.mark.parametrize("text", HOSTILE)
def test_nothing_of_a_student_is_markup(text):
    plain, hostile = kinds(rendered(everywhere("word"))), kinds(rendered(everywhere(text)))
    allowed = {"code_inline"} if "`" in text else set()
    assert set(hostile) - allowed == set(plain) - allowed
    for kind in ("heading_open", "tr_open", "td_open", "list_item_open", "fence"):
        assert hostile.count(kind) == plain.count(kind), kind


@settings(deadline=None)
@given(st.text(alphabet="ab_*`[]()<>&|~$#!\\@1. -", min_size=1, max_size=30))
def test_a_literal_text_shows_as_it_is(text):
    line = f"x{text}x"
    assert shown(f"- {literal(line)}").replace("\N{WORD JOINER}", "") == line


def test_no_user_is_mentioned_and_no_issue_is_linked():
    assert "@ada" not in literal("ask @ada or ada@example.org")
    assert not re.search(r"#\d|GH-\d", literal("#1, ros2/rclpy#983 and GH-7"))


@pytest.mark.parametrize(
    "text", ["see https://e.org/login", "FTP://e.org", "www.e.org", "WWW.e.org"]
)
def test_an_address_is_no_link_and_shows_as_it_is(text):
    # As GitHub's autolink extension finds them: a bare scheme with "://", or "www.".
    assert not re.search(r"(https?|ftp)://|www\.", literal(text), re.IGNORECASE)
    assert shown(f"- {literal(text)}") == text


def test_code_is_code_and_an_unpaired_tick_is_a_tick():
    assert prose("call `spin(node)` now") == "call `spin(node)` now"
    assert "code_inline" not in kinds(prose("a ` tick"))
    assert prose("`a|b`", cell=True) == "`a\\|b`"


def test_a_comment_fits_and_still_says_why_however_much_was_printed():
    long = Finding.failed("e", "it died", "h", Evidence(log=("z" * 16_000,) * 30))
    checks = [Told(f"c{number}", long) for number in range(10)]
    text = render_markdown(judged(checks).result, COMMENT_BYTES)
    assert len(text.encode()) <= COMMENT_BYTES
    assert text.count("- **observed:** it died") >= 9
    assert "z…" in text


@settings(deadline=None)
@given(st.lists(st.sampled_from(["```", "````", "~~~", "a", "", "# b"]), max_size=8))
def test_a_block_of_code_ends_where_it_should(lines):
    tokens = PARSER.parse(fence("\n".join(lines)) + "\n\nafter")
    assert [token.type for token in tokens] == [
        *("fence", "paragraph_open", "inline", "paragraph_close")
    ]


def test_limits_that_were_reached_and_what_is_worth_knowing_are_shown_as_text():
    reached = Breach(at(0.8), "disk", "all space in <b>@home</b>", "64 MiB")
    text = rendered(full_points(breaches=(reached,), environment={"other_domains": "<b>7</b>"}))
    assert "**Limits of the sandbox that were reached**" in text
    assert "- scenario listen: its processes took all space in &lt;b&gt;" in text
    assert "**Worth knowing**" in text
    assert "- scenario listen: the submission joined another ROS domain: &lt;b&gt;7" in text
    assert "Limits" not in rendered(full_points())
    assert "Worth knowing" not in rendered(full_points())
