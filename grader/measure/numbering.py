"""The sequence numbers of a writer, which tell how many messages were lost on their way."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from grader.recording.model import Message

# rmw gives the largest number where it does not know a sequence number.
_UNKNOWN = 2**62


def is_numbered(messages: Sequence[Message]) -> bool:
    """Whether the messages have the growing sequence numbers of one writer."""
    numbers = [message.sequence for message in messages]
    known = bool(numbers) and numbers[0] > 0 and numbers[-1] < _UNKNOWN
    return known and all(a < b for a, b in pairwise(numbers))


def published(messages: Sequence[Message]) -> int:
    """How many messages were published, with those that were lost on their way."""
    numbers = [message.sequence for message in messages if 0 < message.sequence < _UNKNOWN]
    return max([len(messages), *numbers])


def lost(before: Message, after: Message) -> int:
    """How many messages of one writer were lost between two of them."""
    if not 0 < before.sequence < after.sequence < _UNKNOWN:
        return 0
    return after.sequence - before.sequence - 1
