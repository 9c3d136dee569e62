"""The tables of known exceptions, ``exceptions.yaml`` and ``exceptions_cpp.yaml``."""

from __future__ import annotations

import re
from pathlib import Path
from string import Template

from pydantic import Field

from grader.diagnosis.process.failure import Failure, Frame
from grader.findings.words import Words
from grader.recording.submission import CPP
from grader.spec.source import Model, read_source


class KnownException(Model):
    """A row of a table: a mistake, how to recognise its exception, and what to try.

    What each column means stands at the top of ``exceptions.yaml``. All those that recognise the
    exception must match; one that is left out matches any exception.

    Attributes:
        only: The one language of the programs that it explains, or nothing if any.
    """

    mistake: str
    example: str
    only: str = ""
    line: str = ""
    type: str = ""
    message: str = ""
    raised_in: str = ""
    source: str = ""
    hint: str | Words

    def hint_for(self, failure: Failure) -> str | None:
        """The hint, if the exception is that of the mistake."""
        if self.only == CPP and not failure.compiled:
            return None
        # Classes of C++ have the same names as those of Python, in a namespace.
        class_name = failure.type.rpartition("::")[2]
        if self.type and not re.fullmatch(self.type, class_name):
            return None
        message = re.search(self.message, failure.message)
        raising = failure.frames[-1] if failure.frames else Frame("", 0)
        if message is None or self.raised_in not in raising.file:
            return None
        names = {name: text for name, text in message.groupdict().items() if text}
        if not re.search(Template(self.source).safe_substitute(names), raising.source):
            return None
        return Template(str(self.hint)).safe_substitute(names)


class Table(Model):
    """The whole of ``exceptions.yaml``, or of ``exceptions_cpp.yaml``.

    Attributes:
        imports: The beginning of a line that imports something -> names, with blanks between.
    """

    exceptions: tuple[KnownException, ...]
    imports: dict[str, str] = Field(default_factory=dict)


TABLE = read_source(Path(__file__).with_name("exceptions.yaml")).read(Table)
CPP_ROWS = tuple(
    row.model_copy(update={"only": CPP})
    for row in read_source(Path(__file__).with_name("exceptions_cpp.yaml")).read(Table).exceptions
)


def import_of(name: str) -> str | None:
    """The line that imports a well-known name of ROS 2 or Python, if it is one."""
    for beginning, names in TABLE.imports.items():
        if name in names.split():
            return f"{beginning} {name}"
    return None
