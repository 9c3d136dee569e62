"""Checks of parameters."""
