"""Checks of what clients of the student ask of the scenario's servers."""
