"""Whose file and line a build log blames first."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from grader.submission.intake.paths import is_within, join, shown
from grader.submission.record import SourceError

_STARTED = re.compile(r"Starting >>> (\S+)")
_TRACEBACK = "Traceback (most recent call last):"
_FRAME = re.compile(r'\s*File "([^"]+)", line (\d+)')
_SYNTAX_ERROR = re.compile(r"(SyntaxError|IndentationError|TabError): .+")
_CMAKE = re.compile(r"CMake Error at (.+?):(\d+)(?: \((\w+)\))?:")
_CMAKE_PLAIN = re.compile(r"CMake Error: (.+)")
_CMAKE_CALLER = re.compile(r"\s+(\S+):(\d+) \(\w+\)")
_COMPILER = re.compile(r"([^\s:]+):(\d+)(?::\d+)?: (?:fatal )?error: (.+)")
_MANIFEST = re.compile(r"(?:\S*InvalidPackage: )?Error\(s\) in package '([^']+)':")
_SETUPTOOLS = re.compile(r"error: (.+)")
_NO_SETUP_PY = re.compile(r".*can't open file '[^']*setup\.py'")
_NEVER_CALLED = "setup()' was never called"
_QUOTED = re.compile(r"'([^']+)'")
_CONFIG = re.compile(r"'setup\.cfg'[\s,]*\[?line:?\s*(\d+)")
_BOM = r"\ufeff"
"""As the reader of setup.cfg shows it."""
_HAS_BOM = (
    "begins with a byte order mark (BOM), so its first section is not found: save it as UTF-8 "
    "without BOM"
)
_RUN_SETUP = ", in run_setup"
_INTERFACE = re.compile(r"Error processing '([^']+)' of package '[^']+': (.+)")
_INSTALLED = re.compile(r"(?:install|build/[^/]+/build)/lib/(?:python3[^/]*/site-packages/)?(.+)")
_IDENTIFYING = re.compile(r"ERROR:.*Exception in package identification extension '\w+' in '(.+?)'")
_NO_CMAKELISTS = "does not appear to contain CMakeLists.txt"
_ABSOLUTE_DATA = "os.path.isabs(dest)"
_READ_OUTPUT = "ast.literal_eval(output)"
_DIED = re.compile(r"(?=.*setup\.py).* died with <Signals\.(\w+): \d+>")
_INTERFACES = (".msg", ".srv", ".action")
# What colcon and make say of a program that failed, and not that program itself.
_AROUND = re.compile(
    r"g?make(\[\d+\])?: |ninja: |---( |$)|(Failed|Aborted) +<<<|Summary:|\s+\d+ pack"
)
_ERROR = re.compile(r"\berror\b|undefined reference", re.IGNORECASE)
_MAX_MESSAGE = 500
_MOST_QUOTED = 10
_MOST_LINES = 10_000
"""Of a file, in which a quoted name is looked for."""


@dataclass(frozen=True)
class Sources:
    """What the search needs to know of the submission.

    Attributes:
        texts: Lines of each setup.py and interface file, in which quoted names are looked up.
    """

    files: Collection[str]
    folders: Mapping[str, str]
    texts: Mapping[str, Sequence[str]] = field(default_factory=dict)
    malformed: Mapping[str, tuple[SourceError, ...]] = field(default_factory=dict)
    manifest_errors: Mapping[str, SourceError] = field(default_factory=dict)


def find_build_error(log: str, failed: Collection[str], sources: Sources) -> SourceError | None:
    """Find the first place in the student's own files that a cleaned log blames.

    Args:
        failed: Packages that were not finished; what the log says of others is no reason.

    Returns:
        For a Python traceback the deepest frame in the student's files. None where the log
        blames no file of the student.
    """
    lines = log.splitlines()
    package = ""
    for number, line in enumerate(lines):
        started = _STARTED.match(line)
        if started:
            package = started[1]
        elif package in failed or not package:
            blamed = _Place(lines, number, package, sources).blamed()
            if blamed is not None:
                message = shown(blamed.message)[:_MAX_MESSAGE]
                return SourceError(shown(blamed.file), blamed.line, message)
    return None


def last_started(log: str, sources: Sources, problem: str | None) -> SourceError | None:
    """Blame the build file of the package that was being built when the log ends.

    Args:
        problem: Why the build ended, or None where only the log tells.
    """
    # What a build file prints may look like colcon's own lines.
    started = [item for item in _STARTED.finditer(log) if item[1] in sources.folders]
    if not started:
        return None
    folder = sources.folders[started[-1][1]]
    message = problem or _last_words(log[started[-1].end() :])
    files = [join(folder, name) for name in ("setup.py", "CMakeLists.txt", "package.xml")]
    file = next((file for file in files if file in sources.files), files[-1])
    return SourceError(shown(file), None, message)


def _last_words(log: str) -> str:
    """The first line of a package's log that tells of an error, or its last line."""
    said = [line.strip() for line in log.splitlines() if line.strip() and not _AROUND.match(line)]
    errors = [line for line in said if _ERROR.search(line)]
    return (errors[0] if errors else said[-1] if said else "it says nothing")[:_MAX_MESSAGE]


@dataclass(frozen=True)
class _Place:
    """A line of the log, with what stands around it."""

    lines: list[str]
    number: int
    package: str
    sources: Sources

    @property
    def line(self) -> str:
        return self.lines[self.number]

    @property
    def setup_py(self) -> str:
        return join(self.sources.folders.get(self.package, "."), "setup.py")

    def blamed(self) -> SourceError | None:
        """Whom this line blames, if it is a message that blames somebody."""
        line = self.line
        if line.rstrip().endswith(_TRACEBACK):
            return self._traceback()
        if match := _FRAME.match(line):
            return self._syntax_error(match)
        if match := _CMAKE.match(line):
            return self._cmake(match)
        if match := _CMAKE_PLAIN.match(line):
            return self._plain_cmake(match[1])
        if match := _INTERFACE.match(line):
            return self._at(match[1], None, match[2])
        if match := _COMPILER.match(line):
            return self._at(match[1], int(match[2]), match[3])
        if match := _MANIFEST.match(line):
            reason = "".join(self.lines[self.number + 1 : self.number + 2]).strip("- ")
            blamed = self._at(match[1], None, reason or line)
            return blamed and self.sources.manifest_errors.get(blamed.file, blamed)
        if _NO_SETUP_PY.match(line):
            return SourceError(self.setup_py, None, "there is no setup.py")
        if match := _DIED.match(line):
            return self._setup(f"setup.py died with {match[1]}")
        if match := _SETUPTOOLS.match(line):
            return self._setup(match[1])
        return None

    def _own(self, path: str) -> str | None:
        """The student's file that a path of the log means."""
        folder = self.sources.folders.get(self.package, ".")
        candidates = [path, join(folder, path)]
        installed = _INSTALLED.fullmatch(path)
        if installed:
            candidates.append(join(folder, installed[1]))
        normal = (posixpath.normpath(candidate) for candidate in candidates)
        return next((name for name in normal if name in self.sources.files), None)

    def _at(self, path: str, line: int | None, message: str) -> SourceError | None:
        file = self._own(path)
        return SourceError(file, line, message) if file else None

    def _block(self) -> list[str]:
        """The following lines that are indented, and the first that is not."""
        block = []
        for line in self.lines[self.number + 1 : self.number + 400]:
            block.append(line)
            if line and not line[0].isspace():
                break
        return block

    def _traceback(self) -> SourceError | None:
        block = self._block()
        message = block[-1] if block else ""
        if not self.package:
            return self._while_identifying()
        if message.startswith("configparser."):
            config = self._config(message, self.number + len(block))
            if config is not None:
                return config
        file, at, in_setup = None, None, False
        for line in block:
            frame = _FRAME.match(line)
            if frame is None:
                continue
            path = self.setup_py if in_setup and frame[1] == "<string>" else frame[1]
            in_setup = in_setup or _RUN_SETUP in line
            own = self._own(path)
            if own:
                file, at = own, int(frame[2])
        if file:
            return SourceError(file, at, message)
        if _NEVER_CALLED in message:
            malformed = self.sources.malformed.get(self.package)
            if malformed:
                return malformed[0]
            return self._setup("setup() is never called, or refuses its arguments")
        if any(_ABSOLUTE_DATA in line for line in block):
            return self._setup("data_files names an absolute folder; write 'share/<package>'")
        if any(_READ_OUTPUT in line for line in block):
            return self._setup("setup.py prints something, which colcon takes for its answer")
        return None

    def _config(self, message: str, number: int) -> SourceError | None:
        """What is wrong in setup.cfg, which setup.py reads and which the error itself names."""
        said = "\n".join(self.lines[number : number + 3])
        found = _CONFIG.search(said)
        if found is None:
            return None
        return self._at("setup.cfg", int(found[1]), _HAS_BOM if _BOM in said else message)

    def _while_identifying(self) -> SourceError | None:
        """Colcon says only afterwards whose setup.py it ran to learn the package's name."""
        for line in self.lines[self.number + 1 : self.number + 60]:
            match = _IDENTIFYING.match(line)
            for package, folder in self.sources.folders.items():
                if match and posixpath.normpath(match[1]) == folder:
                    return replace(self, package=package)._traceback()
        return None

    def _plain_cmake(self, message: str) -> SourceError | None:
        if _NO_CMAKELISTS not in message:
            return self._at("CMakeLists.txt", None, message)
        if self.setup_py in self.sources.files:
            message = "names no <build_type>; a Python package has ament_python in its <export>"
        else:
            message = "there is no CMakeLists.txt beside it, which this build type needs"
        return self._at("package.xml", None, message)

    def _syntax_error(self, frame: re.Match[str]) -> SourceError | None:
        following = self.lines[self.number + 1 : self.number + 5]
        found = next((line for line in following if _SYNTAX_ERROR.match(line)), None)
        return self._at(frame[1], int(frame[2]), found) if found else None

    def _cmake(self, match: re.Match[str]) -> SourceError | None:
        paragraphs = _paragraphs(self._block())
        message = paragraphs[0] if paragraphs else f"{match[3]} failed"
        if any(_TRACEBACK in paragraph for paragraph in paragraphs):
            # The generators of interfaces: what they raise is the last that they say.
            message = paragraphs[-1]
            quoted = self._quoted(message, _INTERFACES)
            if quoted is not None:
                return quoted
        blamed = self._at(match[1], int(match[2]), message)
        for caller in map(_CMAKE_CALLER.match, self._block_after("Call Stack")):
            if blamed is None and caller is not None:
                blamed = self._at(caller[1], int(caller[2]), message)
        return blamed

    def _block_after(self, heading: str) -> list[str]:
        for number in range(self.number + 1, min(self.number + 40, len(self.lines))):
            if self.lines[number].startswith(heading):
                return _Place(self.lines, number, self.package, self.sources)._block()
        return []

    def _setup(self, message: str) -> SourceError | None:
        if self.setup_py not in self.sources.files:
            return None
        return self._quoted(message, ("setup.py",)) or SourceError(self.setup_py, None, message)

    def _quoted(self, message: str, endings: tuple[str, ...]) -> SourceError | None:
        """The first line of such a file of the package that has what the message quotes."""
        folder = self.sources.folders.get(self.package, ".")
        for quoted in _QUOTED.findall(message)[:_MOST_QUOTED]:
            word = re.compile(rf"(?<![\w-]){re.escape(quoted)}(?![\w-])")
            for file, lines in sorted(self.sources.texts.items()):
                if not (is_within(file, folder) and file.endswith(endings)):
                    continue
                for number, line in enumerate(lines[:_MOST_LINES], start=1):
                    if word.search(line):
                        return SourceError(file, number, message)
        return None


def _paragraphs(block: Sequence[str]) -> list[str]:
    """Join the indented lines of a message of CMake to paragraphs."""
    paragraphs: list[list[str]] = [[]]
    for line in block:
        if line and not line[0].isspace():
            break
        if line.strip():
            paragraphs[-1].append(line.strip())
        elif paragraphs[-1]:
            paragraphs.append([])
    return [" ".join(lines) for lines in paragraphs if lines]
