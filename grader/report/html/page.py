"""What all pages for a browser share: templates, style, script, and the policy that guards them.

A page needs no network. Text that a student chose is untrusted: every value is cleaned of control
characters and escaped on its way into the page, and the page's own policy forbids requests and
every script and style but its own, which it names by their hashes.
"""

from __future__ import annotations

import contextlib
import os
from base64 import b64encode
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from grader.findings.finding import Status
from grader.findings.words import counted
from grader.machine import resources
from grader.report.text import additions, explanation, words
from grader.spec.safe_text import clean, one_line

if TYPE_CHECKING:
    from jinja2 import Environment, FileSystemBytecodeCache


def render_page(
    template: str, styles: tuple[str, ...], *scripts: str, policy: str = "", **values: Any
) -> str:
    """Render a page.

    Args:
        template: Its file, as that of the others in ``templates/``.
        scripts: A page without one runs none.
        policy: What it may do besides, as in a Content-Security-Policy.
        values: What the template prints.
    """
    style, code = "".join(map(_asset, styles)), "".join(map(_asset, scripts))
    values |= {"style": Markup(style), "script": Markup(code)}
    values["policy"] = _content_security_policy(style, code) + policy
    return environment().get_template(template).render(values)


@cache
def _asset(name: str) -> str:
    return (resources.templates() / name).read_text(encoding="utf-8")


def _content_security_policy(style: str, script: str) -> str:
    """The page's own style and script by their hashes, and nothing else at all.

    https://www.w3.org/TR/CSP3/
    """
    sources = [
        f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" if text else "'none'"
        for text in (style, script)
    ]
    return (
        f"default-src 'none'; style-src {sources[0]}; script-src {sources[1]}; "
        "base-uri 'none'; form-action 'none'"
    )


@cache
def environment() -> Environment:
    """The templates, with the functions that they call; all output is cleaned and escaped."""
    # Imported late: the commands that write no report start faster without it.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(resources.templates()),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_cleaned,
        bytecode_cache=compiled_templates(resources.cache_folder() / "templates"),
    )
    environment.filters["prose"] = prose
    environment.filters["number"] = words.number
    environment.filters["one_line"] = one_line
    environment.globals.update(
        Status=Status, additions=additions, counted=counted, explanation=explanation, words=words
    )
    return environment


def compiled_templates(folder: Path) -> FileSystemBytecodeCache | None:
    """A folder that keeps compiled templates from one start to the next, for its owner alone.

    None where nothing can be written: then each start compiles.
    """
    from jinja2 import FileSystemBytecodeCache

    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return FileSystemBytecodeCache(str(folder)) if os.access(folder, os.W_OK) else None


def _cleaned(value: Any) -> Any:
    return clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def prose(text: str) -> Markup:
    """Text of a finding, with what stands between backticks as code."""
    parts = clean(text).split("`")
    if len(parts) % 2 == 0:
        parts[-2:] = [f"{parts[-2]}`{parts[-1]}"]
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if index % 2 else escape(part)
        for index, part in enumerate(parts)
    )
