"""The command ``rosgrade``, also as ``python -m grader``."""

import sys

_INTERRUPTED = 130


def main() -> None:
    """Run the command; Ctrl-C during the imports ends it as at any other time."""
    try:
        from grader.cli.app import main as run
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
    run()


if __name__ == "__main__":
    main()
