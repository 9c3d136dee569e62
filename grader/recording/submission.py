"""What is known of a submission before anything of it runs: plain facts, ready for judging.

These facts travel inside every recording, so that a regrade needs neither the student's
files nor ROS. All paths are relative to the submission, with forward slashes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from grader.errors import UsageError
from grader.recording.old_names import names_of_record
from grader.spec.names import NO_NAMES, Names, Thing

PYTHON, CPP = "Python", "C++"
"""What programs of students are written in."""
EMPTY = "the file is empty"
"""What is wrong with a file that must have something in it."""
_OF_CPP = (".cpp", ".cc", ".cxx", ".c")


@dataclass(frozen=True)
class SourceError:
    """A mistake at a place in the student's files; lines count from 1."""

    file: str
    line: int | None
    message: str

    def __str__(self) -> str:
        """Write ``file:line: message``."""
        place = f"{self.file}:{self.line}" if self.line else self.file
        return f"{place}: {self.message}"


@dataclass(frozen=True)
class Import:
    """A Python module that a package's code imports.

    Attributes:
        module: Top-level name, such as ``geometry_msgs``.
        optional: Guarded by ``try`` or ``if TYPE_CHECKING``: the code runs without it.
    """

    module: str
    file: str
    line: int
    optional: bool = False


@dataclass(frozen=True)
class Dependency:
    """An entry of package.xml (REP-149).

    Attributes:
        kind: The tag: ``depend``, ``exec_depend``, ``build_depend``, ``test_depend``, ... An
            ``export/depend`` stands inside <export>, where it does not count.
        known: True for a ROS package or rosdep key that exists, False for a mistyped one or a
            name that is known not to exist, None where this machine cannot tell.
    """

    name: str
    kind: str
    line: int | None = None
    known: bool | None = None


@dataclass(frozen=True)
class Definition:
    """The definition of an interface, or a file that seems to be meant as one.

    The file of a generated one is relative to ``share/<package>``.
    """

    file: str
    text: str


@dataclass(frozen=True)
class SourceClass:
    """A class.

    Attributes:
        name: Qualified in its module, such as ``Outer.Inner`` or ``make.<locals>.Bot``; in C++ with
            its namespaces, such as ``robots::Rover``.
        bases: As written: ``Node``, ``rclpy.node.Node``; of a call such as ``mixed(Node)`` the
            names in it. In C++ without the arguments of templates.
        end: Its last line; 0 in older records.
        metaclass: In Python, as written.
        fields: Attributes and member variables that it declares or, in Python, that its methods
            assign to ``self``; each with the line where it is first.
    """

    name: str
    line: int
    bases: tuple[str, ...] = ()
    documented: bool = False
    end: int = 0
    metaclass: str = ""
    fields: tuple[tuple[str, int], ...] = ()

    @property
    def short(self) -> str:
        """The name alone."""
        return _last(self.name)


@dataclass(frozen=True)
class SourceFunction:
    """A function or method.

    In C++ this is a method in its class, also where it is only declared there, and the definition
    of a method or function elsewhere; of other declarations, those with a comment for Doxygen.

    Attributes:
        name: Qualified in its module, such as ``Bot.callback`` or ``main.<locals>.help``; in C++
            with its namespaces, such as ``robots::Rover::drive``.
        documented: By a docstring; in C++ by a comment for Doxygen.
        unannotated: Parameters without a type hint; ``self`` and ``cls`` are left out.
        virtual: In C++, whether it is called so, or says that it overrides.
        pure: It has no body that could be called: ``= 0``, ``@abstractmethod``.
        overriding: In C++, whether it is marked ``override`` or ``final``.
        parameters: Number of them, in C++.
        public: In C++, whether it is neither private or protected nor in a namespace without name.
    """

    name: str
    line: int
    documented: bool = False
    decorators: tuple[str, ...] = ()
    unannotated: tuple[str, ...] = ()
    returns: bool = False
    virtual: bool = False
    pure: bool = False
    overriding: bool = False
    parameters: int | None = None
    public: bool = True

    @property
    def short(self) -> str:
        """The name alone."""
        return _last(self.name)


@dataclass(frozen=True)
class SourceCall:
    """A call of a function.

    Attributes:
        name: As written: ``self.create_publisher``, ``std::this_thread::sleep_for``; without the
            arguments of templates, and with ``.`` for ``->``.
        literal: The first argument that is a text and could be a name, such as ``/cmd_vel``.
    """

    name: str
    line: int
    literal: str = ""

    @property
    def short(self) -> str:
        """The name of the function alone."""
        return _last(self.name)


@dataclass(frozen=True)
class SourceFile:
    """A file of Python that runs, or of C++; at most 2000 of each kind of thing in it.

    Attributes:
        module: Dotted name that it is imported by, such as ``bot.node``; empty in C++.
        names: What imports and plain assignments name: local name -> dotted name. In C++ what
            ``using``, ``typedef`` and aliases of namespaces do.
        stars: Modules of ``from module import *``; namespaces of ``using namespace``.
        prints: Lines with ``print`` to the console; in C++ with ``std::cout``, ``printf``, ...
        uses: Attributes that it reads, such as ``publish``, and strings that could name one; in C++
            functions that it calls.
        sets: Attributes that it assigns to, as written: ``msg.linear.x``, each with its line.
        calls: What it calls.
        constructs: ``global`` and ``import *`` in Python; ``using namespace std``, ``goto``,
            ``new``, ``delete`` and ``#define`` (of a value) in C++; each with its line.
        includes: Headers that C++ includes, each with its line, and whether a condition may leave
            it out.
        unread: From where on, and why, it could not be read; of C++ only.
    """

    path: str
    module: str
    documented: bool = False
    classes: tuple[SourceClass, ...] = ()
    functions: tuple[SourceFunction, ...] = ()
    names: tuple[tuple[str, str], ...] = ()
    stars: tuple[str, ...] = ()
    prints: tuple[int, ...] = ()
    uses: tuple[str, ...] = ()
    sets: tuple[tuple[str, int], ...] = ()
    language: str = PYTHON
    calls: tuple[SourceCall, ...] = ()
    constructs: tuple[tuple[str, int], ...] = ()
    includes: tuple[tuple[str, int, bool], ...] = ()
    unread: SourceError | None = None


def _last(name: str) -> str:
    return name.replace("::", ".").rpartition(".")[2]


@dataclass(frozen=True)
class LintFinding:
    """A place that breaks a rule; its code is such as ``F401``."""

    code: str
    file: str
    line: int
    message: str


@dataclass(frozen=True)
class Lint:
    """What ruff says of a package: at most 20 findings of each rule, or why there are none."""

    problem: str | None = None
    findings: tuple[LintFinding, ...] = ()


@dataclass(frozen=True)
class PackageRecord:
    """One ament package of a submission.

    Attributes:
        path: Folder in the submission (``.`` for the submission itself).
        build_type: ``ament_python``, ``ament_cmake``, ...
        manifest_error: Why package.xml cannot be used (broken XML, invalid e-mail), or None.
        imports: What its Python code imports; tests, launch files and setup.py left aside.
        ros_imports: Those that belong to a ROS package, with its name in ``module``; of a package
            in C++ the packages whose headers it includes and that CMakeLists.txt links.
        own_headers: A file of its C++ -> a header of its own that the file includes.
        newer_syntax: Other files, that only the Python of ROS 2 Jazzy can parse.
        entry_points: console_scripts: executable -> ``module:function``.
        executables: What the build installed for ``ros2 run``, in ``lib/<package>/``.
        misplaced_executables: What it installed elsewhere (a wrong setup.cfg): paths in the install
            space, such as ``lib/other/bot``; in older records names in ``bin/``.
        missing_targets: Executables whose ``module:function`` does not exist, with what is wrong.
        files: Python files as installed -> path in the submission; relative to site-packages
            (``bot_publisher/node.py``), or ``lib/<package>/...`` for scripts.
        description: Text of package.xml.
        maintainers: Names and e-mail addresses in package.xml, as ``name <e-mail>``.
        licenses: Licences in package.xml.
        groups: Groups that package.xml makes it a member of (REP-149).
        cmake: Its CMakeLists.txt, or None.
        definitions: Its ``.msg``, ``.srv`` and ``.action`` files, and others beside them.
        shared: What it installed in ``share/<package>/``, by paths in there -> path in the
            submission of a Python file such as a launch file, else an empty text; at most 1000.
        registered: Whether ROS finds what was installed, in ament's index of packages.
        sources: What its code says; tests, launch files and setup.py left aside.
        lint: What ruff says of the same files, or None where it did not run.
    """

    name: str
    path: str
    build_type: str = "ament_python"
    manifest_error: SourceError | None = None
    dependencies: tuple[Dependency, ...] = ()
    imports: tuple[Import, ...] = ()
    ros_imports: tuple[Import, ...] = ()
    own_headers: tuple[tuple[str, str], ...] = ()
    syntax_errors: tuple[SourceError, ...] = ()
    newer_syntax: tuple[SourceError, ...] = ()
    entry_points: tuple[tuple[str, str], ...] = ()
    executables: tuple[str, ...] = ()
    misplaced_executables: tuple[str, ...] = ()
    missing_targets: tuple[tuple[str, SourceError], ...] = ()
    files: tuple[tuple[str, str], ...] = ()
    description: str = ""
    maintainers: tuple[str, ...] = ()
    licenses: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    cmake: str | None = None
    definitions: tuple[Definition, ...] = ()
    generated: tuple[Definition, ...] = ()
    shared: tuple[tuple[str, str], ...] = ()
    registered: bool = True
    sources: tuple[SourceFile, ...] = ()
    lint: Lint | None = None

    def misplaced(self, executable: str) -> str:
        """Path in the install space of an executable that is in a wrong folder, or nothing."""
        paths = (one if "/" in one else f"bin/{one}" for one in self.misplaced_executables)
        return next((one for one in paths if one.rpartition("/")[2] == executable), "")

    def file(self, name: str) -> str:
        """Path in the submission of a file of the package."""
        return name if self.path in ("", ".") else f"{self.path}/{name}"


@dataclass(frozen=True)
class PytestRecord:
    """A run of the student's own tests of a package.

    Attributes:
        problem: Why pytest did not come to its end, or None.
        failed: Tests that failed, with the error; at most 100.
    """

    package: str
    passed: int = 0
    failed: tuple[tuple[str, str], ...] = ()
    problem: str | None = None


@dataclass(frozen=True)
class BuildRecord:
    """What ``colcon build`` did.

    Attributes:
        duration_s: Wall time of the build when it ran, also when taken from the cache now.
        timed_out: It did not end in the time that it may have for itself.
        failed_packages: Packages that failed, or that colcon never began.
        lacking: What the build needs of ROS and its tools, and this machine does not have whole.
        culprit: The student's file and line that the log names first, or None.
        log: The end of colcon's output, student's paths mapped back, at most 64 KiB.
        tests: Runs of the tests that the assignment asks for, of packages that were built.
        waited: Whether a build that timed out waited for something; False if it computed, None if
            that was not measured.
    """

    succeeded: bool
    duration_s: float
    cached: bool = False
    timed_out: bool = False
    failed_packages: tuple[str, ...] = ()
    lacking: tuple[str, ...] = ()
    culprit: SourceError | None = None
    log: str = ""
    tests: tuple[PytestRecord, ...] = ()
    waited: bool | None = None


@dataclass(frozen=True)
class BagTopic:
    """A topic in a bag."""

    name: str
    type: str
    messages: int


@dataclass(frozen=True)
class BagRecord:
    """A bag as ``ros2 bag record`` writes it.

    Attributes:
        path: Folder of its metadata.yaml.
        problem: Why it cannot be read to its end, or None.
        distro: The ROS distribution that recorded it; empty if it does not say that.
        lost: How many messages it does not have, although its metadata.yaml counts them.
        sha256: Of its messages that a scenario may judge; empty where none are read.
    """

    path: str
    problem: str | None = None
    duration_s: float = 0.0
    topics: tuple[BagTopic, ...] = ()
    distro: str = ""
    lost: int = 0
    sha256: str = ""


@dataclass(frozen=True)
class ParameterFile:
    """A file with parameters for nodes.

    Attributes:
        nodes: Full name of a node, or a pattern such as ``/**`` -> line of its parameters.
    """

    path: str
    nodes: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class SubmissionRecord:
    """Everything known of a submission before it runs.

    Attributes:
        problem: Why nothing can be graded (empty, not a workspace, refused archive), or None.
        leftovers: What builds and runs made and was handed in too, such as ``build``.
        files: Paths of what was handed in; at most 5000.
        headings: Path of each text (Markdown, reStructuredText) -> its headings.
        bags: Recordings of ``ros2 bag record``; None where no check asked for them.
        build: None where nothing was built.
        given: Variable of the assignment -> its value, from the roster or from `--set`.
        answers: Free name of the assignment -> what the submission itself says is meant by it.
        answers_problem: Why that cannot be read, with the line, or None.
        parameter_files: Files in YAML that give parameters to nodes; at most 50.
        names: Wrong names of packages; the others are judged and run in their place.
    """

    id: str
    sha256: str
    problem: str | None = None
    packages: tuple[PackageRecord, ...] = ()
    build: BuildRecord | None = None
    leftovers: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    headings: tuple[tuple[str, tuple[str, ...]], ...] = ()
    bags: tuple[BagRecord, ...] | None = None
    given: tuple[tuple[str, str], ...] = ()
    answers: tuple[tuple[str, str], ...] = ()
    answers_problem: str | None = None
    parameter_files: tuple[ParameterFile, ...] = ()
    names: Names = NO_NAMES

    @property
    def foreign_imports(self) -> frozenset[str]:
        """Top-level modules that its code imports and that belong to no ROS package."""
        return frozenset(
            item.module
            for package in self.packages
            for item in package.imports
            if (item.file, item.line) not in {(ros.file, ros.line) for ros in package.ros_imports}
        )

    def language(self, package: PackageRecord) -> str:
        """The language of its programs: Python, C++, or nothing if it has none, as interfaces."""
        files = (path for path in self.files if path.startswith(package.file("")))
        is_compiled = any(path.endswith(_OF_CPP) for path in files)
        of_python = any(source.language == PYTHON for source in package.sources)
        imported = {item.module for item in package.imports}
        if package.build_type == "ament_python" or "rclpy" in imported:
            return PYTHON
        if is_compiled:
            return CPP
        return PYTHON if of_python else ""

    def spoken(self, names: Iterable[str]) -> str:
        """The language to speak of packages in: C++ if their programs are all in it, or Python.

        If they have no programs, those of the whole submission decide.
        """
        named = [package for name in names if (package := self.package(name))]
        for packages in (named, self.packages):
            languages = {self.language(package) for package in packages} - {""}
            if languages:
                return CPP if languages == {CPP} else PYTHON
        return PYTHON

    def package(self, name: str) -> PackageRecord | None:
        """The package of that name, or what stands in for it; else None."""
        own = self.names.own(Thing.PACKAGE, name)
        return next((package for package in self.packages if package.name == own), None)


_RECORD = TypeAdapter(SubmissionRecord)


def record_of(data: bytes) -> SubmissionRecord:
    """The record in some JSON; a ValidationError says that it holds none."""
    record = _RECORD.validate_json(data)
    names = names_of_record(data)
    return replace(record, names=names) if names else record


def read_record(file: Path) -> SubmissionRecord:
    """Read a record from a JSON file.

    Raises:
        UsageError: It cannot be read, or holds no record.
    """
    try:
        return record_of(file.read_bytes())
    except (OSError, ValidationError) as error:
        raise UsageError(f"{file}: is not the record of a submission: {error}") from error
