"""A part of a contract where it stands, and what a contract can say of such a part."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

from grader.assignment.contract.model import (
    Connection,
    Contract,
    ContractPackage,
    Interface,
    Part,
    Program,
    Publication,
)
from grader.findings.fields import each_field, wanted_words
from grader.findings.text import is_asked_of_text
from grader.findings.words import Words, listing
from grader.spec.document import Place

ANY = "any"
Asked = dict[str, Any] | None
"""The parameters of a check, or None where the contract does not say it."""
_P = TypeVar("_P", bound=Part)


@dataclass(frozen=True)
class Fact:
    """A thing that a contract says of a part, and the standard check of it.

    Attributes:
        name: Its id, before the prefix of its part.
        asked: Gives what the check is asked about a part.
        requires: Facts whose checks must pass first, of this part or of those around it.
        weight: Its share of the points, where the contract gives only their sum.
        requires_in_depends: The same of this package, else of packages that it depends on.
        may_take_remap_over: Whether its check puts a nearly right name right, where the check
            before it that does so is not judged.
        is_before_runs: Whether its check is judged without a scenario though it is a program's.
    """

    name: str
    uses: str
    asked: Callable[[Spot], Asked]
    title: str
    hint: str | Words
    requires: tuple[str, ...] = ()
    weight: int = 1
    requires_in_depends: tuple[str, ...] = ()
    may_take_remap_over: bool = False
    is_before_runs: bool = False


@dataclass(frozen=True)
class Spot:
    """A part of a contract with its name and all that it lies in.

    Attributes:
        name: Of a topic, a service, an interface ...; of a program or a package its own name.
        around: The parts that it lies in, the innermost first.
    """

    contract: Contract
    place: Place
    part: Part
    name: str
    package: str
    executable: str = ""
    around: tuple[Spot, ...] = field(default=(), repr=False)

    def part_as(self, kind: type[_P]) -> _P:
        """The part, which is of this kind."""
        assert isinstance(self.part, kind)
        return self.part

    @property
    def of_package(self) -> ContractPackage:
        """The package that it lies in."""
        return self.contract.packages[self.package]

    @property
    def program(self) -> Program:
        """The program that it lies in."""
        return self.of_package.executables[self.executable]

    @property
    def interface(self) -> str:
        """The full name of an interface, such as ``bot_msgs/msg/BotStatus``."""
        return f"{self.package}/{self.name}"

    @cached_property
    def words(self) -> Mapping[str, str]:
        """What stands in the places of titles and hints, such as ``{name}``."""
        type_ = str(getattr(self.part, "type", ""))
        words = {
            "package": self.package,
            "executable": self.executable,
            "name": self.name,
            "of_package": f" {self.package}" if len(self.contract.packages) > 1 else "",
            "type": type_,
            "short": type_.rpartition("/")[2],
            "cpp_type": type_.replace("/", "::"),
            **self._words_of_program(),
        }
        if isinstance(self.part, Connection):
            words["qos"] = listing(value.replace("_", " ") for value in self.part.qos.values())
            words["depth"] = str(self.part.depth)
        if isinstance(self.part, Publication):
            words |= _words_of_publication(self.part)
            words["on"] = f" on {self.name}" if len(self.program.publishes) > 1 else ""
        if isinstance(self.part, Interface):
            words["interface"] = self.interface
            words["file"] = f"{self.name}.{self.name.split('/')[0]}"
        return words

    def _words_of_program(self) -> dict[str, str]:
        """Words about the program; which one is meant is said only where there are several."""
        is_one_of_several = len(self.contract.programs) > 1 and self.executable
        words = {
            "whose": f"of {self.executable} " if is_one_of_several else "",
            "subject": self.executable if is_one_of_several else "The node",
            "program": self.executable if is_one_of_several else "The program",
        }
        if self.executable:
            alone = len(self.of_package.executables) == 1
            words["module"] = module_of(self.package, self.executable, alone=alone)
            words["node"], words["ends"] = self.program.node, str(self.program.ends)
        return words


def _words_of_publication(part: Publication) -> dict[str, str]:
    is_one = part.count == 1
    fields = [
        f"{name}{' that' if is_asked_of_text(value) else ''} {wanted_words(value)}"
        for name, value in each_field(part.value)
    ]
    return {
        "count": "one message" if is_one else f"{part.count} messages",
        "are": "is" if is_one else "are",
        "period": str(period_of(part).get("period")),
        "rate": rate_words(part),
        "value": listing(fields),
    }


def module_of(package: str, executable: str, *, alone: bool) -> str:
    """The module of a program: called like its package if it is the only one in it."""
    return package if alone else re.sub(r"\W", "_", executable.removesuffix(".py"))


def period_of(part: Publication) -> dict[str, Any]:
    """The parameters of ``timing.period``; none where the contract says no period."""
    if part.period is None:
        return {}
    return part.period if isinstance(part.period, dict) else {"period": part.period}


def rate_words(part: Publication) -> str:
    """How often messages come, such as ``at least 9 Hz and at most 11 Hz``."""
    limits = {"at_least": "at least", "at_most": "at most"}
    return listing(f"{text} {part.rate[key]}" for key, text in limits.items() if key in part.rate)
