"""``python -m grader`` is the command ``rosgrade``."""

from grader.cli.app import main

main()
