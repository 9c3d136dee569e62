"""Causes in a student's process: what it raised, how it ended, what blocks it."""
