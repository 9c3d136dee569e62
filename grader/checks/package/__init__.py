"""Checks of packages as handed in and built."""
