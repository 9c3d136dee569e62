"""What the site needs besides MkDocs and its theme, called by MkDocs while it builds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from grader.assignment.contract.table import MARKER, with_table
from grader.assignment.load import ASSIGNMENT_FILE, load_assignment
from grader.report.concepts import with_pictures

# In every page as the theme makes it, and what it becomes.
_MENDED = (
    # A dialog needs a name: https://www.w3.org/WAI/ARIA/apg/patterns/dialog-modal/
    ('role="dialog"', 'role="dialog" aria-label="Search"'),
    # Else a script asks GitHub for the repository's stars.
    ('<div class="md-source__repository">', '<div class="md-source__repository" title="Code">'),
    (' data-md-component="source"', ""),
)


def on_config(config: Any) -> Any:
    """Replace `folder/` in the navigation by all pages of this folder."""
    config.nav = _expanded(config.nav, Path(config.docs_dir))
    return config


def _expanded(item: Any, docs: Path) -> Any:
    if isinstance(item, list):
        return [one for entry in item for one in _as_list(_expanded(entry, docs))]
    if isinstance(item, dict):
        return {title: _expanded(entry, docs) for title, entry in item.items()}
    if item.endswith("/"):
        pages = sorted(str(page.relative_to(docs)) for page in (docs / item).glob("*.md"))
        return [page for page in pages if not page.endswith("/index.md")]
    return item


def _as_list(item: Any) -> list[Any]:
    return item if isinstance(item, list) else [item]


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the table that a contract makes into the handout beside it."""
    folder = Path(page.file.abs_src_path).parent
    if MARKER not in markdown or not (folder / ASSIGNMENT_FILE).is_file():
        return markdown
    return with_table(markdown, load_assignment(folder).assignment)


def on_page_content(html: str, **_: Any) -> str:
    """Put the pictures of concepts into their pages, where they take the colours of the page."""
    return with_pictures(html)


def on_post_page(output: str, **_: Any) -> str:
    """Mend what the theme leaves out."""
    for before, after in _MENDED:
        output = output.replace(before, after)
    return output
