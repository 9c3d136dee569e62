"""Parameter files of a submission: for which nodes their values are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import yaml

from grader.recording.submission import ParameterFile
from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.paths import shown

_TAG = "ros__parameters"
_MOST_FILES, _MOST_BYTES, _MOST_NODES = 50, 64 * 2**10, 50


def nodes_in(text: str) -> tuple[tuple[str, int], ...]:
    """The full name of each node, or its pattern, with the line of its parameters."""
    try:
        whole = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, RecursionError, ValueError):
        # What is wrong with it is told by ROS, if a program reads it.
        return ()
    return tuple(islice(_nodes(whole, "", set()), _MOST_NODES))


def _nodes(part: yaml.Node | None, above: str, seen: set[int]) -> Iterator[tuple[str, int]]:
    # An alias may stand for what is around it.
    if not isinstance(part, yaml.MappingNode) or id(part) in seen:
        return
    seen.add(id(part))
    for key, value in part.value:
        name = str(key.value).strip("/")
        if name == _TAG:
            yield shown(above or "/"), key.start_mark.line + 1
        else:
            yield from _nodes(value, f"{above}/{name}", seen)


def read_parameter_files(root: Path, files: Sequence[SubmissionFile]) -> tuple[ParameterFile, ...]:
    """The files in YAML that give parameters to nodes."""
    texts = (
        (file.path, (root / file.path).read_text("utf-8", errors="replace"))
        for file in files
        if file.link is None and file.size <= _MOST_BYTES and file.path.endswith((".yaml", ".yml"))
    )
    found = (ParameterFile(shown(path), nodes_in(text)) for path, text in texts if _TAG in text)
    return tuple(islice((file for file in found if file.nodes), _MOST_FILES))
