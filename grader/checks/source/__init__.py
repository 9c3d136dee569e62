"""Checks of Python source as handed in."""
