"""What the submissions of one assignment share while they are graded."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from grader.assignment.limits import BuildLimitOptions
from grader.assignment.load import LoadedAssignment
from grader.checks.check import Parameters
from grader.checks.need import Bags, Need, StudentTests
from grader.grade.naming import with_chosen_names
from grader.grading.own_interfaces import Definitions, own_packages
from grader.grading.type_support import TypeSupport
from grader.machine.load import cpu_count
from grader.recording.model import Recording
from grader.recording.submission import SubmissionRecord
from grader.run.admission import Admission
from grader.run.imposing.mistake import Mistake
from grader.run.runner import Runner
from grader.sandbox.python_tree import check_installed
from grader.submission.build.bounded import OutputLimits
from grader.submission.build.colcon import BuildLimits
from grader.submission.build.own_tests import LIBRARY
from grader.submission.prepare import Preparation

_N = TypeVar("_N", bound=Need)


@dataclass(frozen=True)
class Told:
    """Who is told how far a submission is.

    Attributes:
        progress: Called with what begins.
        output: Called with each line that the build prints.
        recorded: Called with what is known of a submission: when it is read, when it is built
            (``build`` is there then), and with its recordings so far after each of them.
    """

    progress: Callable[[str], None] = lambda _: None
    output: Callable[[str], None] = lambda _: None
    recorded: Callable[[SubmissionRecord, Mapping[str, Recording]], None] = lambda _, __: None


class Grading:
    """What submissions are graded with: an assignment, a runner, a cache, a place for builds.

    Attributes:
        seed: Of all scenarios; None for one that follows from the submission.
        first: Ids of scenarios that are started before the others.
        mistakes: Imposed on the programs; of selftest only.
    """

    def __init__(
        self,
        loaded: LoadedAssignment,
        runner: Runner,
        cache: Path,
        *,
        seed: int | None = None,
        first: Collection[str] = (),
        told: Told | None = None,
    ) -> None:
        """Set up; nothing is built yet."""
        self.loaded = loaded
        self.runner = runner
        self.seed = seed
        self.first = first
        self.told = told or Told()
        self.mistakes: tuple[Mistake, ...] = ()
        self._cache = cache
        self._bag_types = _bag_types(loaded)
        self._with_bags = self._bag_types != () or bool(list(_needed(loaded, Bags)))
        self._libraries = loaded.assignment.libraries
        if _tested(loaded):
            self._libraries += (LIBRARY,)
        check_installed(self._libraries)
        self._build_limits = _build_limits(loaded.assignment.build_limits)
        self._stop = threading.Event()
        self._type_support = self._new_support(loaded)
        # A build takes a CPU or more; too many would only slow down each other.
        self._builds = Admission(cells=cpu_count(), starts=cpu_count())

    def imposing(self, mistakes: tuple[Mistake, ...]) -> Grading:
        """The same, but that mistakes are imposed on the programs: for selftest only."""
        other = copy(self)
        other.mistakes = mistakes
        return other

    def preparation(self, given: tuple[tuple[str, str], ...], source: Path) -> Preparation:
        """How a submission is read and built.

        Args:
            given: What was said of its variables.
            source: Where its text files are kept.
        """
        say = self.told.progress
        ros = self._type_support.student(say)
        if not self.loaded.values:
            self._type_support.prefixes(say)
        sandbox = self.runner.sandbox

        def choose_tested(record: SubmissionRecord) -> frozenset[str]:
            self.told.recorded(record, {})
            named = with_chosen_names(self.loaded, replace(record, given=given))
            tested = map(named.submission.package, _tested(named.loaded))
            return frozenset(package.name for package in tested if package is not None)

        return Preparation(
            ros=ros,
            cache=self._cache,
            limits=self._build_limits,
            on_progress=say,
            sandbox=sandbox.allowing(self._libraries) if sandbox is not None else None,
            stop=self._stop,
            on_output=self.told.output,
            choose_tested=choose_tested,
            source_folder=source,
            with_bags=self._with_bags,
            bag_types=self._bag_types,
            needs_build=self.loaded.assignment.needs_build,
            place=self._build_place,
        )

    def type_support_of(
        self, loaded: LoadedAssignment, submission: SubmissionRecord
    ) -> TypeSupport:
        """What lies under a submission, with the names and interfaces that it chose."""
        own = own_packages(loaded, submission)
        is_shared = loaded is self.loaded and not own
        return self._type_support if is_shared else self._new_support(loaded, own)

    def _new_support(
        self, loaded: LoadedAssignment, own: Mapping[str, Definitions] = {}
    ) -> TypeSupport:
        return TypeSupport(loaded, self.runner.ros, self._cache, self._stop, own)

    @contextmanager
    def _build_place(self, alone: bool) -> Iterator[None]:
        """The place of one build; where it must be alone, no other one runs, and no cell."""
        cells = self.runner.admission.cell(alone=True) if alone else nullcontext()
        with self._builds.cell(alone=alone), cells:
            yield

    @property
    def surroundings(self) -> list[str]:
        """The sandbox that is in force, and what is sourced and not used: a line for each."""
        sandbox = self.runner.sandbox.description if self.runner.sandbox else "none"
        lines = [f"sandbox: {sandbox}"]
        if self.runner.ros.notice:
            lines.append(self.runner.ros.notice)
        return lines

    def close(self) -> None:
        """End every build and cell that runs; what is being graded ends as interrupted."""
        self._stop.set()
        self.runner.close()

    def cancel(self) -> Runner:
        """End every build and cell that runs; the next grading has the runner that is returned."""
        self._stop.set()
        return self.runner.successor()


def _tested(loaded: LoadedAssignment) -> frozenset[str]:
    """The packages whose own tests a check judges."""
    found = _needed(loaded, StudentTests)
    return frozenset(getattr(parameters, need.package) for parameters, need in found)


def _bag_types(loaded: LoadedAssignment) -> Collection[str] | None:
    """Types of the messages that scenarios judge of bags; None, for all, where one is not known."""
    read = [one for one in loaded.assignment.scenarios if one.bag is not None]
    if read and loaded.assignment.variables:
        return None
    return tuple({type for one in read for type in one.recorded_types.values()})


def _needed(loaded: LoadedAssignment, kind: type[_N]) -> Iterator[tuple[Parameters, _N]]:
    """The needs of one kind that checks have, with the parameters of each check."""
    for bound in loaded.checks:
        for need in bound.parameters.needs:
            if isinstance(need, kind):
                yield bound.parameters, need


def _build_limits(options: BuildLimitOptions) -> BuildLimits:
    room = options.limits()
    limits = BuildLimits(output=OutputLimits(total=room.output_bytes), room=room)
    if options.wall_time is not None:
        limits = replace(limits, python_s=options.wall_time, other_s=options.wall_time)
    return limits
