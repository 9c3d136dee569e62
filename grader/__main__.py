"""The command ``rosgrade``, also as ``python -m grader``."""

import gc
import sys

_INTERRUPTED = 130
_OBJECTS_PER_COLLECTION = 100_000
"""Recordings and results hold no cycles; to look for some after each 700 objects, as Python does by
itself, takes a fifth of the time of a regrade."""


def main() -> None:
    """Run the command; Ctrl-C during the imports ends it as at any other time."""
    gc.set_threshold(_OBJECTS_PER_COLLECTION)
    try:
        from grader.cli.app import main as run
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
    run()


if __name__ == "__main__":
    main()
