"""Checks of what was handed in beside packages."""
