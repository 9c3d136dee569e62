"""Checks of when callbacks run."""
