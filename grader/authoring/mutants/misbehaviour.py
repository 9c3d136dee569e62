"""What a program does wrong where a check of a run fails: a rule for each check of the catalogue.

A run imposes such a mistake on a right solution, so that any solution can be the reference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.load import LoadedAssignment
from grader.authoring.mutants.manifest import misspelt
from grader.findings.fields import each_field

_OTHER_TYPES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_OTHER_AXIS = {"x": "y", "y": "x", "z": "x"}
_MOST_OF_PERIOD = 0.85
"""Share of the period for which a callback sleeps that leaves the executor little time."""
_LONGER = 1.5
"""How many times as long as the longest answer that is allowed a callback sleeps."""
_WITHOUT_CALLBACKS = ("topic.", "qos.", "node.")
"""Families of checks of a topic that pass where no callback is called."""

Imposed = tuple[str, str, str]
"""Kind, name and value of a mistake, see :class:`~grader.run.imposing.mistake.Mistake`."""


@dataclass(frozen=True)
class Misbehaviour:
    """What is wrong in a run.

    Attributes:
        about: What tells it from others of its kind, such as a topic.
        loses: Checks that fail by it; by default the one of the rule.
    """

    kind: str
    title: str
    about: str
    imposed: tuple[Imposed, ...]
    loses: tuple[str, ...] = ()


class RunCheck:
    """A check of a run, with its parameters, and what else judges the same programs.

    Attributes:
        programs: The program that runs where it judges; none if it is not clear which is meant.
    """

    def __init__(self, bound: BoundCheck, loaded: LoadedAssignment) -> None:
        self.parameters: Any = bound.parameters
        self.id = bound.spec.id
        self._loaded = loaded
        self._scenarios = {scenario.id for scenario in loaded.scenarios_of(bound)}
        launches = [launch for run in loaded.scenarios_of(bound) for launch in run.launch]
        names = {launch.executable for launch in launches}
        is_clear = len(names) == 1 and not any(
            launch.name or launch.namespace or launch.remap for launch in launches
        )
        self.programs = tuple(name for name in names if is_clear and name is not None)

    def others(self, families: tuple[str, ...], topic: str | None) -> Iterator[BoundCheck]:
        """Checks of these families that judge the same runs, of one topic or of none."""
        for bound in self._loaded.checks:
            uses = bound.spec.uses or ""
            scenarios = {scenario.id for scenario in self._loaded.scenarios_of(bound)}
            # The executor calls the callbacks of all topics.
            is_of_topic = topic in (None, getattr(bound.parameters, "topic", None))
            is_of_topic = is_of_topic or uses.startswith("executor.")
            if uses.startswith(families) and scenarios & self._scenarios and is_of_topic:
                yield bound

    @property
    def periods(self) -> dict[str, float]:
        """The topics with a message in each period."""
        asked: list[Any] = [one.parameters for one in self.others(("timing.period",), None)]
        return {one.topic: one.period for one in asked}

    @property
    def topics(self) -> set[str]:
        """All topics that checks of the same runs are about."""
        topics = (getattr(one.parameters, "topic", None) for one in self.others(("",), None))
        return {topic for topic in topics if topic is not None}

    @property
    def unused_topics(self) -> list[str]:
        """The topics of the check that no other check of the same runs is about.

        A program has one type for a topic: of those that it uses, the type would be another one.
        """
        used = self.topics
        return [topic for topic in self.parameters.topics if topic not in used]

    def starved(self, topics: Iterable[str]) -> tuple[str, ...]:
        """The checks of some topics that fail where no callback is called."""
        specs = [bound.spec for topic in topics for bound in self.others(("",), topic)]
        failing = (one.id for one in specs if not (one.uses or "").startswith(_WITHOUT_CALLBACKS))
        return tuple(dict.fromkeys(failing))


def _name(kind: str, check: RunCheck) -> Iterator[Misbehaviour]:
    name = getattr(check.parameters, kind)
    other = misspelt(name)
    yield Misbehaviour(
        f"{kind}_misspelt", f"The {kind} is {other}", name, (("rename", name, other),)
    )


def _endpoint(kind: str, check: RunCheck) -> Iterator[Misbehaviour]:
    yield from _name("topic", check)
    topic = check.parameters.topic
    # With neither the name nor the type, nothing is taken for it.
    elsewhere = (("rename", topic, "/elsewhere"), ("type", topic, _OTHER_TYPES[0]))
    yield Misbehaviour(f"no_{kind}", f"There is no {kind} on {topic}", topic, elsewhere)


def _untouched(check: RunCheck) -> Iterator[Misbehaviour]:
    for topic in check.unused_topics[:1]:
        title = f"The node publishes on {topic}, too"
        yield Misbehaviour("publishes_too", title, "", (("publishes", "node", topic),))


def _not_subscribed(check: RunCheck) -> Iterator[Misbehaviour]:
    for topic in check.unused_topics[:1]:
        title = f"The node subscribes to {topic}, too"
        yield Misbehaviour("subscribes_too", title, "", (("subscribes", "node", topic),))


def _type(check: RunCheck) -> Iterator[Misbehaviour]:
    topic = check.parameters.topic
    other = next(name for name in _OTHER_TYPES if name != check.parameters.type)
    yield Misbehaviour("type_wrong", f"The type is {other}", topic, (("type", topic, other),))
    if check.parameters.remap:
        yield from _name("topic", check)


def _qos(check: RunCheck) -> Iterator[Misbehaviour]:
    topic, parameters = check.parameters.topic, check.parameters
    opposites = {
        "reliability": {"reliable": "best_effort", "best_effort": "reliable"},
        "durability": {"volatile": "transient_local", "transient_local": "volatile"},
    }
    for policy, opposite_of in opposites.items():
        other = opposite_of.get(getattr(parameters, policy) or "")
        if other is not None:
            title = f"The endpoint is {other.replace('_', ' ')}"
            yield Misbehaviour(other, title, topic, ((policy, topic, other),))


def _matching(check: RunCheck) -> Iterator[Misbehaviour]:
    """A publisher that offers less than a subscription asks for."""
    if check.parameters.kind == "publisher" and check.parameters.expect == "match":
        yield from (one for one in _qos(check) if one.kind in ("best_effort", "volatile"))


def _depth(check: RunCheck) -> Iterator[Misbehaviour]:
    topic, other = check.parameters.topic, 1 if check.parameters.depth > 1 else 2
    title = "The queue holds one message" if other == 1 else "The queue holds two messages"
    yield Misbehaviour("depth_wrong", title, topic, (("depth", topic, str(other)),))


def _node(check: RunCheck) -> Iterator[Misbehaviour]:
    name = check.parameters.name.rpartition("/")[2]
    other = misspelt(name)
    yield Misbehaviour(
        "node_misnamed", f"The node is called {other}", name, (("node", name, other),)
    )
    # What it publishes stays where it is, also where its name is relative.
    kept = tuple(("rename", f"/robot{topic}", topic) for topic in sorted(check.topics))
    moved = ("namespace", name, "/robot")
    yield Misbehaviour(
        "in_a_namespace", "The node is in the namespace /robot", name, (moved, *kept)
    )


def _starts(_: RunCheck) -> Iterator[Misbehaviour]:
    title = "The program waits for ever before it creates a node"
    yield Misbehaviour("hangs_at_start", title, "", (("hangs", "node", "always"),))


def _alive(check: RunCheck) -> Iterator[Misbehaviour]:
    title = "An exception ends the program after 1 s"
    yield Misbehaviour("raises_after_one_second", title, "", (("raises", "executor", "1.0"),))
    lost = (check.id, *check.starved(check.periods))
    imposed = (("ends", "executor", "now"),)
    yield Misbehaviour("ends_at_once", "The program ends instead of spinning", "", imposed, lost)


def _ends(_: RunCheck) -> Iterator[Misbehaviour]:
    title = "The program ignores Ctrl+C"
    yield Misbehaviour("ignores_interrupt", title, "", (("ignores", "SIGINT", "always"),))
    title = "Ctrl+C ends the spinning, but not the program"
    yield Misbehaviour("never_exits", title, "", (("lingers", "exit", "always"),))


def _count(check: RunCheck) -> Iterator[Misbehaviour]:
    topic, parameters = check.parameters.topic, check.parameters
    if parameters.stimulus is not None:
        return
    fewest = parameters.exactly or parameters.at_least or 0
    one_too_few = (("most", topic, str(fewest - 1)),)
    if fewest == 1:
        yield Misbehaviour("never_publishes", "Nothing is published", topic, one_too_few)
    elif fewest > 1:
        title = f"{fewest - 1} messages are published"
        yield Misbehaviour("one_message_too_few", title, topic, one_too_few)
    if parameters.exactly or parameters.at_most:
        yield _published_twice(topic)


def _published_twice(topic: str) -> Misbehaviour:
    title = "Each message is published twice"
    return Misbehaviour("published_twice", title, topic, (("twice", topic, "each"),))


def _equal(check: RunCheck) -> Iterator[Misbehaviour]:
    topic = check.parameters.topic
    fields = [
        (path, value)
        for path, value in each_field(check.parameters.value)
        if isinstance(value, bool | int | float | str)
    ]
    for path, value in fields:
        if value != "":
            imposed = (("field", topic, path),)
            yield Misbehaviour("wrong_value", f"{path} has another value", topic, imposed)
            break
    for path, value in fields:
        outer, _, axis = path.rpartition(".")
        if value and outer and axis in _OTHER_AXIS:
            other = f"{outer}.{_OTHER_AXIS[axis]}"
            title = f"The value of {path} is in {other}"
            yield Misbehaviour("wrong_field", title, topic, (("field", topic, f"{path} {other}"),))
            break


def _period(check: RunCheck) -> Iterator[Misbehaviour]:
    topic = check.parameters.topic
    # The executor still answers while no callback of a timer is called.
    answered = {one.spec.id for one in check.others(("executor.",), None)}
    starved = tuple(one for one in check.starved(check.periods) if one not in answered)
    longer = _beyond_every_tolerance(check)
    # All timers of the program, and so all topics with a period.
    for kind, title, factor, loses in (
        ("period_ten_times", "The period is ten times as long", 10.0, ()),
        ("period_a_little_longer", f"The period is {longer:g} times as long", longer, ()),
        ("period_a_thousandth", "The period is a thousandth", 0.001, ()),
        ("period_a_thousand_times", "The period is a thousand times as long", 1e3, starved),
    ):
        yield Misbehaviour(kind, title, "", (("period", "timers", f"{factor:g}"),), loses)
    title = "Nothing is published any more after five messages"
    yield Misbehaviour("falls_silent", title, topic, (("most", topic, "5"),))
    yield _published_twice(topic)
    title, never = "The program waits and never spins", (("never_spins", "executor", "always"),)
    yield Misbehaviour("never_spins", title, "", never, check.starved([topic]))


def _beyond_every_tolerance(check: RunCheck) -> float:
    """A factor by which a period is wrong for each check of one: twice the widest tolerance."""
    asked: list[Any] = [one.parameters for one in check.others(("timing.period",), None)]
    shares: list[float] = [one.tolerance.of(one.period) / one.period for one in asked]
    return 1 + 2 * max(shares)


def _responsive(check: RunCheck) -> Iterator[Misbehaviour]:
    for topic, period in check.periods.items():
        blocked = check.parameters.within * _LONGER
        if check.parameters.typically:
            blocked = period * _MOST_OF_PERIOD
        loses = [check.id]
        if blocked > period:
            loses += [one.spec.id for one in check.others(("timing.period",), topic)]
        title = f"Each callback that publishes then sleeps for {blocked:g} s"
        imposed = (("blocks", topic, f"{blocked:g}"),)
        yield Misbehaviour("blocks_in_its_callback", title, topic, imposed, tuple(loses))


RULES: dict[str, Callable[[RunCheck], Iterable[Misbehaviour]]] = {
    "topic.published": partial(_endpoint, "publisher"),
    "topic.subscribed": partial(_endpoint, "subscription"),
    "topic.type": _type,
    "topic.untouched": _untouched,
    "topic.not_subscribed": _not_subscribed,
    "service.exists": partial(_name, "service"),
    "qos.offered": _qos,
    "qos.requested": _qos,
    "qos.compatible": _matching,
    "qos.depth": _depth,
    "node.exists": _node,
    "node.starts": _starts,
    "node.alive": _alive,
    "node.ends": _ends,
    "messages.count": _count,
    "messages.equal": _equal,
    "timing.period": _period,
    "executor.responsive": _responsive,
}
"""What goes wrong where a check of the catalogue fails, by the name of the check."""
