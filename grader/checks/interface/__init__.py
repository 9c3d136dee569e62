"""Checks of messages, services and actions that a package defines."""
