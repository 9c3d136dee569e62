"""Checks of what a program logs or prints."""
