"""What GitHub's runner reads, read as the runner reads it."""

from __future__ import annotations

import re

import pytest

from grader.findings.finding import Evidence, Finding
from grader.recording.submission import SourceError
from grader.report.formats import github
from tests.grade.sample import FAIL, Told
from tests.report.sample import (
    everywhere,
    full_points,
    judged,
    lost_points,
    not_graded,
)

HOSTILE = "100%25 done\n::error::forged\r##[add-mask]x, a:b"


def many(count, text="observed"):
    """So many failed checks, each worth a point more than the one before."""
    checks = [
        Told(
            f"c{number}",
            Finding.failed("e", text, "h", Evidence(places=(SourceError("n.py", number, "x"),))),
            points=number,
        )
        for number in range(1, count + 1)
    ]
    return judged(checks).result


def runner_reads(line):
    """A command as actions/runner parses it (ActionCommand.TryParseV2)."""
    match = re.fullmatch(r"::(\w+)(?: (.*?))?::(.*)", line)
    assert match, line
    decode = {"%0D": "\r", "%0A": "\n", "%3A": ":", "%2C": ",", "%25": "%"}

    def decoded(text, names):
        return re.sub("|".join(names), lambda found: decode[found[0]], text)

    properties = {
        key: decoded(value, decode)
        for key, _, value in (item.partition("=") for item in (match[2] or "").split(",") if item)
    }
    return match[1], properties, decoded(match[3], ("%0D", "%0A", "%25"))


def test_an_annotation_is_at_the_student_s_line():
    (line,) = github.annotation_lines(lost_points().result, "homework/")
    kind, properties, message = runner_reads(line)
    assert kind == "error"
    assert properties == {
        "file": "homework/src/bot_publisher/bot_publisher/node.py",
        "line": "18",
        "title": "It publishes every 300 ms (1.02 / 3)",
    }
    assert "observed: a median of 322.4 ms" in message
    assert "also: Let a timer do the waiting" in message
    (line,) = github.annotation_lines(lost_points().result, None)
    assert set(runner_reads(line)[1]) == {"title"}


def test_the_runner_shows_ten_so_the_most_useful_come_first():
    lines = github.annotation_lines(many(14))
    assert len(lines) == 10
    titles = [runner_reads(line)[1]["title"] for line in lines]
    assert titles[0] == "Title of c1 (0 / 1)"
    assert titles[1:] == [f"Title of c{n} (0 / {n})" for n in range(14, 5, -1)]


def test_a_message_stays_below_what_the_runner_cuts():
    for line in github.annotation_lines(many(1, "%\n" * 9000)):
        assert len(runner_reads(line)[2]) <= 4096


def test_nothing_of_a_student_becomes_a_command():
    result = many(3, HOSTILE)
    for line in github.annotation_lines(result):
        assert "\n" not in line and "\r" not in line
        kind, properties, message = runner_reads(line)
        assert kind == "error"
        assert set(properties) == {"file", "line", "title"}
        assert "100%25 done ⏎ ::error::forged" in message


def test_a_hostile_name_stays_in_its_property():
    text = "a,line=9::b%0A"
    result = everywhere(text).result.model_copy(update={"graded": True})
    copy = result.model_copy(
        update={"checks": tuple(c for c in result.checks if c.status.value != "error")}
    )
    lines = github.annotation_lines(copy)
    assert lines
    for line in lines:
        _, properties, _ = runner_reads(line)
        assert properties["title"].startswith(text)
        assert properties["file"] == text


def test_what_is_not_graded_is_a_warning_and_what_is_only_shown_a_notice():
    (line,) = github.annotation_lines(not_graded().result)
    assert runner_reads(line)[0] == "warning"
    shown = judged([Told("node"), Told("silence", FAIL, points=0)])
    (line,) = github.annotation_lines(shown.result)
    assert runner_reads(line)[0] == "notice"
    assert github.annotation_lines(full_points().result) == ()


@pytest.mark.parametrize(
    ("make", "score", "status"),
    [(full_points, "3", "passed"), (lost_points, "2.02", "failed"), (not_graded, "", "error")],
)
def test_outputs_as_github_reads_them(make, score, status):
    text = github.outputs(make().result, "EOF_1")
    values = dict(re.findall(r"(.+)<<EOF_1\n(.*)\nEOF_1\n", text))
    hidden = 1 if make is lost_points else 0
    assert values["score"] == score
    assert values["max-score"] == {full_points: "3", lost_points: "6", not_graded: "4"}[make]
    assert values["status"] == status
    assert ("hidden check" in values["summary"]) == bool(hidden)


def test_the_summary_is_cut_before_github_drops_it():
    result = many(400, "🐢" * 2000)
    whole = github.summary(result)
    assert 900_000 < len(whole.encode()) <= 1 << 20
    assert whole.endswith("the rest is in the report.\n")
    assert len(github.summary(result, used_bytes=(1 << 20) - 100).encode()) <= 100
    assert len(github.summary(result, used_bytes=(1 << 20) + 5).encode()) == 0
