"""Checks: pure functions of what was recorded, a module per family."""
