"""What the models of all stimuli have in common."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

from grader.assignment.stimuli.message import Find, StimulusError
from grader.checks.need import Act
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Model

S = TypeVar("S", bound="StimulusModel")


class ScenarioOfStimuli(Protocol):
    """What a stimulus needs to know of its scenario to find its own mistakes."""

    @property
    def stimuli(self) -> Sequence[StimulusModel]:
        """All stimuli, itself among them."""

    @property
    def simulated_robots(self) -> Mapping[str, Any]:
        """The simulated robots by name; where there is only one, its name is empty."""

    @property
    def recorded_types(self) -> Mapping[str, str]:
        """Types of the recorded topics, by topic."""


@dataclass(frozen=True)
class Preparation:
    """What the stimuli of a scenario are prepared from, before a cell plays them.

    Attributes:
        folder: Of the assignment.
        find: Finds the definitions of messages.
        drawn: Values of the scenario by name, which ``$name`` stands for.
        processes: What is launched, each as ``package/executable``.
    """

    folder: Path
    find: Find
    seed: int
    drawn: Mapping[str, float]
    processes: Sequence[str]

    def process(self, key: str, executable: str, package: str | None) -> str:
        """The launched process of an executable, of any package by default."""
        ending = f"/{executable}" if package is None else f"/{package}/{executable}"
        fitting = [process for process in self.processes if f"/{process}".endswith(ending)]
        if len(fitting) == 1:
            return fitting[0]
        executables = [process.partition("/")[2] for process in self.processes]
        advice = nearest_or_all(executable, executables)
        text = f"the scenario launches {executable!r} {len(fitting)} times, not once.{advice}"
        raise StimulusError(text, (key,))


Models = dict[str, type[Model]]
"""Heading in the documentation -> model."""


class StimulusModel(Model):
    """Base of the models of stimuli, which lie in ``kinds/`` and are marked with :func:`kind`.

    A model has a field that is called like its key and holds what it acts on, such as the topic in
    ``publish: /cmd_vel``. If it exchanges messages, their type is in a field ``type``; if it waits
    for answers, a field ``within`` says how long.
    """

    key: ClassVar[str]
    """The key of the YAML that names the kind."""
    heading: ClassVar[str] = ""
    """Its heading in the documentation; by default the key."""
    nested_models: ClassVar[Models] = {}
    """The models of what stands below one of its keys."""
    provides: ClassVar[tuple[Act, ...]] = ()
    """What it does to its subject, for the checks that need it."""

    @classmethod
    def accepts(cls, value: Mapping[str, Any]) -> bool:
        """Whether an entry with the key is of this kind, where several kinds share a key."""
        return True

    @property
    def has_end(self) -> bool:
        """Whether there is a moment after which it does nothing more."""
        return True

    @property
    def subject(self) -> str:
        """Its topic, service, action or node, or another name that checks call it by."""
        return str(getattr(self, self.key))

    @property
    def exchanged(self) -> tuple[str, str] | None:
        """The topic, service or action that it uses, and its type; or None."""
        interface = getattr(self, "type", None)
        return None if interface is None else (getattr(self, self.key), interface)

    @property
    def sent_fields(self) -> Sequence[Mapping[str, Any]]:
        """Fields of each request or goal that it sends, or the parameters that it sets."""
        return ()

    @property
    def frames(self) -> Collection[tuple[str, str]]:
        """Parent and child of each transform that it publishes."""
        return ()

    @property
    def patience_s(self) -> float:
        """How long it waits for an answer."""
        return float(getattr(self, "within", math.inf))

    def sends(self, fields: Mapping[str, Any]) -> bool:
        """Whether one of its requests has all these fields, as both are written in the YAML."""
        return any(
            all(request.get(name) == value for name, value in fields.items())
            for request in self.sent_fields
        )

    def differs_in(self, key: str) -> bool:
        """Whether it has a key with another value than the default."""
        return bool(getattr(self, key) != type(self).model_fields[key].default)

    def prepared(self, preparation: Preparation) -> StimulusModel:
        """What a cell plays: this stimulus with its values read, drawn and found.

        Raises:
            StimulusError: A value does not fit.
            KeyError: The definition of a message is missing.
        """
        return self

    def mistakes(
        self, preparation: Preparation, scenario: ScenarioOfStimuli
    ) -> Iterator[tuple[Place, str]]:
        """Mistakes that show without a run; by default, that it cannot be prepared."""
        try:
            self.prepared(preparation)
        except StimulusError as error:
            yield error.place, str(error)
        except KeyError:
            # The definition is of a package that is not installed here.
            return


KINDS: list[type[StimulusModel]] = []


def kind(model: type[S]) -> type[S]:
    """Make a model a kind of stimulus."""
    KINDS.append(model)
    return model
