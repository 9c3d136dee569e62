"""The group project."""
