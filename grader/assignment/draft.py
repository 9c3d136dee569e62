"""An assignment.yaml as far as it could be read, so that all its mistakes show at once."""

from __future__ import annotations

from dataclasses import dataclass

from grader.assignment.model import CheckSpec, Package, Scenario
from grader.spec.source import Source


@dataclass(frozen=True)
class Draft:
    """The parts of an assignment, each read alone.

    Attributes:
        packages: One per entry; None where the entry itself has a mistake.
    """

    source: Source
    packages: tuple[Package | None, ...]
    scenarios: tuple[Scenario | None, ...]
    checks: tuple[CheckSpec | None, ...]

    @classmethod
    def of(cls, source: Source) -> Draft:
        """Read every entry of a document by itself."""
        return cls(
            source,
            tuple(
                source.examine(Package, ("packages", index))[0]
                for index in range(len(source.entries("packages")))
            ),
            tuple(
                source.examine(Scenario, ("scenarios", index))[0]
                for index in range(len(source.entries("scenarios")))
            ),
            tuple(
                source.examine(CheckSpec, ("checks", index))[0]
                for index in range(len(source.entries("checks")))
            ),
        )

    def names(self, key: str, name: str = "id") -> list[str | None]:
        """What each entry of a list calls itself, also where the entry has a mistake."""
        return [_name(entry, name) for entry in self.source.entries(key)]

    def package(self, name: str) -> Package | None:
        """The package of a name, if it could be read."""
        return next((one for one in self.packages if one is not None and one.name == name), None)

    def scenarios_of(self, spec: CheckSpec) -> list[Scenario] | None:
        """The scenarios that a check judges, or None where one of them has a mistake."""
        wanted = [
            scenario
            for scenario, name in zip(self.scenarios, self.names("scenarios"), strict=True)
            if not spec.scenarios or name in spec.scenarios
        ]
        known = [scenario for scenario in wanted if scenario is not None]
        return known if len(known) == len(wanted) else None


def _name(entry: object, key: str) -> str | None:
    value = entry.get(key) if isinstance(entry, dict) else None
    return value if isinstance(value, str) else None
