"""Who reads a format, and what is left of a result for that reader."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import wraps
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from grader.report.model.result_model import Result
from grader.report.model.student import for_student
from grader.spec.safe_text import clean

F = TypeVar("F", bound=Callable[..., Any])


class Audience(str, Enum):
    """Who reads a format."""

    STUDENT = "student"
    """Hidden checks are left out."""
    INSTRUCTOR = "instructor"


RENDERERS: dict[Callable[..., Any], Audience] = {}
"""Every function that writes a result, as its caller sees it."""


def written_for(audience: Audience) -> Callable[[F], F]:
    """Decorator: what a format gets is what its audience may see, with clean text."""

    def declare(render: F) -> F:
        @wraps(render)
        def rendered(result: Result, *args: Any, **kwargs: Any) -> Any:
            seen = for_student(result) if audience is Audience.STUDENT else result
            return render(_cleaned(seen), *args, **kwargs)

        RENDERERS[rendered] = audience
        return cast(F, rendered)

    return declare


def _cleaned(value: Any) -> Any:
    """The same without what acts on a screen, or is no text to a reader of XML."""
    if isinstance(value, str) and not isinstance(value, Enum):
        return clean(value)
    if isinstance(value, tuple):
        return tuple(map(_cleaned, value))
    if isinstance(value, dict):
        return {_cleaned(name): _cleaned(item) for name, item in value.items()}
    if isinstance(value, BaseModel):
        inner = {name: _cleaned(getattr(value, name)) for name in type(value).model_fields}
        return value.model_copy(update=inner)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(
            value, **{one.name: _cleaned(getattr(value, one.name)) for one in fields(value)}
        )
    return value
