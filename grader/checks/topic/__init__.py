"""Checks of topics and their types."""
