"""Comments for Canvas, a whole class at once; its gradebook CSV can hold none.

A zip for "Upload Submissions" takes a file for each student, which must be called as Canvas called
the download: user and attachment are read from that name. The student sees it as a comment with
an attachment called as the own file, so what is a zip stays one. A JSON body for the API's
``POST /api/v1/courses/:course_id/assignments/:assignment_id/submissions/update_grades`` sets grade
and comment by Canvas' number of the student.

Source: canvas-lms, ``AbstractAssignment#generate_comments_from_files`` and
``infer_comment_context_from_filename``; Canvas API, "Grade or comment on multiple submissions".
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping

from grader.report.formats.gradebook import DOWNLOAD
from grader.report.model.result_model import Result
from grader.report.text.summary import summary


def update_grades(scores: Mapping[str, str], results: Mapping[str, Result]) -> str:
    """The body for the API.

    Args:
        scores: The grade as text, by Canvas' number.
        results: What students may see, by Canvas' number; who has none gets no comment.
    """
    grades = {number: {"posted_grade": score} for number, score in scores.items()}
    for number, result in results.items():
        grades[number]["text_comment"] = summary(result)
    return json.dumps({"grade_data": grades}, indent=2, ensure_ascii=False) + "\n"


def is_download(name: str) -> bool:
    """Whether a file is called as Canvas calls a zip that a student handed in."""
    return DOWNLOAD.match(name) is not None and name.lower().endswith(".zip")


def upload_zip(given: Mapping[str, tuple[Result, bytes]]) -> bytes:
    """The zip to upload.

    Args:
        given: By the name of the download: what the student may see, and the report.
    """
    return _zipped(
        {
            name: _zipped({"feedback.txt": summary(result).encode(), "report.html": report})
            for name, (result, report) in given.items()
        }
    )


def _zipped(files: Mapping[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return stream.getvalue()
