"""Functions that an author wrote in a file beside assignment.yaml, as checks or for stimuli.

A check is named in the YAML as ``python: checks.py:straight``, and is such a function::

    def straight(recording, topic: str, tolerance: Ratio = 0.01) -> Finding:
        ...

The first argument is the :class:`~grader.recording.model.Recording`; the others are the keys
of ``with``, validated by their annotations. It runs in the grader's own process: its author is
trusted, a student never is. Every error in it is a ValueError for the author.
"""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from inspect import Parameter
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

from pydantic import create_model
from pydantic.errors import PydanticUserError

from grader.checks.check import Check, Parameters, Subject
from grader.findings.finding import Finding
from grader.spec.nearest_name import did_you_mean, nearest_or_all

_FILE_AND_FUNCTION = re.compile(r"([A-Za-z_]\w*\.py):([A-Za-z_]\w*)")


@contextmanager
def naming_place(folder: Path, prefix: str = "") -> Iterator[None]:
    """Turn what the author's code in a folder raises into a ValueError with its file and line."""
    try:
        yield
    except SyntaxError as error:
        file_name = Path(error.filename or folder).name
        raise ValueError(f"{prefix}{file_name}:{error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        authors = [frame for frame in frames if Path(frame.filename).parent == folder]
        place = f"{Path(authors[-1].filename).name}:{authors[-1].lineno}: " if authors else ""
        raise ValueError(f"{prefix}{place}{type(error).__name__}: {error}") from error


def load_function(text: str, folder: Path) -> Callable[..., Any]:
    """Load the function that ``file.py:function`` names, without looking at its arguments."""
    match = _FILE_AND_FUNCTION.fullmatch(text)
    if not match:
        raise ValueError(f"{text!r} does not name a function: write 'file.py:function'")
    file, name = folder / match[1], match[2]
    module = _executed(file)
    function = vars(module).get(name)
    if not inspect.isfunction(function):
        functions = inspect.getmembers(module, inspect.isfunction)
        defined_there = [key for key, value in functions if value.__module__ == module.__name__]
        advice = nearest_or_all(name, defined_there, "Its functions")
        raise ValueError(f"{file.name} has no function {name!r}.{advice}")
    return function


def _executed(file: Path) -> ModuleType:
    """A module of what a file defines: executed and not imported, so that nothing is cached."""
    try:
        source = file.read_bytes()
    except OSError as error:
        advice = did_you_mean(file.name, [path.name for path in file.parent.glob("*.py")])
        raise ValueError(f"cannot read {file.name}: {error.strerror}.{advice}") from error
    name = f"rosgrade_own_{sha256(str(file.resolve()).encode() + source).hexdigest()[:16]}"
    module = ModuleType(name)
    module.__file__ = str(file)
    # Dataclasses and type hints look their module up there.
    sys.modules[name] = module
    with naming_place(file.parent):
        exec(compile(source, str(file), "exec", dont_inherit=True), module.__dict__)
    return module


def load_own_check(text: str, folder: Path) -> Check:
    """Load the function that ``python:`` names as a check."""
    function = load_function(text, folder)
    arguments = list(inspect.signature(function).parameters.values())
    by_position = (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)
    if not arguments or arguments[0].kind not in by_position:
        raise ValueError(f"{text}: the function must take the recording as its first argument")
    keys_of_with = arguments[1:]
    for argument in keys_of_with:
        if argument.kind not in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY):
            raise ValueError(f"{text}: the argument '{argument}' cannot be a key of 'with'")

    def judge(recording: Any, values: Parameters) -> Any:
        keywords = {one.name: getattr(values, one.name) for one in keys_of_with}
        return function(recording, **keywords)

    judge.__doc__ = inspect.getdoc(function) or f"{function.__name__.replace('_', ' ')}."
    return Check(text, Subject.RECORDING, _parameters(text, function, keys_of_with), judge)


def _parameters(
    name: str, function: Callable[..., Any], arguments: list[Parameter]
) -> type[Parameters]:
    """A model of the keys of ``with``: each has the annotation and the default of its argument."""
    fields: dict[str, Any] = {}
    try:
        hints = get_type_hints(function, include_extras=True)
        for argument in arguments:
            is_required = argument.default is Parameter.empty
            default = ... if is_required else argument.default
            fields[argument.name] = (hints.get(argument.name, Any), default)
        model = create_model(function.__name__, __base__=Parameters, **fields)
    except (NameError, TypeError, AttributeError, PydanticUserError) as error:
        reason = str(error).splitlines()[0]
        raise ValueError(f"{name}: its annotations cannot be read: {reason}") from error
    returned = hints.get("return", Finding)
    if isinstance(returned, type) and not issubclass(returned, Finding):
        raise ValueError(f"{name}: it returns {returned.__name__}: a check returns a Finding")
    return model
