"""Requests of a page that change something, and what they are answered when that cannot be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from grader.errors import RosgradeError
from grader.review.store import ReviewConflict


def posted(answer: Callable[[Request, Any], Response]) -> Callable[[Request], Any]:
    """An endpoint that reads what a page sent, and answers in a thread: files may be slow."""

    async def endpoint(request: Request) -> Response:
        try:
            return await run_in_threadpool(answer, request, await request.json())
        except ValidationError:
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            return PlainTextResponse(f"This request makes no sense: {error!r}", 422)

    return endpoint


def _problem(_: Request, error: Exception) -> Response:
    text = str(error)
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        text = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    return PlainTextResponse(text, 409 if isinstance(error, ReviewConflict) else 422)


PROBLEMS: Mapping[Any, Any] = {RosgradeError: _problem, ValidationError: _problem}
"""How an application answers what cannot be done, as its ``exception_handlers``."""
