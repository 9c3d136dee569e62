"""A git repository with packages, served by the file system."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.submission.samples import PACKAGE


class Repository:
    """A git repository that is made commit by commit."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self.git("init", "--quiet", "--initial-branch", "main")

    @property
    def url(self) -> str:
        return f"file://{self.folder}"

    def git(self, *arguments: str) -> str:
        identity = ["-c", "user.name=Ada", "-c", "user.email=ada@example.org"]
        command = ["git", *identity, *arguments]
        return subprocess.run(
            command, cwd=self.folder, check=True, capture_output=True, text=True
        ).stdout.strip()

    def commit(self, *packages: str, tag: str) -> str:
        """Commit pure Python packages, and tag them; the commit."""
        for name in packages:
            for path, text in PACKAGE.items():
                file = self.folder / name / path.replace("bot_publisher", name)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text.replace("bot_publisher", name))
        self.git("add", "--all")
        self.git("commit", "--quiet", "--allow-empty", "--message", tag)
        self.git("tag", "--annotate", "--message", tag, tag)
        return self.git("rev-parse", "HEAD")

    def entry(self, version: str, **more: object) -> str:
        """It in a ``.repos`` file."""
        lines = {"type": "git", "url": self.url, "version": version, **more}
        named = "".join(f"    {key}: {value}\n" for key, value in lines.items())
        return f"  {self.folder.name}:\n{named}"


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    """A repository without a commit."""
    return Repository(tmp_path / "robots")
