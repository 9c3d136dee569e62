"""Checks of the files of a submission: leftovers of builds, texts, bags."""

from __future__ import annotations

from fnmatch import fnmatch

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.need import Bags
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Finding
from grader.findings.words import code, codes, counted, listing
from grader.recording.submission import BagRecord, SubmissionRecord
from grader.spec.name import InterfaceName, TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration


class Clean(Parameters):
    """Parameters of archive.clean."""

    asks = "nothing that a build or a run makes, such as `build` or `__pycache__`"


@check("archive.clean", Subject.SUBMISSION, Clean)
def clean(submission: SubmissionRecord, parameters: Clean) -> Finding:
    """The submission holds nothing that a build or a run makes.

    That is `build`, `install` and `log` of colcon, `CMakeFiles`, `__pycache__`, `*.pyc`,
    `*.egg-info`, virtual environments and caches of tools. A folder is judged as it is, and so is a
    workspace in which you have just built.
    """
    if not submission.leftovers:
        return Finding.as_asked("there is nothing of that kind")
    names = codes(sorted({one.rpartition("/")[2] for one in submission.leftovers}))
    return mistaken("leftovers", f"it holds {codes(submission.leftovers)}", names=names)


class File(Parameters):
    """Parameters of archive.file."""

    path: str = Field(
        min_length=1,
        description="Path in the submission, or a file name in any folder; `*` and `?` stand for "
        "any text and any character, as in `README*`. Lower and upper case are the same.",
    )
    headings: tuple[str, ...] = Field(
        (), description="Words that headings of the text must contain, one heading for each."
    )

    def _asked(self) -> str:
        words = listing(f'"{heading}"' for heading in self.headings)
        return f"a file {code(self.path)}" + (f" with the headings {words}" if words else "")

    def matches(self, path: str) -> bool:
        """Whether a path is meant."""
        pattern = self.path.lower()
        return any(fnmatch(one.lower(), pattern) for one in (path, path.rpartition("/")[2]))


@check("archive.file", Subject.SUBMISSION, File)
def file(submission: SubmissionRecord, parameters: File) -> Finding:
    """The submission holds the file, with the expected headings.

    Headings are those of Markdown (`# Usage`, or underlined with `===` or `---`) and of
    reStructuredText. One text must hold all of them.
    """
    found = [path for path in submission.files if parameters.matches(path)]
    if not found:
        return mistaken("no_file", "there is no such file", file=code(parameters.path))
    texts = dict(submission.headings)
    missing = min((_missing(parameters, texts.get(path, ())) for path in found), key=len)
    if not missing:
        return Finding.as_asked(f"found {codes(found)}")
    headings = [heading for path in found for heading in texts.get(path, ())]
    there = listing(f'"{heading}"' for heading in headings) or "none"
    wanted = listing(f'"{heading}"' for heading in missing)
    seen = f"{codes(found)} lacks {wanted}; its headings: {there}"
    return mistaken("no_heading", seen, heading=missing[0])


def _missing(parameters: File, headings: tuple[str, ...]) -> list[str]:
    return [
        wanted
        for wanted in parameters.headings
        if not any(wanted.casefold() in heading.casefold() for heading in headings)
    ]


class Bag(Parameters):
    """Parameters of archive.bag."""

    needs = (Bags(),)

    topics: dict[TopicName, InterfaceName] = Field(
        default_factory=dict, description="Topics with messages in the bag -> their types."
    )
    lasts: Duration | None = Field(None, description="Least time from first to last message.")

    def _asked(self) -> str:
        topics = codes(self.topics)
        lasts = f" of at least {format_duration(self.lasts)}" if self.lasts is not None else ""
        return f"a bag{lasts}" + (f" with messages on {topics}" if topics else "")


@check("archive.bag", Subject.SUBMISSION, Bag)
def bag(submission: SubmissionRecord, parameters: Bag) -> Finding:
    """The submission holds a recorded bag that can be read.

    Judged by reading every message of the bags that `ros2 bag record` wrote, in MCAP or SQLite.
    """
    if submission.bags is None:
        return Finding.ours("the bags were not read: grade again")
    if not submission.bags:
        nothing = "there is no bag, a folder with `metadata.yaml` and an `.mcap` or `.db3` file"
        return mistaken("no_bag", nothing)
    causes = [_why_not(one, parameters) for one in submission.bags]
    if None not in causes:
        return next(filter(None, causes))
    right = submission.bags[causes.index(None)]
    messages = counted(sum(topic.messages for topic in right.topics), "message")
    observed = f"{code(right.path)} has {messages} in {format_duration(right.duration_s)}"
    return Finding.as_asked(observed)


def _why_not(bag: BagRecord, parameters: Bag) -> Finding | None:
    """Why a bag is not what is asked for, or None."""
    name = code(bag.path)
    if bag.problem is not None:
        return mistaken("broken_bag", f"{name}: {bag.problem}")
    types = {topic.name: topic.type for topic in bag.topics if topic.messages}
    for topic, wanted in parameters.topics.items():
        if topic in types and types[topic] != wanted:
            seen = f"{name} has as {code(types[topic])} on {code(topic)}"
        elif topic not in types:
            others = f"; it has {codes(types)}" if types else ""
            seen = f"{name} has no message on {code(topic)}{others}"
        else:
            continue
        return mistaken("not_in_bag", seen, topic=f"{code(topic)} ({wanted})")
    if parameters.lasts is not None and bag.duration_s < parameters.lasts:
        return mistaken("short_bag", f"{name} lasts {format_duration(bag.duration_s)}")
    if not types:
        return mistaken("empty_bag", f"{name} has no message")
    return None
