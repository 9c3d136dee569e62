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
            key = (draft.kind, *draft.about, draft.mistakes)
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


_PACKAGE: dict[str, tuple[tuple[str, Callable[[PackageFiles], Files]], ...]] = {
    "package.found": (
        ("package_misnamed", manifest.misnamed_package),
        ("email_invalid", manifest.invalid_email),
    ),
    "package.builds": (
        ("syntax_error", manifest.broken_syntax),
        ("setup_raises", manifest.broken_setup),
        ("resource_file_missing", manifest.no_marker),
    ),
    "package.dependencies": (
        ("dependency_missing", manifest.missing_dependency),
        ("dependency_misspelt", manifest.misspelt_dependency),
        ("dependency_inside_export", manifest.dependency_inside_export),
    ),
}
_EXECUTABLE: tuple[tuple[str, Callable[[PackageFiles, str], Files]], ...] = (
    ("executable_misnamed", manifest.misnamed_entry_point),
    ("entry_point_missing", manifest.no_entry_point),
    ("entry_point_to_nothing", manifest.entry_point_to_nothing),
    ("not_installed", manifest.not_installed),
    ("setup_cfg_missing", lambda package, _: manifest.no_setup_cfg(package)),
)


def _of_package(
    bound: BoundCheck, loaded: LoadedAssignment, files: Mapping[str, bytes]
) -> Iterator[_Draft]:
    given: Any = bound.parameters
    name = getattr(given, "package", "")
    asked = next((one for one in loaded.assignment.packages if one.name == name), None)
    uses = bound.spec.uses or ""
    programs = asked.executables if asked else ()
    folder, package = _package(files, name, programs) if programs else ("", None)
    if package is None:
        return
    for kind, change in _PACKAGE.get(uses, ()):
        yield from _edited(kind, change.__doc__, (package.name,), folder, change(package))
    for kind, made in _EXECUTABLE if uses == "package.executable" else ():
        executable = given.executable
        changed = made(package, executable)
        # One file for all executables of a package.
        about = (package.name, "" if kind == "setup_cfg_missing" else executable)
        title = made.__doc__ or manifest.no_setup_cfg.__doc__
        yield from _edited(kind, title, about, folder, changed)


def _edited(
    kind: str, title: str | None, about: tuple[str, ...], folder: str, changed: Files
) -> Iterator[_Draft]:
    if changed:
        placed = {f"{folder}{path}": text for path, text in changed.items()}
        yield _Draft(kind, (title or kind).removesuffix("."), about, files=placed)


def _package(
    files: Mapping[str, bytes], name: str, executables: tuple[str, ...]
) -> tuple[str, PackageFiles | None]:
    """The folder of a package in a reference, and its files."""
    for path, content in files.items():
        if path.rpartition("/")[2] != "package.xml":
            continue
        tag = re.search(rb"<name>\s*([^<\s]+)\s*</name>", content)
        if tag and tag[1].decode() == name:
            folder = path.removesuffix("package.xml")
            inside = {one: data for one, data in files.items() if one.startswith(folder)}
            texts = {
                one.removeprefix(folder): data.decode("utf-8", "replace")
                for one, data in inside.items()
            }
            for file in ("package.xml", "setup.py"):
                _refuse_broken(f"{folder}{file}", texts.get(file, ""))
            return folder, PackageFiles(name, texts, executables)
    return "", None


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
    for wrong in _rule(bound)(run) if run.programs else ():
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


def _name(run: _Run) -> Iterator[_Wrong]:
    topic = run.given.topic
    other = misspelt(topic)
    yield _Wrong("topic_misspelt", f"The topic is {other}", topic, (("rename", topic, other),))


def _service_name(run: _Run) -> Iterator[_Wrong]:
    name = run.given.service
    other = misspelt(name)
    yield _Wrong("service_misspelt", f"The service is {other}", name, (("rename", name, other),))


def _type(run: _Run) -> Iterator[_Wrong]:
    topic = run.given.topic
    other = next(name for name in _OTHER_TYPES if name != run.given.type)
    yield _Wrong("type_wrong", f"The type is {other}", topic, (("type", topic, other),))
    if run.given.remap:
        yield from _name(run)


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
    topic, given = run.given.topic, run.given
    if given.kind == "publisher" and given.expect == "match":
        if given.reliability == "reliable":
            kind, other = "reliability", "best_effort"
            yield _Wrong(other, "The endpoint is best effort", topic, ((kind, topic, other),))
        if given.durability == "transient_local":
            kind, other = "durability", "volatile"
            yield _Wrong(other, "The endpoint is volatile", topic, ((kind, topic, other),))


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


def _alive(run: _Run) -> Iterator[_Wrong]:
    title = "An exception ends the program after 1 s"
    yield _Wrong("raises_after_one_second", title, "", (("raises", "executor", "1.0"),))
    lost = (run.id, *run.starved(run.periods))
    imposed = (("ends", "executor", "now"),)
    yield _Wrong("ends_at_once", "The program ends instead of spinning", "", imposed, lost)


def _ends(_: _Run) -> Iterator[_Wrong]:
    title = "The program ignores Ctrl+C"
    yield _Wrong("ignores_interrupt", title, "", (("ignores", "SIGINT", "always"),))


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
    slow, fast = (("period", "timers", "10"),), (("period", "timers", "0.001"),)
    # All timers of the program, and so all topics with a period.
    yield _Wrong("period_ten_times", "The period is ten times as long", "", slow)
    yield _Wrong("period_a_thousandth", "The period is a thousandth", "", fast)
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


_Rule = Callable[[_Run], Iterable[_Wrong]]


def _rule(bound: BoundCheck) -> _Rule:
    return _RULES.get(bound.spec.uses or "", _no_rule)


def _no_rule(_: _Run) -> Iterable[_Wrong]:
    return ()


_RULES: dict[str, _Rule] = {
    "topic.published": _name,
    "topic.subscribed": _name,
    "topic.type": _type,
    "service.exists": _service_name,
    "qos.offered": _qos,
    "qos.requested": _qos,
    "qos.compatible": _matching,
    "qos.depth": _depth,
    "node.exists": _node,
    "node.alive": _alive,
    "node.ends": _ends,
    "messages.count": _count,
    "messages.equal": _equal,
    "timing.period": _period,
    "executor.responsive": _responsive,
}
