"""Python of an author beside assignment.yaml; every error in it is a ValueError for the author.

The package ``checks/`` defines checks as rosgrade's own do; its modules import each other
(``from .conversion import ...``). A file has functions: of messages for stimuli, and checks::

    def straight(recording, topic: str, tolerance: Ratio = 0.01) -> Finding:
        ...

The first argument is the :class:`~grader.recording.model.Recording`; the others are the keys
of ``with``, validated by their annotations. All of it runs in the grader's own process: its
author is trusted, a student never is.
"""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from threading import Lock
from types import MappingProxyType, ModuleType
from typing import Any, get_type_hints

from pydantic import create_model
from pydantic.errors import PydanticUserError

from grader.checks.catalogue import CATALOGUE, gather
from grader.checks.check import Check, Parameters, Subject
from grader.findings.finding import Finding
from grader.machine import resources
from grader.spec.nearest_name import did_you_mean, nearest_or_all

FOLDER = "checks"
_IMPORTING = Lock()
_FORM = re.compile(r"([A-Za-z_]\w*\.py):([A-Za-z_]\w*)")


@contextmanager
def naming_place(folder: Path, prefix: str = "") -> Iterator[None]:
    """Turn what the author's code raises into a ValueError with its file and line."""
    try:
        yield
    except SyntaxError as error:
        place = Path(error.filename or folder).name
        raise ValueError(f"{prefix}{place}:{error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        inside = [frame for frame in frames if Path(frame.filename).parent == folder]
        place = f"{Path(inside[-1].filename).name}:{inside[-1].lineno}: " if inside else ""
        raise ValueError(f"{prefix}{place}{type(error).__name__}: {error}") from error


def load_function(text: str, folder: Path) -> Callable[..., Any]:
    """Load the function that ``file.py:function`` names, without looking at its arguments."""
    match = _FORM.fullmatch(text)
    if not match:
        raise ValueError(f"{text!r} does not name a function: write 'file.py:function'")
    file, name = folder / match[1], match[2]
    module = _module(file)
    function = vars(module).get(name)
    if not inspect.isfunction(function):
        functions = inspect.getmembers(module, inspect.isfunction)
        own = [key for key, value in functions if value.__module__ == module.__name__]
        advice = nearest_or_all(name, own, "Its functions")
        raise ValueError(f"{file.name} has no function {name!r}.{advice}")
    return function


def _module(file: Path) -> ModuleType:
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
        # Not imported, so that no __pycache__ appears in the assignment's folder.
        exec(compile(source, str(file), "exec", dont_inherit=True), module.__dict__)
    return module


def load_own_check(text: str, folder: Path) -> Check:
    """Load the function that ``python:`` names as a check."""
    function = load_function(text, folder)
    found = list(inspect.signature(function).parameters.values())
    first, arguments = found[:1], found[1:]
    if not any(one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD) for one in first):
        raise ValueError(f"{text}: the function must take the recording as its first argument")
    for argument in arguments:
        if argument.kind not in (argument.POSITIONAL_OR_KEYWORD, argument.KEYWORD_ONLY):
            raise ValueError(f"{text}: the argument '{argument}' cannot be a key of 'with'")

    def judge(recording: Any, values: Parameters) -> Any:
        keys = {argument.name: getattr(values, argument.name) for argument in arguments}
        return function(recording, **keys)

    judge.__doc__ = inspect.getdoc(function) or f"{function.__name__.replace('_', ' ')}."
    return Check(text, Subject.RECORDING, _parameters(text, function, arguments), judge)


def _parameters(
    name: str, function: Callable[..., Any], arguments: list[inspect.Parameter]
) -> type[Parameters]:
    fields: dict[str, Any] = {}
    try:
        hints = get_type_hints(function, include_extras=True)
        for argument in arguments:
            required = argument.default is inspect.Parameter.empty
            default = ... if required else argument.default
            fields[argument.name] = (hints.get(argument.name, Any), default)
        model = create_model(function.__name__, __base__=Parameters, **fields)
    except (NameError, TypeError, AttributeError, PydanticUserError) as error:
        reason = str(error).splitlines()[0]
        raise ValueError(f"{name}: its annotations cannot be read: {reason}") from error
    returned = hints.get("return", Finding)
    if isinstance(returned, type) and not issubclass(returned, Finding):
        raise ValueError(f"{name}: it returns {returned.__name__}: a check returns a Finding")
    return model


def lesson_checks(assignment: Path) -> Mapping[str, Check]:
    """The checks in the package of an assignment's folder, by name."""
    folder = assignment / FOLDER
    files = sorted(folder.glob("*.py"))
    if not files:
        return MappingProxyType({})
    content = b"".join(file.name.encode() + file.read_bytes() for file in files)
    name = f"rosgrade_lesson_{sha256(str(folder.resolve()).encode() + content).hexdigest()[:16]}"
    with _IMPORTING:
        found = gather(_modules(name, folder, files))
    for taken in sorted(set(found) & set(CATALOGUE)):
        raise ValueError(f"{FOLDER}/: rosgrade has a check {taken!r} too: choose another name")
    return found


def _modules(package: str, folder: Path, files: list[Path]) -> list[ModuleType]:
    """Import the modules of a package that stands in no ``sys.path``."""
    if package not in sys.modules:
        module = ModuleType(package)
        module.__path__ = [str(folder)]
        sys.modules[package] = module
    # Bytecode goes to the cache, so that the assignment's folder and its hash stay as they are.
    before, sys.pycache_prefix = sys.pycache_prefix, str(resources.cache_folder() / "bytecode")
    try:
        with naming_place(folder, f"{FOLDER}/"):
            names = [one.stem for one in files if one.stem != "__init__"]
            return [import_module(f"{package}.{name}") for name in names]
    finally:
        sys.pycache_prefix = before


def all_checks() -> Mapping[str, Check]:
    """The catalogue with the checks of rosgrade's own lessons."""
    found = dict(CATALOGUE)
    for folder in sorted(resources.assignments().glob(f"*/{FOLDER}")):
        found.update(lesson_checks(folder.parent))
    return MappingProxyType(found)
