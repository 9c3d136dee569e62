"""The student's file and line that a build log names first as the reason of a failure."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from grader.recording.submission import SourceError
from grader.submission.intake.paths import join, shown

_STARTED = re.compile(r"Starting >>> (\S+)")
_TRACEBACK = "Traceback (most recent call last):"
_FRAME = re.compile(r'\s*File "([^"]+)", line (\d+)')
_CMAKE = re.compile(r"CMake Error at (.+?):(\d+)(?: \((\w+)\))?:")
_CMAKE_PLAIN = re.compile(r"CMake Error: (.+)")
_CMAKE_CALLER = re.compile(r"\s+(\S+):(\d+) \(\w+\)")
_COMPILER = re.compile(r"([^\s:]+):(\d+)(?::\d+)?: (?:fatal )?error: (.+)")
_LINKER = re.compile(
    r"(?:\S*ld: )?(?:(?P<file>[^\s:()]+):)?(?:(?P<line>\d+)|\([^()\s]+\)): "
    r"(?P<message>(?:undefined reference to|multiple definition of) .+)"
)
# How a compiler says what led to an error in the code of others: where a template of theirs is
# used (gcc before the error, clang after it), and where a header is included.
_REQUIRED = re.compile(r"([^\s:]+):(\d+):\d+: +(?:recursively )?required (?:from|by)")
_REQUESTED = re.compile(r"([^\s:]+):(\d+):\d+: note: in instantiation of")
_INCLUDED = re.compile(r"(?:In file included | +)from ([^\s:]+):(\d+)")
_COMPILING = re.compile(r"Building CX{0,2} object CMakeFiles/\S+?\.dir/(\S+)\.o$", re.MULTILINE)
# How far from an error its parts are looked for: a message of a compiler with templates, one of
# CMake with what a program of it printed, and the list of callers below that.
_MOST_AROUND, _LONGEST_BLOCK, _CALLERS_WITHIN = 200, 400, 40
_MANIFEST = re.compile(r"(?:\S*InvalidPackage: )?Error\(s\) in package '([^']+)':")
_SETUPTOOLS = re.compile(r"error: (.+)")
_NO_SETUP_PY = re.compile(r".*can't open file '[^']*setup\.py'")
_INTERFACE = re.compile(r"Error processing '([^']+)' of package '[^']+': (.+)")
_QUOTED = re.compile(r"'([^']+)'")
_RUN_SETUP = ", in run_setup"
_NO_CMAKELISTS = "does not appear to contain CMakeLists.txt"
_ENDED = re.compile(r"^(?:Failed|Aborted) +<<<", re.MULTILINE)
# What colcon and make say of a program that failed, and not that program itself.
_AROUND = re.compile(r"g?make(\[\d+\])?: |ninja: |---( |$)")
_ERROR = re.compile(r"\berror\b|^[\w.]+Error\b|undefined reference", re.IGNORECASE)
_MAX_MESSAGE = 500
_MOST_QUOTED = 10
_MOST_LINES = 10_000
"""Of a file, in which a quoted name is looked for."""


@dataclass(frozen=True)
class Sources:
    """What the search needs to know of the submission.

    Attributes:
        folders: Of each package.
        texts: Lines of each interface file, in which quoted names are looked up.
    """

    files: Collection[str]
    folders: Mapping[str, str]
    texts: Mapping[str, Sequence[str]] = field(default_factory=dict)


def find_build_error(log: str, failed: Collection[str], sources: Sources) -> SourceError | None:
    """Find the first place in the student's own files that a cleaned log names.

    Args:
        failed: Packages that were not finished; what the log says of others is no reason.

    Returns:
        For a Python traceback the deepest frame in the student's files.
    """
    lines = log.splitlines()
    package = ""
    for number, line in enumerate(lines):
        started = _STARTED.match(line)
        if started:
            package = started[1]
        elif package in failed or not package:
            error = _Place(lines, number, package, sources).error()
            if error is not None:
                message = shown(error.message)[:_MAX_MESSAGE]
                return SourceError(shown(error.file), error.line, message)
    return None


def last_started(log: str, sources: Sources, problem: str | None) -> SourceError | None:
    """Name the build file of the package that was being built when the log ends.

    Args:
        problem: Why the build ended, or None where only the log tells.
    """
    # What a build file prints may look like colcon's own lines.
    started = [item for item in _STARTED.finditer(log) if item[1] in sources.folders]
    if not started:
        return None
    folder = sources.folders[started[-1][1]]
    message = problem or _last_words(log[started[-1].end() :])
    names = ["setup.py", "CMakeLists.txt", "package.xml"]
    if problem is not None:
        # The compiler was ended at its last file.
        names = _COMPILING.findall(log, started[-1].end())[-1:] + names
    files = [join(folder, name) for name in names]
    file = next((file for file in files if file in sources.files), files[-1])
    return SourceError(shown(file), None, message)


def _last_words(log: str) -> str:
    """The first line of a package's log that tells of an error, or its last line."""
    own = _ENDED.split(log)[0].splitlines()
    lines = [line.strip() for line in own if line.strip() and not _AROUND.match(line)]
    if not lines:
        return "there is no error message"
    errors = (line for line in lines if _ERROR.search(line))
    return next(errors, lines[-1])[:_MAX_MESSAGE]


@dataclass(frozen=True)
class _Place:
    """A line of the log, with what stands around it."""

    lines: list[str]
    number: int
    package: str
    sources: Sources

    @property
    def setup_py(self) -> str:
        return self._path("setup.py")

    def error(self) -> SourceError | None:
        """What this line says is wrong, if it says so."""
        line = self.lines[self.number]
        if line.rstrip().endswith(_TRACEBACK):
            return self._traceback()
        if match := _CMAKE.match(line):
            return self._cmake(match)
        if match := _CMAKE_PLAIN.match(line):
            return self._plain_cmake(match[1])
        if match := _INTERFACE.match(line):
            return self._at(match[1], None, match[2])
        if match := _COMPILER.match(line):
            place = self._at(match[1], int(match[2]), match[3])
            return place or self._used_at(match[3])
        if match := _LINKER.match(line):
            line_number = int(match["line"]) if match["line"] else None
            place = self._at(match["file"] or "", line_number, match["message"])
            return place or self._at("CMakeLists.txt", None, match["message"])
        if match := _MANIFEST.match(line):
            reason = "".join(self.lines[self.number + 1 : self.number + 2]).strip("- ")
            return self._at(match[1], None, reason or line)
        if _NO_SETUP_PY.match(line):
            return SourceError(self.setup_py, None, "there is no setup.py")
        if match := _SETUPTOOLS.match(line):
            return self._at(self.setup_py, None, match[1])
        return None

    def _path(self, name: str) -> str:
        return join(self.sources.folders.get(self.package, "."), name)

    def _at(self, path: str, line: int | None, message: str) -> SourceError | None:
        """The message at the student's file that a path of the log means, if there is one."""
        normal = (posixpath.normpath(candidate) for candidate in (path, self._path(path)))
        file = next((name for name in normal if name in self.sources.files), None)
        return SourceError(file, line, message) if file else None

    def _used_at(self, message: str) -> SourceError | None:
        """The student's line that led to an error in a header of others, if one did."""
        before, after = [], []
        for line in reversed(self.lines[max(self.number - _MOST_AROUND, 0) : self.number]):
            if _COMPILER.match(line):
                break
            before.append(line)
        for line in self.lines[self.number + 1 : self.number + _MOST_AROUND]:
            if _COMPILER.match(line):
                break
            after.append(line)
        for pattern, around in ((_REQUIRED, before), (_REQUESTED, after), (_INCLUDED, before)):
            matches = [match for match in map(pattern.match, around) if match is not None]
            error = self._first_of([(match[1], match[2]) for match in matches], message)
            if error is not None:
                return error
        return None

    def _first_of(self, places: Iterable[tuple[str, str]], message: str) -> SourceError | None:
        """The message at the first of some paths and lines that is in a file of the student's."""
        errors = (self._at(path, int(line), message) for path, line in places)
        return next((error for error in errors if error is not None), None)

    def _block(self) -> list[str]:
        """The following lines that are indented, and the first that is not."""
        block = []
        for line in self.lines[self.number + 1 : self.number + _LONGEST_BLOCK]:
            block.append(line)
            if line and not line[0].isspace():
                break
        return block

    def _traceback(self) -> SourceError | None:
        block = self._block()
        message = block[-1] if block else ""
        deepest, in_setup = None, False
        for line in block:
            if frame := _FRAME.match(line):
                path = self.setup_py if in_setup and frame[1] == "<string>" else frame[1]
                in_setup = in_setup or _RUN_SETUP in line
                deepest = self._at(path, int(frame[2]), message) or deepest
        return deepest

    def _plain_cmake(self, message: str) -> SourceError | None:
        if _NO_CMAKELISTS not in message:
            return self._at("CMakeLists.txt", None, message)
        if self.setup_py in self.sources.files:
            message = "names no <build_type>; a Python package has ament_python in its <export>"
        else:
            message = "there is no CMakeLists.txt beside it, which this build type needs"
        return self._at("package.xml", None, message)

    def _cmake(self, match: re.Match[str]) -> SourceError | None:
        paragraphs = _paragraphs(self._block())
        message = paragraphs[0] if paragraphs else f"{match[3]} failed"
        if message.endswith(":"):
            message = " ".join(paragraphs[:3])
        if any(_TRACEBACK in paragraph for paragraph in paragraphs):
            # The generators of interfaces: what they raise is the last that they say.
            message = paragraphs[-1]
            quoted = self._quoted(message)
            if quoted is not None:
                return quoted
        if match[1] == "cmake_install.cmake":
            return self._at("CMakeLists.txt", None, message)
        return self._first_of([(match[1], match[2]), *self._callers()], message)

    def _callers(self) -> Iterator[tuple[str, str]]:
        """The callers of the command of CMake that failed, the innermost first."""
        end = min(self.number + _CALLERS_WITHIN, len(self.lines))
        for number in range(self.number + 1, end):
            if self.lines[number].startswith("Call Stack"):
                callers = map(_CMAKE_CALLER.match, replace(self, number=number)._block())
                yield from ((caller[1], caller[2]) for caller in callers if caller)
                return

    def _quoted(self, message: str) -> SourceError | None:
        """The first line of an interface of the package that has what the message quotes."""
        folder = self._path("")
        for quoted in _QUOTED.findall(message)[:_MOST_QUOTED]:
            word = re.compile(rf"(?<![\w-]){re.escape(quoted)}(?![\w-])")
            for file, lines in sorted(self.sources.texts.items()):
                if file.startswith(folder):
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
