"""What is kept of a bag that a student recorded: its messages as bytes, and who published them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from struct import Struct

from grader.recording.model import Qos

_HEAD = Struct("<IqqI")


@dataclass(frozen=True)
class BagChannel:
    """A topic with one of its types.

    Attributes:
        hash: Hash of the type's definition (REP-2011); empty if unknown.
        publishers: QoS of each publisher while it was recorded; none where the bag does not say it.
    """

    name: str
    type: str
    hash: str = ""
    publishers: tuple[Qos, ...] = ()


@dataclass(frozen=True)
class BagMessage:
    """A message; where the bag does not say when it was published, that is when it was recorded."""

    channel: BagChannel
    recorded_ns: int
    published_ns: int
    cdr: bytes


@dataclass(frozen=True)
class KeptBag:
    """A bag that was read.

    Attributes:
        has_published: Whether it says when messages were published; else only when each was
            recorded is known.
        data: The messages, one after the other: the number of the channel, the two times, the
            length, and the bytes.
    """

    channels: tuple[BagChannel, ...]
    has_published: bool
    data: bytes

    def messages(self) -> Iterator[BagMessage]:
        """The messages, as they lie in the bag.

        Raises:
            ValueError: The data is not whole.
        """
        at = 0
        while at < len(self.data):
            if at + _HEAD.size > len(self.data):
                raise ValueError("a message that is not whole")
            number, recorded_ns, published_ns, length = _HEAD.unpack_from(self.data, at)
            at += _HEAD.size
            if number >= len(self.channels) or at + length > len(self.data):
                raise ValueError("a message that is not whole")
            cdr = self.data[at : at + length]
            yield BagMessage(self.channels[number], recorded_ns, published_ns, cdr)
            at += length
