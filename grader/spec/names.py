"""Wrong names: what a student calls a thing, what was asked for, and how a run puts that right."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

# The services and topics that an action consists of, below ``/_action/``.
_OF_ACTION = ("send_goal", "cancel_goal", "get_result", "feedback", "status")


class Thing(str, Enum):
    """A kind of thing with a name: how a run puts a wrong name right depends on nothing else."""

    PACKAGE = "package"
    """Another one is judged and run in its place."""
    FILE = "file"
    """Of the install space, such as ``lib/bot/driver``; another one is run in its place."""
    INTERFACE = "interface"
    """Another one is judged and used in its place."""
    NODE = "node"
    """Put right by a rule of ``--ros-args -r``, as are topics, services and actions."""
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
        return self._rules_for_node() if self.thing is Thing.NODE else ()

    def _rules_for_node(self) -> tuple[str, ...]:
        own_space, _, own_base = self.own.rpartition("/")
        asked_space, _, asked_base = self.asked.rpartition("/")
        rules = []
        if own_base != asked_base:
            rules.append(f"{own_base}:__node:={asked_base}")
        if own_space != asked_space:
            # ROS applies this rule after that of the name: the node has its right name already.
            rules.append(f"{asked_base}:__ns:={asked_space or '/'}")
        return tuple(rules)

    def explains(self, other: WrongName) -> bool:
        """Whether the other name is wrong only because it lies below this node.

        The private topic ``/bott/speed`` follows the node ``/bott``, and ``/lab/cmd_vel`` a node
        that is in the namespace ``/lab`` and should not be.
        """
        if self.thing is not Thing.NODE or other.thing is Thing.NODE:
            return False
        own_space, asked_space = self.own.rpartition("/")[0], self.asked.rpartition("/")[0]
        if other.own.startswith(f"{self.own}/"):
            return True
        return own_space not in ("", asked_space) and other.own.startswith(f"{own_space}/")


@dataclass(frozen=True)
class Names:
    """All names that a student got wrong, in order and each once."""

    wrong: tuple[WrongName, ...] = ()

    @classmethod
    def of(cls, wrong: Iterable[WrongName]) -> Names:
        """Put names in order."""
        return cls(tuple(sorted(set(wrong))))

    def __bool__(self) -> bool:
        return bool(self.wrong)

    def __or__(self, other: Names) -> Names:
        return Names.of((*self.wrong, *other.wrong))

    def all_in(self, other: Names) -> bool:
        """Whether each of them is among some other names too."""
        return set(self.wrong) <= set(other.wrong)

    def own(self, thing: Thing, asked: str) -> str:
        """What the student calls a thing that was asked for: the same, if that is not wrong."""
        for name in self.wrong:
            if (name.thing, name.asked) == (thing, asked):
                return name.own
        return asked

    def own_file(self, folder: str, asked: str) -> str:
        """What the student calls a file that is asked for anywhere below a folder."""
        for name in self.wrong:
            is_below = name.thing is Thing.FILE and name.asked.startswith(f"{folder}/")
            if is_below and name.asked.rpartition("/")[2] == asked:
                return name.own.rpartition("/")[2]
        return asked.rpartition("/")[2]

    @property
    def rules(self) -> tuple[str, ...]:
        """The rules of ``--ros-args -r`` that put them right."""
        return tuple(rule for name in self.wrong for rule in name.rules)


NO_NAMES = Names()
