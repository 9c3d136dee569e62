"""Checks of when messages are published."""
