"""The messages of a ``publish`` stimulus: from the YAML, a CSV or MCAP file, or a function."""

from __future__ import annotations

import csv
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grader.assignment.own_check import load_function
from grader.assignment.stimuli.kinds.publish import MCAP_SUFFIX, MOST_MESSAGES, Publish
from grader.assignment.stimuli.message import Find, MessageError, UnknownField, read_message
from grader.spec.document import Place

_NS = 1e-9


@dataclass(frozen=True)
class Given:
    """A message as it was given.

    Attributes:
        label: Where else, such as ``cases.csv:3``; empty for the YAML itself.
    """

    value: Mapping[str, Any]
    place: Place
    label: str = ""
    heading: str = ""
    time_s: float | None = None


@dataclass(frozen=True)
class Due:
    """A message that is to be published."""

    value: dict[str, Any]
    time_s: float


class StimulusError(ValueError):
    """Something about the messages of a stimulus is wrong."""

    def __init__(self, text: str, place: Place) -> None:
        """Keep where it is."""
        self.place = place
        super().__init__(text)


def messages_of(
    publish: Publish, folder: Path, find: Find, seed: int, drawn: Mapping[str, float]
) -> tuple[Due, ...]:
    """Read the messages of a stimulus; one that is repeated without end is there once.

    Raises:
        StimulusError: A file or function is wrong, or a value does not fit the message.
        KeyError: The definition of a message is missing.
    """
    found = []
    for number, given in enumerate(_given(publish, folder, seed)):
        try:
            value = read_message(given.value, publish.type, find, drawn)
        except MessageError as error:
            if not given.label:
                raise StimulusError(str(error), (*given.place, *error.place)) from None
            is_name = isinstance(error, UnknownField) and given.heading
            label = given.heading if is_name else given.label
            raise StimulusError(f"{label}: {error}", given.place) from None
        paced_s = number * (publish.every or 0.0)
        recorded_s = given.time_s if publish.every is None else None
        found.append(Due(value, paced_s if recorded_s is None else recorded_s))
    return tuple(found)


def _given(publish: Publish, folder: Path, seed: int) -> Sequence[Given]:
    if publish.message is not None:
        return [Given(publish.message, ("message",))] * (publish.count or 1)
    if publish.messages:
        return [Given(value, ("messages", index)) for index, value in enumerate(publish.messages)]
    if publish.python is not None:
        return _from_function(publish.python, folder, seed)
    assert publish.from_ is not None
    file = folder / publish.from_
    if not file.resolve().is_relative_to(folder.resolve()):
        raise StimulusError(f"{publish.from_} is not in the assignment's folder", ("from",))
    read = _from_mcap if file.suffix == MCAP_SUFFIX else _from_csv
    try:
        found = read(file, publish)
    except OSError as error:
        text = f"cannot read {publish.from_}: {error.strerror or error}"
        raise StimulusError(text, ("from",)) from error
    return _some(found, publish.from_, "from")


def _some(found: list[Given], name: str, key: str) -> list[Given]:
    if not found:
        raise StimulusError(f"{name} has no message", (key,))
    if len(found) > MOST_MESSAGES:
        text = f"{name} has {len(found)} messages: at most {MOST_MESSAGES} are published"
        raise StimulusError(text, (key,))
    return found


def _from_function(name: str, folder: Path, seed: int) -> list[Given]:
    place: Place = ("python",)
    try:
        function = load_function(name, folder)
    except ValueError as error:
        raise StimulusError(str(error), place) from error
    try:
        found = function(seed)
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        file = name.partition(":")[0]
        line = next((f.lineno for f in reversed(frames) if Path(f.filename).name == file), None)
        at = f"{file}:{line}" if line else name
        raise StimulusError(f"{at}: {type(error).__name__}: {error}", place) from error
    if not isinstance(found, list | tuple) or not all(isinstance(item, Mapping) for item in found):
        text = f"{name} must return a list of messages, each a dict of its fields"
        raise StimulusError(text, place)
    return _some(
        [Given(_plain(item), place, f"{name}: message {n}") for n, item in enumerate(found)],
        name,
        "python",
    )


def _plain(value: Any) -> Any:
    """Lists and numbers of Python from what NumPy gives."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _from_csv(file: Path, publish: Publish) -> list[Given]:
    found = []
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream, strict=True)
            names = reader.fieldnames or []
            for row in reader:
                label = f"{publish.from_}:{reader.line_num}"
                if None in row:
                    text = f"{label}: more values than the first row names fields ({len(names)})"
                    raise StimulusError(text, ("from",))
                # An empty cell leaves its field out, so that rows may have arrays of any length.
                value = {name.strip(): cell.strip() for name, cell in row.items() if cell}
                found.append(Given(value, ("from",), label, f"{publish.from_}:1"))
    except (csv.Error, UnicodeDecodeError) as error:
        raise StimulusError(f"{publish.from_} is not a CSV file: {error}", ("from",)) from error
    return found


def _from_mcap(file: Path, publish: Publish) -> list[Given]:
    from grader.recording.mcap_reader import read_topic

    try:
        messages, topics = read_topic(file, publish.publish)
    except ValueError as error:
        raise StimulusError(f"{publish.from_}: {error}", ("from",)) from error
    if not messages:
        listed = ", ".join(topics) or "none"
        text = f"{publish.from_} has no messages on {publish.publish}. Its topics: {listed}."
        raise StimulusError(text, ("from",))
    wrong = next((one for one in messages if one.type != publish.type), None)
    if wrong is not None:
        text = f"{publish.from_} has {publish.publish} as {wrong.type}, not {publish.type}"
        raise StimulusError(text, ("from",))
    begin_ns = messages[0].received_ns
    return [
        Given(
            one.value,
            ("from",),
            f"{publish.from_}: message {number}",
            time_s=(one.received_ns - begin_ns) * _NS,
        )
        for number, one in enumerate(messages)
    ]
