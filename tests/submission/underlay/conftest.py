"""A git repository with packages, served by the file system."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from grader.submission.underlay import distribution, packages
from grader.submission.underlay.definition import Repository as Wanted
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

    def release(self, name: str, version: str, needs: str = "") -> None:
        """Release a pure Python package, as bloom does: alone at its own tag.

        Args:
            needs: Entries of its package.xml.
        """
        for path in self.folder.iterdir():
            if path.name != ".git":
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        for path, text in PACKAGE.items():
            file = self.folder / path.replace("bot_publisher", name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text.replace("bot_publisher", name))
        manifest = self.folder / "package.xml"
        text = manifest.read_text().replace("<version>0.0.0<", f"<version>{version}<")
        manifest.write_text(text.replace("<depend>geometry_msgs</depend>", needs))
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", name)
        self.git("tag", f"release/jazzy/{name}/{version}-1")

    def entry(self, version: str, **more: object) -> str:
        """It in a ``.repos`` file."""
        lines = {"type": "git", "url": self.url, "version": version, **more}
        named = "".join(f"    {key}: {value}\n" for key, value in lines.items())
        return f"  {self.folder.name}:\n{named}"


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    """A repository without a commit."""
    return Repository(tmp_path / "robots")


INDEX = """\
distributions:
  jazzy: {distribution: [jazzy/distribution.yaml], distribution_type: ros2}
  rolling: {distribution: [rolling/distribution.yaml]}
type: index
version: 4
"""
KEYS = """\
eigen: {debian: [libeigen3-dev], ubuntu: [libeigen3-dev], fedora: [eigen3-devel]}
graphviz: {debian: [graphviz], ubuntu: {'*': [graphviz], bionic: null}}
"""


class Index(Repository):
    """An index of ROS 2 with the packages of one release repository, and its own snapshot."""

    def __init__(self, folder: Path, releases: Repository) -> None:
        super().__init__(folder)
        self.releases = releases
        self.names: dict[str, list[str]] = {}

    def add(self, name: str, version: str = "1.0.0", needs: str = "") -> None:
        """Release a package, and list it."""
        self.releases.release(name, version, needs)
        self.names.setdefault(version, []).append(name)

    def write(self, **files: str) -> None:
        """Write the index, or other texts than that of its files."""
        entries = "".join(
            f"  robots_{number}:\n    release:\n      packages: [{', '.join(names)}]\n"
            "      tags: {release: 'release/jazzy/{package}/{version}'}\n"
            f"      url: {self.releases.url}\n      version: {version}-1\n"
            for number, (version, names) in enumerate(self.names.items())
        )
        unreleased = "  wheels: {source: {type: git, url: 'https://example.org', version: main}}\n"
        texts = {
            "index-v4.yaml": INDEX,
            "jazzy/distribution.yaml": f"repositories:\n{unreleased}{entries}",
            "rosdep/base.yaml": KEYS,
            "rosdep/python.yaml": "python3-yaml: {debian: [python3-yaml]}\n",
        }
        for name, text in (texts | files).items():
            file = self.folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)

    def pin(self, monkeypatch: pytest.MonkeyPatch, tag: str = "jazzy/2025-01-01") -> None:
        """Let it be the index that packages are taken from."""
        self.write()
        self.git("add", "--all")
        self.git("commit", "--quiet", "--allow-empty", "--message", tag)
        self.git("tag", tag)
        commit = self.git("rev-parse", "HEAD")
        snapshot = Wanted(type="git", url=self.url, version=tag, commit=commit)
        for module in (distribution, packages):
            monkeypatch.setattr(module, "SNAPSHOT", snapshot)


@pytest.fixture
def index(tmp_path: Path) -> Index:
    """An index that lists nothing yet."""
    return Index(tmp_path / "rosdistro", Repository(tmp_path / "robots-release"))
