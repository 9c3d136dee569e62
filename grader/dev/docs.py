"""``make docs``: write the pages of ``docs/`` that are made from the code.

``python -m grader.dev.docs --check`` writes nothing: a stale file is an error.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from grader.authoring.documentation import documents
from grader.machine import resources


def main(arguments: list[str] | None = None) -> int:
    """Write the files, or with ``--check`` only compare them."""
    parser = argparse.ArgumentParser(prog="python -m grader.dev.docs", description=__doc__)
    parser.add_argument("--check", action="store_true", help="only compare; 1 if one is stale")
    parser.add_argument("--folder", type=Path, default=resources.root() / "docs")
    options = parser.parse_args(arguments)
    old = False
    for name, text in documents().items():
        file = options.folder / name
        if file.is_file() and file.read_text(encoding="utf-8") == text:
            continue
        old = True
        if options.check:
            print(f"{file} is stale: run python -m grader.dev.docs", file=sys.stderr)
        else:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
            print(file)
    return 1 if old and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
