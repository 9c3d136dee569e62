"""What is said in the same words in every format."""

import io

import pytest
from rich.console import Console

from grader.report.formats import github
from grader.report.formats.gradescope import render_gradescope
from grader.report.formats.junit import render_junit
from grader.report.formats.markdown import render_markdown
from grader.report.html.report import render_report
from grader.report.model.result import make_result
from grader.report.model.result_model import Result
from grader.report.text.terminal import print_grade
from tests.report.sample import Sample, lost_points


def _terminal(sample: Sample, result: Result) -> str:
    stream = io.StringIO()
    print_grade(Console(file=stream, width=80), sample.grade, sample.recordings)
    return stream.getvalue()


FORMATS = {
    "terminal": _terminal,
    "html": lambda sample, _: render_report(sample.grade, sample.recordings, sample.facts),
    "markdown": lambda _, result: render_markdown(result),
    "junit": lambda _, result: render_junit(result),
    "gradescope": lambda _, result: render_gradescope(result),
    "github": lambda _, result: "\n".join(github.annotation_lines(result)),
}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_says_how_many_points_wait_for_a_failed_check(name: str) -> None:
    sample = lost_points()
    result = make_result(sample.grade, sample.recordings, sample.facts)
    assert FORMATS[name](sample, result).count("2 points wait for this") == 1
