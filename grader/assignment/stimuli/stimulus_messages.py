"""Messages of a ``publish`` stimulus that come from a CSV or MCAP file, or from a function."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grader.assignment.stimuli.message import StimulusError
from grader.spec.document import Place

MCAP_SUFFIX = ".mcap"
_NS = 1e-9


@dataclass(frozen=True)
class UnreadMessage:
    """A message as the author wrote it, not read yet, with its origin.

    Attributes:
        place: In the YAML, below the stimulus.
        label: Its origin outside of the YAML, such as ``cases.csv:3``; else empty.
        time_s: Time since the first message of the file; None where no time is given.
    """

    value: Mapping[str, Any]
    place: Place
    label: str = ""
    time_s: float | None = None


def from_function(name: str, folder: Path, seed: int) -> Iterator[UnreadMessage]:
    """Call the author's function ``file.py:function``."""
    # A cell, which never calls one, imports this module too.
    from grader.assignment.own_check import load_function, naming_place

    place: Place = ("python",)
    try:
        function = load_function(name, folder)
        with naming_place(folder):
            messages = function(seed)
    except ValueError as error:
        raise StimulusError(str(error), place) from error
    is_list = isinstance(messages, list | tuple)
    if not is_list or not all(isinstance(message, Mapping) for message in messages):
        text = f"{name} must return a list of messages, each a dict of its fields"
        raise StimulusError(text, place)
    for number, message in enumerate(messages):
        yield UnreadMessage(_plain(message), place, f"{name}: message {number}")


def _plain(value: Any) -> Any:
    """Convert arrays and numbers of NumPy to lists and numbers of Python."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value


def from_file(name: str, folder: Path, topic: str, interface: str) -> Iterator[UnreadMessage]:
    """Read a CSV or MCAP file beside the assignment."""
    file = folder / name
    if not file.resolve().is_relative_to(folder.resolve()):
        raise StimulusError(f"{name} is not in the assignment's folder", ("from",))
    try:
        if file.suffix == MCAP_SUFFIX:
            yield from _from_mcap(file, topic, interface)
        else:
            yield from _from_csv(file)
    except OSError as error:
        text = f"cannot read {name}: {error.strerror or error}"
        raise StimulusError(text, ("from",)) from error


def _from_csv(file: Path) -> Iterator[UnreadMessage]:
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream, strict=True)
            for row in reader:
                label = f"{file.name}:{reader.line_num}"
                if None in row:
                    text = f"{label}: more values than fields in the first row"
                    raise StimulusError(text, ("from",))
                # An empty cell leaves its field out, so that rows may have arrays of any length.
                value = {name.strip(): cell.strip() for name, cell in row.items() if cell}
                yield UnreadMessage(value, ("from",), label)
    except (csv.Error, UnicodeDecodeError) as error:
        raise StimulusError(f"{file.name} is not a CSV file: {error}", ("from",)) from error


def _from_mcap(file: Path, topic: str, interface: str) -> Iterator[UnreadMessage]:
    from grader.recording.mcap_reader import read_topic

    try:
        messages, topics = read_topic(file, topic)
    except ValueError as error:
        raise StimulusError(f"{file.name}: {error}", ("from",)) from error
    if not messages:
        listed = ", ".join(topics) or "none"
        text = f"{file.name} has no messages on {topic}. Its topics: {listed}."
        raise StimulusError(text, ("from",))
    for number, message in enumerate(messages):
        if message.type != interface:
            text = f"{file.name} has {topic} as {message.type}, not {interface}"
            raise StimulusError(text, ("from",))
        time_s = (message.received_ns - messages[0].received_ns) * _NS
        yield UnreadMessage(message.value, ("from",), f"{file.name}: message {number}", time_s)
