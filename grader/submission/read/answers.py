"""What a submission itself says is meant by the free names of an assignment: ``rosgrade.yaml``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import yaml

from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.paths import shown

FILE = "rosgrade.yaml"
_MOST_BYTES, _MOST_NAMES = 16 * 1024, 100


class Answers(NamedTuple):
    """Each name with what is meant by it, or why the file cannot be read."""

    names: tuple[tuple[str, str], ...] = ()
    problem: str | None = None


def read_answers(root: Path, files: Sequence[SubmissionFile]) -> Answers:
    """Read the file, wherever in the submission it lies; it need not be there."""
    found = [file for file in files if PurePosixPath(file.path).name == FILE and file.link is None]
    if not found:
        return Answers()
    if len(found) > 1:
        paths = " and ".join(shown(file.path) for file in found[:2])
        return Answers(problem=f"there is more than one {FILE}: {paths}")
    if found[0].size > _MOST_BYTES:
        return Answers(problem=f"{FILE} has more than {_MOST_BYTES} bytes")
    try:
        text = (root / found[0].path).read_text("utf-8")
        document = yaml.compose(text, Loader=yaml.SafeLoader)
    except UnicodeDecodeError:
        return Answers(problem=f"{FILE} is not text in UTF-8")
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or "it cannot be read"
        return Answers(problem=f"{FILE}:{mark.line + 1 if mark else 1}: {reason}")
    if not isinstance(document, yaml.MappingNode):
        return Answers(problem=f"{FILE} has no line such as `name: value`")
    names: dict[str, str] = {}
    for key, value in document.value[:_MOST_NAMES]:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode) or not isinstance(value, yaml.ScalarNode):
            return Answers(problem=f"{FILE}:{line}: expected a line such as `name: value`")
        if names.setdefault(shown(key.value), shown(value.value)) != shown(value.value):
            return Answers(problem=f"{FILE}:{line}: {shown(key.value)!r} stands twice")
    return Answers(tuple(names.items()))
