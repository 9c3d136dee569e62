"""Comments for Canvas, a whole class at once; its gradebook CSV can hold none.

A zip for "Upload Submissions" takes a file for each student, which must be called as Canvas called
the download: user and attachment are read from that name. The student sees it as a comment with
an attachment called as the own file, so it must hold what a file of that name holds: an archive
the report and the text, a page the report, anything else the text.

Source: canvas-lms, ``AbstractAssignment#generate_comments_from_files`` and
``infer_comment_context_from_filename``.
"""

from __future__ import annotations

import io
import tarfile
import zipfile
from collections.abc import Iterable, Mapping

from grader.report.formats.canvas_gradebook import DOWNLOAD
from grader.report.model.result_model import Result
from grader.report.text.explanation import summary

# What opens a .rar or a .7z looks at the bytes, not at the name.
_ZIPS = (".zip", ".rar", ".7z")
_TARS = {
    **{".tar.gz": "gz", ".tgz": "gz", ".tar.bz2": "bz2", ".tbz2": "bz2"},
    **{".tar.xz": "xz", ".txz": "xz", ".tar": ""},
}
_PAGES = (".html", ".htm")
_BEST = (*_ZIPS, *_TARS, *_PAGES, ".txt", ".md", ".py", ".cpp", ".xml")


def carrier(names: Iterable[str]) -> str:
    """Of a student's files as Canvas called them the one that holds a comment best, or nothing."""

    def rank(name: str) -> int:
        lower = name.lower()
        return next((at for at, end in enumerate(_BEST) if lower.endswith(end)), len(_BEST))

    return min(filter(DOWNLOAD.match, names), key=rank, default="")


def upload_zip(given: Mapping[str, tuple[Result, bytes]]) -> bytes:
    """The zip to upload.

    Args:
        given: By the name of the download: what the student may see, and the report.
    """
    return _zipped({name: _comment(name.lower(), *of_one) for name, of_one in given.items()})


def _comment(name: str, result: Result, report: bytes) -> bytes:
    text = summary(result).encode()
    files = {"feedback.txt": text, "report.html": report}
    if name.endswith(_ZIPS):
        return _zipped(files)
    for end, compression in _TARS.items():
        if name.endswith(end):
            return _tarred(files, compression)
    return report if name.endswith(_PAGES) else text


def _tarred(files: Mapping[str, bytes], compression: str) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode=f"w:{compression}") as archive:  # type: ignore[call-overload]
        for name, data in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return stream.getvalue()


def _zipped(files: Mapping[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return stream.getvalue()
