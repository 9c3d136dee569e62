"""Wrong names: what a student calls a thing, what was asked for, and how a run puts that right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

_OF_ACTION = ("send_goal", "cancel_goal", "get_result", "feedback", "status")


class Thing(str, Enum):
    """What has a name; how a wrong one is put right depends on nothing else."""

    PACKAGE = "package"
    """Another one is judged and run in its place."""
    FILE = "file"
    """Of the install space, such as ``lib/bot/driver``: another one is run in its place."""
    INTERFACE = "interface"
    """Another one is judged and used in its place."""
    NODE = "node"
    TOPIC = "topic"
    SERVICE = "service"
    ACTION = "action"
    PARAMETER = "parameter"
    """Another one gets its value too."""


@dataclass(frozen=True, order=True)
class WrongName:
    """A thing under another name than was asked for; names of the graph are in full."""

    thing: Thing
    own: str
    asked: str

    def __str__(self) -> str:
        """Write it as ROS does, such as ``/cmdvel:=/cmd_vel``."""
        return f"{self.own}:={self.asked}"

    @property
    def rules(self) -> tuple[str, ...]:
        """The rules of ``--ros-args -r`` that put it right; none if ROS has none for it."""
        if self.thing in (Thing.TOPIC, Thing.SERVICE):
            return (str(self),)
        if self.thing is Thing.ACTION:
            # Jazzy has no rule for an action, but for each service and topic of it.
            ends = (f"/_action/{end}" for end in _OF_ACTION)
            return tuple(f"{self.own}{end}:={self.asked}{end}" for end in ends)
        if self.thing is Thing.NODE:
            (old_space, _, old), (space, _, new) = (
                name.rpartition("/") for name in (self.own, self.asked)
            )
            renamed = (f"{old}:__node:={new}",) if old != new else ()
            return renamed + ((f"{new}:__ns:={space or '/'}",) if old_space != space else ())
        return ()

    def explains(self, other: WrongName) -> bool:
        """Whether the other name is wrong because it stands in this node's name or namespace."""
        space = self.own.rpartition("/")[0]
        moved = space if space != self.asked.rpartition("/")[0] else ""
        inside = [f"{one}/" for one in (self.own, moved) if one]
        return self.thing is Thing.NODE is not other.thing and other.own.startswith(tuple(inside))


@dataclass(frozen=True)
class Names:
    """What a student calls otherwise than it was asked for, in order and each once."""

    wrong: tuple[WrongName, ...] = ()

    @classmethod
    def of(cls, wrong: Iterable[WrongName]) -> Names:
        """Put names in order."""
        return cls(tuple(sorted(set(wrong))))

    def __bool__(self) -> bool:
        return bool(self.wrong)

    def __or__(self, other: Names) -> Names:
        return Names.of((*self.wrong, *other.wrong))

    def __le__(self, other: Names) -> bool:
        return set(self.wrong) <= set(other.wrong)

    def own(self, thing: Thing, asked: str) -> str:
        """What the student calls a thing that was asked for."""
        return next(
            (one.own for one in self.wrong if (one.thing, one.asked) == (thing, asked)), asked
        )

    def own_file(self, folder: str, name: str) -> str:
        """What the student calls a file that is asked for anywhere below a folder."""
        found = (one for one in self.wrong if one.thing is Thing.FILE)
        below = (one for one in found if one.asked.startswith(f"{folder}/"))
        same = (one.own for one in below if one.asked.rpartition("/")[2] == name)
        return next(same, name).rpartition("/")[2]

    @property
    def rules(self) -> tuple[str, ...]:
        """The rules of ``--ros-args -r`` that put them right."""
        return tuple(rule for one in self.wrong for rule in one.rules)


NO_NAMES = Names()


def old_names(environment: Mapping[str, str]) -> Names:
    """The names in a recording of before, which holds them as texts such as ``/a:=/b``."""
    given = environment.get("parameters", "").split()
    pairs = [text.split(":=") for text in environment.get("remaps", "").split()]
    return Names.of(WrongName(_old_thing(asked, given), own, asked) for own, asked in pairs)


def _old_thing(asked: str, parameters: Iterable[str]) -> Thing:
    if asked.startswith("/"):
        return Thing.TOPIC
    if "/" in asked:
        return Thing.FILE
    return Thing.PARAMETER if asked in parameters else Thing.PACKAGE
