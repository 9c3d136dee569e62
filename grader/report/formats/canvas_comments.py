"""Comments for Canvas, a whole class at once; its gradebook CSV can hold none.

A zip for "Upload Submissions" takes a file for each student, which must be called as Canvas called
the download: user and attachment are read from that name. The student sees it as a comment with
an attachment called as the own file, so what is a zip stays one.

Source: canvas-lms, ``AbstractAssignment#generate_comments_from_files`` and
``infer_comment_context_from_filename``.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

from grader.report.formats.gradebook import DOWNLOAD
from grader.report.model.result_model import Result
from grader.report.text.explanation import summary


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
