"""What the models of all stimuli have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from grader.assignment.stimuli.message import Find
from grader.errors import GraderFault
from grader.spec.source import Model

S = TypeVar("S", bound="StimulusModel")


@dataclass(frozen=True)
class Making:
    """What the orders of a scenario are made with.

    Attributes:
        folder: Of the assignment.
        find: Finds the definitions of messages.
        drawn: Random values by name.
        processes: What is launched, each as ``package/executable``.
    """

    folder: Path
    find: Find
    seed: int
    drawn: Mapping[str, float]
    processes: Sequence[str]

    def process(self, executable: str, package: str | None) -> str:
        """The launched process of an executable, of any package by default.

        Raises:
            GraderFault: It is not launched.
        """
        for process in self.processes:
            its_package, _, its_executable = process.partition("/")
            if its_executable == executable and package in (None, its_package):
                return process
        raise GraderFault(f"a stimulus names {executable!r}, which the scenario does not launch")


class StimulusModel(Model):
    """Base of the models of stimuli, which lie in ``kinds/`` and are marked with :func:`kind`."""

    key: ClassVar[str]
    """The key of the YAML that tells it."""
    heading: ClassVar[str] = ""
    """Its heading in the documentation; by default the key."""

    @classmethod
    def accepts(cls, value: Mapping[str, Any]) -> bool:
        """Whether an entry with the key is of this kind, where several kinds share a key."""
        return True

    @property
    def has_end(self) -> bool:
        """Whether there is a moment after which it does nothing more."""
        return True

    @property
    def exchanged(self) -> tuple[str, str] | None:
        """The topic, service or action that it uses, and its type; or None."""
        return None

    def order(self, making: Making) -> dict[str, Any]:
        """What the cell is told, as plain JSON; ``kind`` is the ``order_type`` that plays it.

        Raises:
            StimulusError: A value does not fit.
            KeyError: The definition of a message is missing.
        """
        raise NotImplementedError


KINDS: list[type[StimulusModel]] = []


def kind(model: type[S]) -> type[S]:
    """Make a model a kind of stimulus."""
    KINDS.append(model)
    return model
