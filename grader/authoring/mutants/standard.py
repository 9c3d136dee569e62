"""The standard mutants: mistakes that follow from what the checks of an assignment ask for.

A rule belongs to a check of the catalogue. It says what is wrong where that check fails, in the
files of a package or in what a program does; the checks that a mutant loses are those that a rule
was found for. A mistake in what a program does is imposed by the run, so that any right solution
can be the reference.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from grader.assignment.binding import BoundCheck
from grader.assignment.load import LoadedAssignment
from grader.assignment.mutant import (
    LANGUAGES,
    Mutant,
    Mutants,
    has_standard_mutants,
    load_mutants,
    read_files,
    reference_of,
    required_by,
)
from grader.authoring.mutants import manifest
from grader.authoring.mutants.manifest import Files, PackageFiles, misspelt
from grader.errors import AssignmentError, Problem, UsageError
from grader.findings.fields import each_field
from grader.run.imposing.mistake import Mistake
from grader.spec.nearest_name import nearest_or_all

_OTHER_TYPES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_OTHER_AXIS = {"x": "y", "y": "x", "z": "x"}
_MOST_OF_PERIOD = 0.85
"""Share of the period for which a callback sleeps that leaves the executor little time."""
_LONGER = 1.5
"""How many times as long as the longest answer that is allowed a callback sleeps."""
_SEEN = ("topic.", "qos.", "node.")
"""Families of checks of a topic that pass where no callback is called."""

Imposed = tuple[str, str, str]
"""Kind, name and value of a mistake."""


@dataclass(frozen=True)
class Standard:
    """A standard mutant: a usual mistake, made from what the contract asks for.

    Attributes:
        mistakes: What a run imposes on the reference; the mutant has no edits then.
    """

    mutant: Mutant
    mistakes: tuple[Mistake, ...] = ()


@dataclass
class _Draft:
    """A mutant that is being found: what is wrong, about what, and which checks lose by it."""

    kind: str
    title: str
    about: tuple[str, ...]
    files: Files = field(default_factory=dict)
    mistakes: tuple[Mistake, ...] = ()
    loses: list[str] = field(default_factory=list)


def with_standard_mutants(loaded: LoadedAssignment, written: Mutants) -> tuple[Standard, ...]:
    """The standard mutants that an assignment has, with what its author says of them.

    Raises:
        AssignmentError: The author wrote a mutant with the id of one.
    """
    if not has_standard_mutants(loaded.assignment):
        return ()
    found = standard_mutants(loaded, read_files(written.reference))
    known = {one.mutant.id for one in found}
    problems = [
        Problem(f"{one.id!r} is a standard mutant: rename it, or leave that out under `derived`")
        for one in (*written.mutants, *written.variants)
        if one.id in known and written.derived.get(one.id) is not False
    ]
    if problems:
        raise AssignmentError(written.file, problems)
    said = {name: given for name, given in written.derived.items() if name in known}
    return tuple(
        replace(one, mutant=one.mutant.model_copy(update={"loses": given.loses})) if given else one
        for one in found
        if (given := said.get(one.mutant.id)) is not False
    )


def every_mutant(loaded: LoadedAssignment) -> list[Mutant]:
    """All mutants of an assignment, in each language that it has a reference for."""
    found: list[Mutant] = []
    derived: set[str] = set()
    said: dict[str, Path] = {}
    for language in LANGUAGES:
        if not (loaded.folder / language.mutants).exists():
            try:
                reference_of(loaded.assignment.id, loaded.folder, language)
            except UsageError:
                continue
            if not has_standard_mutants(loaded.assignment):
                continue
        written = load_mutants(loaded.assignment, loaded.folder, language=language)
        found += [*written.mutants, *(one.mutant for one in with_standard_mutants(loaded, written))]
        derived |= {
            one.mutant.id for one in standard_mutants(loaded, read_files(written.reference))
        }
        said |= dict.fromkeys(written.derived, written.file)
    for name in said.keys() - derived:
        advice = nearest_or_all(name, sorted(derived), "The standard mutants are")
        problem = Problem(f"no standard mutant is called {name!r}.{advice}", where="derived")
        raise AssignmentError(said[name], [problem])
    return found


def standard_mutants(loaded: LoadedAssignment, files: Mapping[str, bytes]) -> tuple[Standard, ...]:
    """All standard mutants of what the contract asks for, for the files of a reference."""
    drafts: dict[tuple[object, ...], _Draft] = {}
    written = loaded.source.data.get("checks") if loaded.source else ()
    own = {one.get("id") for one in written or ()}
    for bound in (one for one in loaded.checks if one.spec.id not in own):
        for draft in (*_of_package(bound, loaded, files), *_of_run(bound, loaded)):
            key = (draft.kind, frozenset(draft.files.items()), draft.mistakes)
            drafts.setdefault(key, draft).loses += draft.loses or [bound.spec.id]
    requires = {spec.id: spec.requires for spec in loaded.assignment.checks}
    return tuple(
        Standard(
            Mutant(
                id=name,
                title=draft.title,
                files=dict(draft.files),
                loses=tuple(
                    one
                    for one in requires
                    if one in draft.loses and not required_by(one, requires) & {*draft.loses}
                ),
            ),
            draft.mistakes,
        )
        for name, draft in _named(drafts.values())
    )


def _named(drafts: Iterable[_Draft]) -> Iterator[tuple[str, _Draft]]:
    """An id for each: its kind, and where there are several, as much as is needed of the rest."""
    drafts = list(drafts)
    for draft in drafts:
        same = [one for one in drafts if one.kind == draft.kind]
        columns = [*zip(*(one.about for one in same), strict=True)]
        varied = [column for column in columns if len({*column}) > 1]
        enough = [column for column in varied if len({*column}) == len(same)][:1] or varied
        number = same.index(draft)
        words = [draft.kind, *(column[number].strip("/") for column in enough)]
        yield re.sub(r"\W+", "_", "_".join(words)).lower(), draft


# Packages


def _of_package(
    bound: BoundCheck, loaded: LoadedAssignment, files: Mapping[str, bytes]
) -> Iterator[_Draft]:
    changes = [one for one in manifest.CHANGES if bound.spec.uses in one[2]]
    package = _package(bound, loaded, files) if changes else None
    if package is None:
        return
    for kind, title, _, make in changes:
        changed = make(package)
        if changed:
            yield _Draft(kind, title, (package.name, package.about), files=changed)


def _package(
    bound: BoundCheck, loaded: LoadedAssignment, files: Mapping[str, bytes]
) -> PackageFiles | None:
    """The package of a reference that a check is about, and the part of it that it asks for."""
    given: Any = bound.parameters
    about: str = getattr(given, "executable", "") or getattr(given, "interface", "")
    name: str = getattr(given, "package", "") or about.partition("/")[0]
    if bound.spec.uses == "node.starts":
        about = "".join(_Run(bound, loaded).programs)
    texts = {path: content.decode("utf-8", "replace") for path, content in files.items()}
    for one in loaded.assignment.packages:
        tag = re.compile(rf"<name>\s*{re.escape(one.name)}\s*</name>")
        is_meant = one.name == name if name else about in one.executables
        for path in texts if is_meant else ():
            if path.rpartition("/")[2] == "package.xml" and tag.search(texts[path]):
                folder = path.removesuffix("package.xml")
                for file in ("package.xml", "setup.py"):
                    _refuse_broken(f"{folder}{file}", texts.get(f"{folder}{file}", ""))
                return PackageFiles(one.name, texts, one.executables, folder, about)
    return None


def _refuse_broken(path: str, text: str) -> None:
    """Refuse a file of a reference that cannot be read, so that no mistake can be made in it."""
    try:
        if path.endswith(".py"):
            ast.parse(text)
        else:
            ElementTree.fromstring(text)
    except (SyntaxError, ElementTree.ParseError) as error:
        raise AssignmentError(Path("reference", path), [Problem(str(error))]) from error


# What a program does


@dataclass(frozen=True)
class _Wrong:
    """What is wrong in a run, and which checks lose by it; by default the one of the rule."""

    kind: str
    title: str
    about: str
    imposed: tuple[Imposed, ...]
    loses: tuple[str, ...] = ()


def _of_run(bound: BoundCheck, loaded: LoadedAssignment) -> Iterator[_Draft]:
    run = _Run(bound, loaded)
    rule = _RULES.get(bound.spec.uses or "")
    for wrong in rule(run) if rule is not None and run.programs else ():
        mistakes = tuple(
            Mistake(program, *one) for program in run.programs for one in wrong.imposed
        )
        about = (wrong.about, " ".join(run.programs))
        yield _Draft(wrong.kind, wrong.title, about, mistakes=mistakes, loses=list(wrong.loses))


class _Run:
    """A check of a run, with its parameters, and what else judges the same programs."""

    def __init__(self, bound: BoundCheck, loaded: LoadedAssignment) -> None:
        self.given: Any = bound.parameters
        self.id = bound.spec.id
        self._loaded = loaded
        self._scenarios = {one.id for one in loaded.scenarios_of(bound)}
        self.programs = self._programs(bound)

    def _programs(self, bound: BoundCheck) -> tuple[str, ...]:
        """The program that runs where a check judges; none if it is not clear which is meant."""
        launched = [one for run in self._loaded.scenarios_of(bound) for one in run.launch]
        names = {one.executable for one in launched}
        if len(names) != 1 or any(one.name or one.namespace or one.remap for one in launched):
            return ()
        return tuple(name for name in names if name is not None)

    def others(self, uses: tuple[str, ...], topic: str | None) -> Iterator[BoundCheck]:
        """Checks of these families that judge the same runs, of one topic or of none."""
        for one in self._loaded.checks:
            scenarios = {run.id for run in self._loaded.scenarios_of(one)}
            about = getattr(one.parameters, "topic", None)
            if (
                (one.spec.uses or "").startswith(uses)
                and scenarios & self._scenarios
                and (topic in (None, about) or (one.spec.uses or "").startswith("executor."))
            ):
                yield one

    @property
    def periods(self) -> dict[str, float]:
        """The topics with a message in each period."""
        found = [one.parameters for one in self.others(("timing.period",), None)]
        return {one.topic: one.period for one in found}  # type: ignore[attr-defined]

    @property
    def topics(self) -> set[str]:
        """All topics that checks of the same runs are about."""
        found = (getattr(one.parameters, "topic", None) for one in self.others(("",), None))
        return {topic for topic in found if topic is not None}

    def starved(self, topics: Iterable[str]) -> tuple[str, ...]:
        """The checks that fail where no callback is called."""
        found = [one.spec for topic in topics for one in self.others(("",), topic)]
        unheard = (one.id for one in found if not (one.uses or "").startswith(_SEEN))
        return tuple(dict.fromkeys(unheard))


def _name(kind: str, run: _Run) -> Iterator[_Wrong]:
    name = getattr(run.given, kind)
    other = misspelt(name)
    yield _Wrong(f"{kind}_misspelt", f"The {kind} is {other}", name, (("rename", name, other),))


def _endpoint(kind: str, run: _Run) -> Iterator[_Wrong]:
    yield from _name("topic", run)
    topic = run.given.topic
    # With neither the name nor the type, nothing is taken for it.
    elsewhere = (("rename", topic, "/elsewhere"), ("type", topic, _OTHER_TYPES[0]))
    yield _Wrong(f"no_{kind}", f"There is no {kind} on {topic}", topic, elsewhere)


def _untouched(run: _Run) -> Iterator[_Wrong]:
    # A program has one type for a topic: of those that it uses, the type would be another one.
    for topic in [one for one in run.given.topics if one not in run.topics][:1]:
        title = f"The node publishes on {topic}, too"
        yield _Wrong("publishes_too", title, "", (("publishes", "node", topic),))


def _not_subscribed(run: _Run) -> Iterator[_Wrong]:
    for topic in [one for one in run.given.topics if one not in run.topics][:1]:
        title = f"The node subscribes to {topic}, too"
        yield _Wrong("subscribes_too", title, "", (("subscribes", "node", topic),))


def _type(run: _Run) -> Iterator[_Wrong]:
    topic = run.given.topic
    other = next(name for name in _OTHER_TYPES if name != run.given.type)
    yield _Wrong("type_wrong", f"The type is {other}", topic, (("type", topic, other),))
    if run.given.remap:
        yield from _name("topic", run)


def _qos(run: _Run) -> Iterator[_Wrong]:
    topic, given = run.given.topic, run.given
    others = {
        "reliability": {"reliable": "best_effort", "best_effort": "reliable"},
        "durability": {"volatile": "transient_local", "transient_local": "volatile"},
    }
    for kind, values in others.items():
        other = values.get(getattr(given, kind) or "")
        if other is not None:
            words = other.replace("_", " ")
            yield _Wrong(other, f"The endpoint is {words}", topic, ((kind, topic, other),))


def _matching(run: _Run) -> Iterator[_Wrong]:
    """A publisher that offers less than a subscription asks for."""
    if run.given.kind == "publisher" and run.given.expect == "match":
        yield from (one for one in _qos(run) if one.kind in ("best_effort", "volatile"))


def _depth(run: _Run) -> Iterator[_Wrong]:
    topic, other = run.given.topic, 1 if run.given.depth > 1 else 2
    title = "The queue holds one message" if other == 1 else "The queue holds two messages"
    yield _Wrong("depth_wrong", title, topic, (("depth", topic, str(other)),))


def _node(run: _Run) -> Iterator[_Wrong]:
    name = run.given.name.rpartition("/")[2]
    other = misspelt(name)
    yield _Wrong("node_misnamed", f"The node is called {other}", name, (("node", name, other),))
    # What it publishes stays where it is, also where its name is relative.
    kept = tuple(("rename", f"/robot{topic}", topic) for topic in sorted(run.topics))
    moved = ("namespace", name, "/robot")
    yield _Wrong("in_a_namespace", "The node is in the namespace /robot", name, (moved, *kept))


def _starts(_: _Run) -> Iterator[_Wrong]:
    title = "The program waits for ever before it creates a node"
    yield _Wrong("hangs_at_start", title, "", (("hangs", "node", "always"),))


def _alive(run: _Run) -> Iterator[_Wrong]:
    title = "An exception ends the program after 1 s"
    yield _Wrong("raises_after_one_second", title, "", (("raises", "executor", "1.0"),))
    lost = (run.id, *run.starved(run.periods))
    imposed = (("ends", "executor", "now"),)
    yield _Wrong("ends_at_once", "The program ends instead of spinning", "", imposed, lost)


def _ends(_: _Run) -> Iterator[_Wrong]:
    title = "The program ignores Ctrl+C"
    yield _Wrong("ignores_interrupt", title, "", (("ignores", "SIGINT", "always"),))
    title = "Ctrl+C ends the spinning, but not the program"
    yield _Wrong("never_exits", title, "", (("lingers", "exit", "always"),))


def _count(run: _Run) -> Iterator[_Wrong]:
    topic, given = run.given.topic, run.given
    least = given.exactly or given.at_least or 0
    if given.stimulus is not None:
        return
    if least == 1:
        most = (("most", topic, "0"),)
        yield _Wrong("never_publishes", "Nothing is published", topic, most)
    elif least:
        most = (("most", topic, str(least - 1)),)
        yield _Wrong("one_message_too_few", f"{least - 1} messages are published", topic, most)
    if given.exactly or given.at_most:
        twice = (("twice", topic, "each"),)
        yield _Wrong("published_twice", "Each message is published twice", topic, twice)


def _equal(run: _Run) -> Iterator[_Wrong]:
    topic = run.given.topic
    fields = [
        one for one in each_field(run.given.value) if isinstance(one[1], (bool, int, float, str))
    ]
    for path, _ in [one for one in fields if one[1] != ""][:1]:
        wrong = (("field", topic, path),)
        yield _Wrong("wrong_value", f"{path} has another value", topic, wrong)
    for path, value in fields:
        outer, _, last = path.rpartition(".")
        if value and outer and last in _OTHER_AXIS:
            other = f"{outer}.{_OTHER_AXIS[last]}"
            wrong = (("field", topic, f"{path} {other}"),)
            yield _Wrong("wrong_field", f"The value of {path} is in {other}", topic, wrong)
            break


def _period(run: _Run) -> Iterator[_Wrong]:
    topic = run.given.topic
    given: list[Any] = [one.parameters for one in run.others(("timing.period",), None)]
    # The executor still answers.
    answered = {one.spec.id for one in run.others(("executor.",), None)}
    starved = tuple(one for one in run.starved(run.periods) if one not in answered)
    longer = 1 + 2 * max(one.tolerance.of(one.period) / one.period for one in given)
    # All timers of the program, and so all topics with a period.
    for kind, title, times, lost in (
        ("period_ten_times", "The period is ten times as long", 10.0, ()),
        ("period_a_little_longer", f"The period is {longer:g} times as long", longer, ()),
        ("period_a_thousandth", "The period is a thousandth", 0.001, ()),
        ("period_a_thousand_times", "The period is a thousand times as long", 1e3, starved),
    ):
        yield _Wrong(kind, title, "", (("period", "timers", f"{times:g}"),), lost)
    title = "Nothing is published any more after five messages"
    yield _Wrong("falls_silent", title, topic, (("most", topic, "5"),))
    twice = (("twice", topic, "each"),)
    yield _Wrong("published_twice", "Each message is published twice", topic, twice)
    never = (("never_spins", "executor", "always"),)
    title = "The program waits and never spins"
    yield _Wrong("never_spins", title, "", never, run.starved([topic]))


def _responsive(run: _Run) -> Iterator[_Wrong]:
    for topic, period in run.periods.items():
        within, typically = run.given.within, run.given.typically
        blocked = period * _MOST_OF_PERIOD if typically else within * _LONGER
        late = [one.spec.id for one in run.others(("timing.period",), topic)]
        lost = (run.id, *(late if blocked > period else ()))
        title = f"Each callback that publishes then sleeps for {blocked:g} s"
        imposed = (("blocks", topic, f"{blocked:g}"),)
        yield _Wrong("blocks_in_its_callback", title, topic, imposed, lost)


_RULES: dict[str, Callable[[_Run], Iterable[_Wrong]]] = {
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
