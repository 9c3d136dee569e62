"""What is read of the files beside packages: leftovers, headings."""

from __future__ import annotations

from pathlib import Path

from grader.submission.intake.locate import opened
from grader.submission.read.document import headings
from tests.submission.samples import zip_bytes

MADE = {
    "ws/src/bot/package.xml": "<package/>",
    "ws/src/bot/log/__init__.py": "",
    "ws/src/bot/log/__pycache__/x.pyc": "",
    "ws/build/COLCON_IGNORE": "",
    "ws/build/bot/setup.py": "",
    "ws/.git/config": "",
    "ws/src/pub/package.xml": "<package/>",
    "ws/src/pub/build/CMakeCache.txt": "",
    "ws/src/pub/build/pub": "",
    "ws/src/pub/CMakeFiles/pub.dir/pub.cpp.o": "",
}


def zipped(files: dict[str, str]) -> bytes:
    return zip_bytes(*((name, text.encode()) for name, text in files.items()))


def test_what_builds_and_runs_made_is_known_of_a_folder_and_of_an_archive(tmp_path: Path) -> None:
    for name, text in MADE.items():
        path = tmp_path / "handed" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / "a.zip").write_bytes(zipped(MADE))
    for source in (tmp_path / "handed", tmp_path / "a.zip"):
        with opened(source) as located:
            assert located.leftovers == (
                *("ws/build", "ws/src/bot/log/__pycache__"),
                *("ws/src/pub/CMakeFiles", "ws/src/pub/build"),
            )


def test_archives_that_differ_only_in_leftovers_are_two_submissions(tmp_path: Path) -> None:
    clean = {name: text for name, text in MADE.items() if "build" not in name}
    hashes = set()
    for name, files in (("a.zip", MADE), ("b.zip", clean)):
        (tmp_path / name).write_bytes(zipped(files))
        with opened(tmp_path / name) as located:
            hashes.add(located.sha256)
    assert len(hashes) == 2


def test_headings_of_markdown_and_restructuredtext() -> None:
    text = "# Bot #\r\n\n```sh\n# no heading\n```\n## Usage\n\nDesign\n======\n\nTests\n-----\n"
    assert headings(text) == ("Bot", "Usage", "Design", "Tests")
