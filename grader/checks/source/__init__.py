"""Checks of the source as handed in."""
