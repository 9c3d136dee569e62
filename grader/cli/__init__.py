"""The command line: one module per command, no logic of its own.

Exit codes: 0 full points, 1 points lost, 2 wrong use or bad YAML, 3 not graded (our fault or
the machine's), 130 interrupted.
"""

POINTS_LOST, USAGE, NOT_GRADED = 1, 2, 3
