"""The cause of a failure without what only one student has: names, numbers, files and lines."""

from __future__ import annotations

import builtins
import re
import sys

from grader.report.model.result_model import CheckPart
from grader.report.text.words import cut
from grader.spec.safe_text import one_line

MOST_CHARACTERS = 300
_MOST_READ = 1000
_ANY = "…"
# Whose names mean the same in every submission, besides those of the assignment.
_PUBLIC = {*sys.stdlib_module_names, *dir(builtins), "rclpy", "rclcpp", "numpy"}
_ROS = ("_msgs", "_interfaces", "_srvs")
_FILES = ("package.xml", "setup.py", "setup.cfg", "CMakeLists.txt")
_NAMES = re.compile(r"(`|\"|(?<!\w)')(.*?)\1(?!\w)")
_FILE = re.compile(r"[\w./-]*?([\w-]+\.(?:py|xml|cfg|txt|toml|ya?ml|[ch](?:pp)?|cc))(?::\d+)*\b")
_ONE = re.compile(r"\b1 ([a-z]{4,})\b(?P<of> of \d+)?(?: (was|is|has|differs)\b)?")
_MANY = {"was": " were", "is": " are", "has": " have", "differs": " differ"}
_NUMBER = re.compile(
    r"(?<![\w.…])[-+]?\d[\d.,/e+-]*(?<![.,])(?: (?:[num]?s|min|h|[mck]?m)(?![\w/]))?"
)


def cause(check: CheckPart) -> str:
    """Why a check failed, in words that are equal for those who made the same mistake.

    It is what the check observed; names of the assignment, of ROS and of Python stay, and any
    other name, number, file and line becomes ``…``. What a person named otherwise has that name.
    """
    if check.cause:
        return check.cause

    def name(match: re.Match[str]) -> str:
        mark, text = match.groups()
        first = re.split(r"\W", text.lstrip("/"), maxsplit=1)[0]
        public = first in _PUBLIC or first.endswith(_ROS) or f"`{text}`" in check.expected
        return f"{mark}{text if public else _ANY}{mark}"

    text = cut(one_line(check.observed), _MOST_READ)
    text = _FILE.sub(lambda file: file[1] if file[1] in _FILES else _ANY, text)
    text = _ONE.sub(_several, _NAMES.sub(name, text))
    return cut(_NUMBER.sub(_ANY, text), MOST_CHARACTERS)


def _several(match: re.Match[str]) -> str:
    """``1 message was`` as ``2 messages were``: how often it happened is no other mistake."""
    return f"2 {match[1]}s{match['of'] or ''}{_MANY.get(match[3], '')}"
