"""From what a student handed in to its record and, where it builds, an install space."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

from grader.errors import SubmissionError
from grader.machine.ros import RosInstallation
from grader.machine.tree import listing
from grader.recording.bag import KeptBag
from grader.recording.submission import SubmissionRecord
from grader.submission.build.build import Builder, once_more
from grader.submission.build.build_cache import BuildCache
from grader.submission.build.build_error_location import Sources
from grader.submission.build.colcon import BuildSetting
from grader.submission.build.installed import inspect
from grader.submission.build.standalone_build import standalone
from grader.submission.intake.archive import SUFFIXES
from grader.submission.intake.locate import Located, check_path, opened, submission_id
from grader.submission.intake.members import MIB
from grader.submission.intake.paths import shown
from grader.submission.kept_source import keep_source
from grader.submission.read.answers import read_answers
from grader.submission.read.bag import ReadBag, read_bags
from grader.submission.read.cpp import read_cpp
from grader.submission.read.document import read_headings
from grader.submission.read.package import Package, read_package
from grader.submission.read.package_record import record_packages
from grader.submission.read.parameter_file import read_parameter_files
from grader.submission.read.rosdistro import PACKAGES
from grader.submission.read.source import Allowance
from grader.submission.underlay.store import UnderlayStore

_MAX_PACKAGES = 200
_MOST_PATHS = 5000
_ARCHIVES = (*SUFFIXES, ".rar", ".7z")


@dataclass(frozen=True)
class Prepared:
    """A submission that is ready to run, or the record of why it is not.

    Attributes:
        install: Its install space (merged layout), read-only; also there when only some packages
            were built. None where nothing was.
        underlays: Install spaces under it.
        bags: What is kept of its bags, by their paths.
    """

    record: SubmissionRecord
    install: Path | None
    underlays: tuple[Path, ...] = ()
    bags: Mapping[str, KeptBag] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Preparation(BuildSetting):
    """How a submission is read and built, with what underlays the assignment names.

    Attributes:
        on_output: Called with the log of an earlier build, too.
        choose_tested: Packages whose own tests are run after the build, by what was read before it.
        source_folder: Where the text files of the submission are kept, or None.
        with_bags: Whether its bags are read.
        bag_types: Types of the messages that are kept of them; None for all.
        needs_build: Whether it is to hold packages, which are built.
        place: Entered for the time of the build, and with True for one that is repeated because of
            the machine: nothing else of rosgrade's is to run beside that.
    """

    cache: Path
    choose_tested: Callable[[SubmissionRecord], frozenset[str]] = lambda _: frozenset()
    source_folder: Path | None = None
    with_bags: bool = False
    bag_types: Collection[str] | None = ()
    needs_build: bool = True
    place: Callable[[bool], AbstractContextManager[object]] = nullcontext


def prepare(path: Path | str, how: Preparation) -> Prepared:
    """Find the packages of a submission, read them, build them.

    Nothing that a student can do wrong raises: it is in the record's ``problem``, in a package's
    ``manifest_error``, or in ``build``.

    Raises:
        UsageError: Nothing is at ``path``, or it is a URL.
        GraderFault: It cannot be graded here, for no fault of the student.
    """
    source = check_path(path)
    how.on_progress("reading the submission")
    installed = replace(how.ros, underlays=())
    store = UnderlayStore(how.cache, installed, how.on_progress, stop=how.stop)

    def attempt(is_second: bool) -> Prepared:
        with how.place(is_second), opened(source) as located:
            if how.source_folder is not None:
                keep_source(located.root, how.source_folder)
            # Before the build, which may change the private copy.
            bags = None
            if how.with_bags:
                bags = read_bags(located, how.ros, how.sandbox, how.bag_types)
            prepared = _prepare(located, how, store, is_second)
            return prepared if bags is None else _with_bags(prepared, bags)

    try:
        return once_more(attempt)
    except SubmissionError as error:
        return refused(source, error)


def _with_bags(prepared: Prepared, bags: Sequence[ReadBag]) -> Prepared:
    record = replace(prepared.record, bags=tuple(bag.record for bag in bags))
    kept = {bag.record.path: bag.kept for bag in bags if bag.kept is not None}
    return replace(prepared, record=record, bags=kept)


def refused(source: Path, error: SubmissionError) -> Prepared:
    """The record of something that cannot be read as a submission."""
    record = SubmissionRecord(submission_id(source), _hash(source), problem=str(error))
    return Prepared(record, None)


def needed_packages(path: Path, ros: RosInstallation) -> set[str]:
    """The packages of ROS 2 without which a submission is not built or does not run.

    What package.xml names and nothing uses is not among them: it may be large. There are none if
    the submission cannot be read.
    """
    allowance = Allowance()
    try:
        with opened(path) as located:
            folders = located.packages[:_MAX_PACKAGES]
            packages = [read_package(located, folder, ros, allowance) for folder in folders]
    except SubmissionError:
        return set()
    required = {name for package in packages for name in package.required_packages}
    return (required & PACKAGES) - {package.name for package in packages}


def fingerprint(path: Path | str) -> str:
    """The hash that :func:`prepare` will give a submission; nothing is built."""
    source = check_path(path)
    try:
        with opened(source) as located:
            return located.sha256
    except SubmissionError:
        return _hash(source)


def _hash(source: Path) -> str:
    """Hash of what was refused; of a folder, names and sizes stand for what is in the files."""
    total = hashlib.sha256()
    if source.is_dir():
        # Else an unreadable submission, or one without files, would get the hash of an empty one.
        total.update(b"refused\0")
        for line in sorted(listing(source)):
            total.update(os.fsencode(line.rpartition("\0")[0]) + b"\0")
    else:
        with source.open("rb") as file:
            while block := file.read(MIB):
                total.update(block)
    return total.hexdigest()


def _prepare(located: Located, how: Preparation, store: UnderlayStore, is_second: bool) -> Prepared:
    packages, record = _read(located, how)
    if record.problem is not None or not how.needs_build:
        return Prepared(record, None)
    possible = {name for package in packages for name in package.possible_packages}
    possible -= {package.name for package in packages}
    ros = store.completed(store.needed(how.ros, possible), possible)
    sources = Sources(
        files={file.path for file in located.files},
        folders={package.name: package.folder for package in packages},
        texts={path: lines for package in packages for path, lines in package.texts.items()},
    )
    setting = replace(how, ros=ros, tested=how.choose_tested(record))
    built = Builder(setting, BuildCache(how.cache), is_second).build(
        located,
        sources,
        only_python=all(package.build_type == "ament_python" for package in packages),
        standalone=standalone(packages, located.files),
    )
    if built.build.cached:
        for line in built.build.log.splitlines():
            how.on_output(line)
    installed = None
    if built.install is not None:
        hashes = {path: digest for p in packages for path, digest in p.hashes.items()}
        installed = inspect(built.install, sources.folders, hashes)
    record = replace(record, packages=record_packages(packages, ros, installed), build=built.build)
    return Prepared(record, built.install, ros.underlays)


def _read(located: Located, how: Preparation) -> tuple[list[Package], SubmissionRecord]:
    """The packages of a submission, and its record as far as there is one without a build."""
    allowance = Allowance()
    outlines = read_cpp(located, how.ros, how.sandbox)
    answers = read_answers(located.root, located.files)
    packages = [
        read_package(located, folder, how.ros, allowance, outlines)
        for folder in located.packages[:_MAX_PACKAGES]
    ]
    record = SubmissionRecord(
        located.id,
        located.sha256,
        find_problem(located, packages if how.needs_build else None),
        record_packages(packages, how.ros, None),
        leftovers=located.leftovers,
        files=tuple(shown(file.path) for file in located.files[:_MOST_PATHS]),
        headings=read_headings(located.root, located.files),
        answers=answers.names,
        answers_problem=answers.problem,
        parameter_files=read_parameter_files(located.root, located.files),
    )
    return packages, record


def find_problem(located: Located, packages: Sequence[Package] | None) -> str | None:
    """Why a submission cannot be built at all, in words for its author; None if it can.

    Args:
        packages: None where none are needed.
    """
    if not located.files:
        return "the submission is empty"
    if packages is None:
        return None
    if not packages:
        return _no_package(located)
    if len(located.packages) > _MAX_PACKAGES:
        return f"the submission holds more than {_MAX_PACKAGES} packages"
    places: dict[str, str] = {}
    for package in packages:
        other = places.setdefault(package.name, package.folder)
        if other != package.folder:
            return (
                f"two packages are called {package.name}: {shown(other)} and "
                f"{shown(package.folder)}; hand in one of them"
            )
    return None


def _no_package(located: Located) -> str:
    paths = [file.path for file in located.files]
    archives = [path for path in paths if path.lower().endswith(_ARCHIVES)]
    submodules = [path for path in paths if path.rpartition("/")[2] == ".gitmodules"]
    problem = (
        "no package.xml was found, so there is no ROS package (hidden folders, build, install, log "
        "and folders with a COLCON_IGNORE do not count)"
    )
    if submodules:
        return (
            f"{problem}; {shown(submodules[0])} names a git submodule, whose files were not handed "
            "in: run `git submodule update --init`, or clone with --recurse-submodules"
        )
    if archives:
        return f"{problem}; unpack {shown(archives[0])}, and hand in its content"
    if all(path.endswith(".py") for path in paths):
        return f"{problem}; hand in the whole package, not only its Python files"
    return problem
