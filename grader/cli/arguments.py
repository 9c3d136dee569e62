"""What an argument of a command seems to be, so that one in the wrong place is named."""

from __future__ import annotations

from pathlib import Path

from grader.errors import UsageError
from grader.machine import resources

_ARCHIVES = (".zip", ".tar", ".gz", ".tgz", ".rar", ".7z")
_MANIFESTS = ("package.xml", "*/package.xml", "*/*/package.xml", "*/*/*/package.xml")


def assignment_argument(name: str) -> str:
    """See that the first argument is not something else than an assignment."""
    own = sorted(file.parent.name for file in resources.assignments().glob("*/assignment.yaml"))
    seen = "" if name in own or Path(name).suffix in (".yaml", ".yml") else looks_like(Path(name))
    if seen:
        raise UsageError(f"{name} is {seen}; the first argument is an assignment, such as {own[0]}")
    return name


def recording_argument(path: Path) -> Path:
    """See that the first argument is not something else than a recording."""
    seen = looks_like(path)
    if seen and path.suffix != ".mcap":
        raise UsageError(
            f"{path} is {seen}; the first argument is a recording, such as recordings/run.mcap"
        )
    return path


def looks_like(path: Path) -> str:
    """What there is at a path, in words; empty for an assignment, and where nothing is."""
    if path.is_file():
        kind = "a recording" if path.suffix == ".mcap" else "a file"
        return "an archive" if path.suffix in _ARCHIVES else kind
    if not path.is_dir() or (path / "assignment.yaml").is_file():
        return ""
    if any((path / name).is_file() for name in ("result.json", "batch.json")):
        return "a folder with results"
    manifest = next((file for form in _MANIFESTS for file in sorted(path.glob(form))), None)
    if manifest is not None:
        return f"a folder with the package {manifest.resolve().parent.name}, such as a submission"
    return "a folder without an assignment.yaml"
