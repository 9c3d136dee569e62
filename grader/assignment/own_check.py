"""An instructor's own check: a Python function beside assignment.yaml.

.. code-block:: python

    def straight(recording, topic: str, tolerance: Ratio = 0.01) -> Finding:
        ...

The first argument is the :class:`~grader.recording.model.Recording`; the others are the keys
of ``with``, validated by their annotations. The file runs in the grader's own process: its
author is trusted, a student never is.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

from pydantic import ConfigDict, create_model
from pydantic.errors import PydanticUserError

from grader.checks.check import Check, Parameters, Subject
from grader.checks.finding import Finding
from grader.spec.nearest_name import did_you_mean

# Expressions that are never a finding; `early or Finding.passed(...)` may well be one.
_NO_FINDING = (ast.Constant, ast.Compare, ast.UnaryOp, ast.JoinedStr, ast.List, ast.Tuple, ast.Dict)
_FORM = re.compile(r"([A-Za-z_]\w*\.py):([A-Za-z_]\w*)")


def load_own_check(text: str, folder: Path) -> Check:
    """Load the function that ``python:`` names.

    Raises:
        ValueError: With a message for the author, when the text has another form, the file
            is missing or fails, or the function is missing or takes other arguments.
    """
    return _check(text, load_function(text, folder))


def load_function(text: str, folder: Path) -> Callable[..., Any]:
    """Load a function of the author's, without looking at its arguments.

    Raises:
        ValueError: With a message for the author, when the text has another form, the file
            is missing or fails, or the function is missing.
    """
    match = _FORM.fullmatch(text)
    if not match:
        raise ValueError(
            f"{text!r} does not name a function: write 'file.py:function', with the file "
            "beside assignment.yaml"
        )
    file, name = folder / match[1], match[2]
    module = _module(file)
    own = {
        key: value
        for key, value in vars(module).items()
        if inspect.isfunction(value) and value.__module__ == module.__name__
    }
    function = vars(module).get(name)
    if function is None:
        listed = f" Its functions: {', '.join(own)}." if own else " It defines no function."
        raise ValueError(f"{file.name} has no {name!r}." + (did_you_mean(name, own) or listed))
    if not inspect.isfunction(function):
        raise ValueError(f"{name!r} in {file.name} is not a function")
    return function


def _module(file: Path) -> ModuleType:
    try:
        source = file.read_bytes()
    except OSError as error:
        beside = sorted(path.name for path in file.parent.glob("*.py"))
        advice = did_you_mean(file.name, beside)
        raise ValueError(f"cannot read {file.name}: {error.strerror}.{advice}") from error
    name = f"rosgrade_own_{sha256(str(file.resolve()).encode() + source).hexdigest()[:16]}"
    module = ModuleType(name)
    module.__file__ = str(file)
    # Dataclasses and type hints look their module up there.
    sys.modules[name] = module
    try:
        # Not imported, so that no __pycache__ appears in the assignment's folder.
        exec(compile(source, str(file), "exec", dont_inherit=True), module.__dict__)
    except SyntaxError as error:
        raise ValueError(f"{file.name}:{error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        line = next((f.lineno for f in reversed(frames) if f.filename == str(file)), None)
        place = f"{file.name}:{line}" if line else file.name
        raise ValueError(f"{place}: {type(error).__name__}: {error}") from error
    return module


def _check(name: str, function: Callable[..., Any]) -> Check:
    arguments = list(inspect.signature(function).parameters.values())
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    if not arguments or arguments[0].kind not in positional:
        raise ValueError(f"{name}: the function must take the recording as its first argument")
    for argument in arguments[1:]:
        if argument.kind not in (
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            inspect.Parameter.KEYWORD_ONLY,
        ):
            raise ValueError(f"{name}: the argument '{argument}' cannot be given as a key of with")
    keys = [argument.name for argument in arguments[1:]]
    parameters = _parameters(name, function, arguments[1:])
    _refuse_other_returns(name, function)

    def judge(recording: Any, values: Parameters) -> Any:
        return function(recording, **{key: getattr(values, key) for key in keys})

    judge.__doc__ = inspect.getdoc(function) or f"{function.__name__.replace('_', ' ')}."
    return Check(name, Subject.RECORDING, parameters, judge)


def _refuse_other_returns(name: str, function: Callable[..., Any]) -> None:
    """Find what is returned in place of a finding, as far as it can be seen without a call.

    Raises:
        ValueError: Something else is returned, or nothing.
    """
    file = Path(inspect.unwrap(function).__code__.co_filename)
    tree = ast.parse(file.read_bytes())
    defined = [one for one in tree.body if isinstance(one, ast.FunctionDef)]
    body = next((one for one in reversed(defined) if one.name == function.__name__), None)
    # A decorator may make a finding of anything.
    if body is None or body.decorator_list:
        return
    returns = list(_returns(body))
    for found in returns:
        if found.value is None or isinstance(found.value, _NO_FINDING):
            raise ValueError(
                f"{file.name}:{found.lineno}: {name.partition(':')[2]}() must return a Finding, "
                f"not {ast.unparse(found.value) if found.value else 'nothing'}: "
                "Finding.passed(expected, observed) or Finding.failed(expected, observed, hint)"
            )
    if not returns and not isinstance(body.body[-1], ast.Raise):
        raise ValueError(f"{name}: the function returns nothing: it must return a Finding")


def _returns(node: ast.AST) -> Iterator[ast.Return]:
    """The return statements of a function, without those of functions inside it."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Return):
            yield child
        elif not isinstance(child, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            yield from _returns(child)


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
        returned = hints.get("return", Finding)
        if isinstance(returned, type) and not issubclass(returned, Finding):
            raise ValueError(f"{name}: it returns {returned.__name__}: a check returns a Finding")
        return create_model(function.__name__, __base__=_OwnParameters, **fields)
    except (NameError, TypeError, AttributeError, PydanticUserError) as error:
        said = str(error).splitlines()[0]
        raise ValueError(f"{name}: its annotations cannot be read: {said}") from error


class _OwnParameters(Parameters):
    """Base of the parameters of own checks, which may be annotated with any class."""

    model_config = ConfigDict(arbitrary_types_allowed=True)
