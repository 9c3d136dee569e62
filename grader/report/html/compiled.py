"""What the templates are compiled to, kept from one start to the next."""

from __future__ import annotations

import contextlib
from pathlib import Path

from jinja2.bccache import Bucket, FileSystemBytecodeCache


class CompiledTemplates(FileSystemBytecodeCache):
    """A folder of compiled templates; where it cannot be written, each start compiles them."""

    def __init__(self, folder: Path) -> None:
        """Keep them in a folder, which is made; only its owner may look into it."""
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        super().__init__(str(folder))

    def load_bytecode(self, bucket: Bucket) -> None:
        """Look for a template that was kept."""
        with contextlib.suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep a template, if that is possible."""
        with contextlib.suppress(OSError):
            super().dump_bytecode(bucket)
