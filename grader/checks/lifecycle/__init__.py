"""Checks of lifecycle nodes."""
